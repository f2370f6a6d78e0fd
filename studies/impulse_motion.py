"""A force pass that gives both partners of a pair the same impulse, however different their steps: see pairwise_impulses.py.

A pair is evaluated whenever one of its particles is due, and each time both get equal and opposite velocities. They are paid up
to the middle of the pair's present step: from its last evaluation to when the earlier of the two is planned to be due next.
So an evaluation pays half of the pair's step behind it and half of that ahead: Serna's trapezium. Where a step ends early, what
was paid for the rest of it goes back. Whatever the steps become, both partners get the same.
"""

import contextlib

from taichi_rts.assembly import build as simulation
from taichi_rts.device import backend as backends
from taichi_rts.device.backend import ti
from taichi_rts.device.fields import vector_field
from taichi_rts.solver.grid.sums import make_neighbour_sum, make_wall_sum
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.particles.fields import components
from taichi_rts.solver.physics.viscosity import viscosity_terms
from taichi_rts.solver.stepping.base import Schedule

TOLD = hasattr(Schedule, "evaluated")
"""Whether schedules want to know new accelerations."""
SETTINGS = {"position": "impulse", "recalls": True}
"""How a position is corrected: "impulse", by what its velocity got, or "serna", by its own new acceleration; and whether a pair
that was paid for a longer step than it had gets the difference back by the old force, worked out again, or by the new one.
"""


@ti.data_oriented
class ImpulseMotion(Motion):
    """`Motion` for `Regional` and one evaluation at a time of each pair, at the step of its faster partner.

    Between its evaluations a particle moves as ever, with the acceleration of the last. What it gets meanwhile from due
    neighbours waits in `owed` until it is due itself. Gravity and walls, to which
    nothing is owed, act with the particle's own steps.
    """

    def __init__(self, particles, near, grid, momentum, integrator, medium, *, walls=(), **options):
        super().__init__(particles, near, grid, momentum, integrator, medium, **options)
        if self.integrates_density or self.moving_walls or self.obstacles or particles.has_past or particles.has_guide:
            raise NotImplementedError(
                "only summed density, walls at rest, no obstacles, no inflows, no asynchronous cells"
            )
        backend, capacity, dim = backends.current(), particles.capacity, particles.dim
        self.impulse_moves = SETTINGS["position"] == "impulse"
        self.recalls = SETTINGS["recalls"]
        self.width = momentum.width
        self.owed = vector_field(dim, backend.dtype, capacity)
        """Velocity [m/s] that a particle has to get when it is due next: of pairs up to the middle of their present step."""
        self.end = ti.field(ti.i32, capacity)
        """Tick at which a particle is planned to be due next."""
        self.own = vector_field(dim, backend.dtype, capacity)
        """Acceleration [m/s^2] by walls and gravity at the last evaluation."""
        self.last_density = ti.field(backend.dtype, capacity)
        """Density [kg/m^3] at the last evaluation: at this point of a step `Particles.rho` is new already."""
        particles.reals += [*components(self.owed), *components(self.own), self.last_density]
        particles.carry(self.end)
        self.is_due, self.last, self.until, self.planned = (ti.field(ti.i32, capacity) for _ in range(4))
        self.rates = vector_field(self.width, backend.dtype, capacity)
        self.closing, self.opening = (vector_field(dim, backend.dtype, capacity) for _ in range(2))
        self.partial_updates = ti.field(ti.i64, ())
        """How often a particle that was not due had to look at neighbours that were."""
        self.early = ti.field(ti.i64, ())
        """How often a particle was due before it was planned to be."""
        self.tick = ti.field(backend.dtype, ())
        self.now = ti.field(ti.i32, ())
        width = self.width
        of_pair = momentum.sum.pair

        viscosities = [term for term in viscosity_terms(SETTINGS["scene"], medium, near) if term.along == "x"]
        kernel, mass, tiny, regular = medium.kernel, medium.mass, medium.tiny, medium.regular

        @ti.func
        def push_at(i, j, time):
            """Acceleration of the particle at place i due to that at j at tick `time`, when one of them was evaluated last."""
            one, two = grid.order[i], grid.order[j]
            dt_one, dt_two = self.elapsed(one, time, self.tick[None]), self.elapsed(two, time, self.tick[None])
            x_one, x_two = self.position(one, dt_one, self.tick[None]), self.position(two, dt_two, self.tick[None])
            x_ij = grid.geometry.difference(x_one, x_two)
            v_ij = self.velocity(one, dt_one, self.tick[None]) - self.velocity(two, dt_two, self.tick[None])
            rho_one, rho_two = self.last_density[one], self.last_density[two]
            if ti.static(particles.has_rho_rate):
                rho_one += particles.rho_rate[one] * dt_one
                rho_two += particles.rho_rate[two] * dt_two
            pushed = -self.equation_of_state.pressure_of(one, rho_one) / (rho_one * rho_one)
            pushed -= self.equation_of_state.pressure_of(two, rho_two) / (rho_two * rho_two)
            d2 = x_ij.norm_sqr()
            for term in ti.static(viscosities):
                pushed += term.fluid_pair(near, i, j, x_ij, v_ij, d2) / ((rho_one + rho_two) * (d2 + regular))
            return mass * pushed * kernel.gradient_factor(ti.sqrt(d2 + tiny)) * x_ij

        @ti.func
        def kick(i, j):
            """Rates of i due to j, then velocities [m/s] for the time behind and for the time ahead."""
            rates = of_pair(near, i, j)
            total = ti.Vector.zero(backend.dtype, width + 2 * dim + 1)
            for d in ti.static(range(width)):
                total[d] = rates[d]
            if self.is_due[i] + self.is_due[j] > 0:
                now = self.now[None]
                last, planned = ti.max(self.last[i], self.last[j]), ti.min(self.until[i], self.until[j])
                middle = 0.5 * ti.cast(last + now, backend.dtype)
                behind = (ti.cast(now, backend.dtype) - middle) * self.tick[None]
                after = self.paid(now, ti.min(self.planned[i], self.planned[j]))
                ahead = (after - ti.cast(now, backend.dtype)) * self.tick[None]
                for d in ti.static(range(dim)):
                    total[width + d] = behind * rates[d]
                    total[width + dim + d] = ahead * rates[d]
                if ti.max(last, planned) != now:  # it has been paid for another time than has passed
                    more = (middle - self.paid(last, planned)) * self.tick[None]
                    if ti.static(self.recalls):
                        before = push_at(i, j, last)
                        for d in ti.static(range(dim)):
                            total[width + d] += more * before[d]
                    else:
                        for d in ti.static(range(dim)):
                            total[width + d] += more * rates[d]
                if rates[0] != 0.0:
                    total[width + 2 * dim] = 1.0
            return total

        self.sum_pairs = make_neighbour_sum(grid.geometry, grid.start, kick, width + 2 * dim + 1, backend, lanes=1)
        self.sum_walls = make_wall_sum(walls, grid, momentum.wall_pair, width, backend)

    @ti.func
    def paid(self, last, end):
        """Time [ticks] up to which a pair is paid that was evaluated at `last`, to be so again at `end`."""
        return 0.5 * ti.cast(last + ti.max(last, end), self.owed.dtype)

    def advance_due(self, due, now, tick):
        """Lines 22-29, for due particles; what others owe them and they owe others is written down."""
        self.mark(due, now, tick)
        self.add_up(due)
        self.correct(due, now, tick)

    @ti.kernel
    def mark(self, due: ti.template(), now: ti.i32, tick: float):
        """Note which particles are due, when each was evaluated last, and when it was and is planned to be next."""
        self.now[None], self.tick[None] = now, tick
        for m in range(self.grid.occupied_count[None]):
            block = self.grid.occupied[m]
            for k in range(self.grid.first(block), self.grid.first(block + 1)):
                self.is_due[k] = 0  # also beside blocks that are read
                if due.read_at[block] >= 0:
                    i = self.grid.order[k]
                    self.last[k] = self.particles.updated[i]
                    self.until[k] = self.planned[k] = self.end[i]
        for n in range(due.due_count[None]):
            k = due.due[n]
            level = ti.max(self.particles.level[self.grid.order[k]], 1)
            self.is_due[k] = 1
            self.planned[k] = now + level
            if ti.static(due.aligned):
                self.planned[k] = now - now % level + level
            if now < self.until[k]:
                self.early[None] += 1

    @ti.kernel
    def add_up(self, due: ti.template()):
        """Sum over pairs of which one at least is due; only reads what the particles have."""
        for m in range(self.grid.occupied_count[None]):
            block = self.grid.occupied[m]
            if due.read_at[block] >= 0:
                for k in range(self.grid.first(block), self.grid.first(block + 1)):
                    total = self.sum_pairs(k, self.near.x[k], self.grid.cell_of[self.grid.order[k]])
                    for d in ti.static(range(self.width)):
                        self.rates[k][d] = total[d]
                    for d in ti.static(range(self.particles.dim)):
                        self.closing[k][d] = total[self.width + d]
                        self.opening[k][d] = total[self.width + self.particles.dim + d]
                    if self.is_due[k] == 0:
                        i = self.grid.order[k]
                        self.owed[i] = self.owed[i] + self.closing[k] + self.opening[k]
                        if total[self.width + 2 * self.particles.dim] > 0.0:
                            self.partial_updates[None] += 1

    @ti.kernel
    def correct(self, due: ti.template(), now: ti.i32, tick: float):
        """Bring the due particles' states to `now` and begin their next steps."""
        for n in range(due.due_count[None]):
            k = due.due[n]
            i = self.grid.order[k]
            dt = self.elapsed(i, now, tick)
            a = self.particles.a[i]
            by_walls = self.sum_walls(k)
            outer = self.momentum.gravity.acceleration(self.near.x[k], ti.cast(now, float) * tick)
            a_walls, a_new = ti.zero(a), ti.zero(a)
            for d in ti.static(range(self.particles.dim)):
                a_walls[d] = by_walls[d]
                a_new[d] = self.rates[k][d] + by_walls[d] + outer[d]
            if ti.static(self.particles.has_rho_rate):
                self.particles.rho_rate[i] = self.rates[k][self.particles.dim] + by_walls[self.particles.dim]
            behind = 0.5 * dt
            more = (0.5 * ti.cast(self.last[k] + now, float) - self.paid(self.last[k], self.until[k])) * tick
            ahead = (self.paid(now, self.planned[k]) - ti.cast(now, float)) * tick
            v = self.particles.v[i] + self.owed[i] + self.closing[k] + behind * (a_walls + outer) + more * self.own[i]
            x = self.integrator.correct_position(self.near.x[k], a, a_new, dt)
            if ti.static(self.impulse_moves):
                x = self.near.x[k] + (v - self.particles.v[i] - a * dt) * (dt * (1.0 / 3.0))
            v, a_new = self.limit(v, self.largest_speed), self.limit(a_new, self.largest_acceleration)
            for d in ti.static(range(self.particles.dim)):
                if ti.math.isnan(x[d] + v[d] + a_new[d]):
                    self.not_finite[None] += 1
            inside, v_free = self.geometry.place(x), v
            for d in ti.static(range(self.particles.dim)):
                if ti.static(not self.geometry.periodic[d]):
                    if inside[d] != x[d]:
                        self.stopped[None] += 1
                        if (x[d] - inside[d]) * v[d] > 0.0:
                            v[d] = 0.0
            if ti.static(self.particles.has_budget):
                self.particles.wall_push[i] += (dt - behind) * self.particles.a_walls[i] + behind * a_walls + v - v_free
                self.particles.a_walls[i] = a_walls
            self.particles.x[i], self.particles.v[i], self.particles.a[i] = inside, v, a_new
            self.particles.updated[i] = now
            self.end[i] = self.planned[k]
            self.own[i] = a_walls + outer
            self.last_density[i] = self.particles.rho[i]
            self.owed[i] = self.opening[k] + ahead * (a_walls + outer)
            if ti.static(TOLD):
                due.evaluated(i, a_new, tick)


@contextlib.contextmanager
def pairwise_impulses(position="impulse", on=True, recalls=True):
    """Let simulations that are built inside have pairwise impulses."""
    if not on:
        yield
        return
    make_walls, before = simulation.make_walls, simulation.Motion
    made = []

    def remember(*given):
        SETTINGS["scene"] = given[0]
        made[:] = make_walls(*given)
        return list(made)

    def motion(*given, **options):
        return ImpulseMotion(*given, walls=made, **options)

    SETTINGS.update(position=position, recalls=recalls)
    simulation.make_walls, simulation.Motion = remember, motion
    try:
        yield
    finally:
        simulation.make_walls, simulation.Motion = make_walls, before


def drift_with_owed(sim):
    """Momentum [kg m/s] that no outer force accounts for, (dim,), counting what is owed: zero to rounding at any time."""
    p, motion = sim.particles, sim.motion
    n = sim.count
    updated, end = p.updated.to_numpy()[:n], motion.end.to_numpy()[:n]
    ahead = 0.5 * (end - updated).clip(0)[:, None] * sim.timeline.tick
    time = updated[:, None] * sim.timeline.tick + ahead
    v = p.v.to_numpy()[:n].astype(float) + motion.owed.to_numpy()[:n]
    outer = p.wall_push.to_numpy()[:n] + ahead * p.a_walls.to_numpy()[:n] + time * list(sim.scene.acceleration)
    return sim.medium.mass * (v - outer).sum(axis=0) - sim._initial_momentum
