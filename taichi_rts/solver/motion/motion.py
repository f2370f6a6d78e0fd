"""The passes that move particles: where they are at a given time, what neighbours see of them, and the corrected new state."""

from collections.abc import Sequence
from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.device.counters import Counters
from taichi_rts.medium.medium import Medium
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.motion.books import Books
from taichi_rts.solver.motion.inflow import Guide
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.particles.past import Past
from taichi_rts.solver.physics.density import Density
from taichi_rts.solver.physics.momentum import MomentumEquation
from taichi_rts.solver.physics.moving_walls import MovingFace

RUNAWAY_SPEED = 2.0
RUNAWAY_ACCELERATION = 4.0
"""Largest speed over c_s and acceleration over c_s^2/r, far beyond what weakly compressible flow can do.

They bound the damage once a run has blown up: unlimited, particles pile up in a few cells and a step takes minutes.
"""


@ti.data_oriented
class Motion:
    """Prediction and correction with one integrator. `now` is a tick, `tick` its length [s].

    `read_at[block]` says when a block's particles are read, in ticks after `now`, and is negative where they are not read.
    `past`, `guides` and `books` hold one object or none.
    """

    def __init__(
        self,
        particles: FluidState,
        near: Neighbourhood,
        grid: BlockGrid,
        momentum: MomentumEquation,
        integrator: Any,
        medium: Medium,
        formulation: Density,
        *,
        keepers: Sequence[Any] = (),
        past: Sequence[Past] = (),
        guides: Sequence[Guide] = (),
        books: Sequence[Books] = (),
    ) -> None:
        self.formulation = formulation
        self.past, self.guides, self.books = list(past), list(guides), list(books)
        self.faces = [wall for wall in momentum.moving if isinstance(wall, MovingFace)]
        self.keepers = list(keepers)
        self.particles = particles
        self.near = near
        self.grid = grid
        self.momentum = momentum
        self.integrator = integrator
        self.equation_of_state = medium.equation_of_state
        self.largest_speed = RUNAWAY_SPEED * medium.sound_speed
        self.largest_acceleration = RUNAWAY_ACCELERATION * medium.sound_speed**2 / medium.support
        self.geometry = grid.geometry
        self.stopped = Counters()
        """How often a face of the domain stopped a centre that wall particles had let through."""
        self.stopped_by_obstacles = Counters()
        """How often an obstacle did."""
        self.not_finite = Counters()
        self.runaways = Counters()
        """How often a speed or an acceleration had to be limited: more than never means that the run has blown up."""

    @ti.func
    def elapsed(self, i, now, tick):
        """Time [s] from the last force evaluation of particle `i` to tick `now`; negative if that lies before it."""
        return ti.cast(now - self.particles.updated[i], float) * tick

    @ti.func
    def position(self, i, dt, tick):
        """Position [m] of particle `i`, `dt` [s] after its last evaluation, kept inside the domain.

        Within its step that is the prediction; before it (dt < 0) it is interpolated, where there is a `Past`.
        """
        p = self.particles
        x = self.integrator.predict_position(p.x[i], p.v[i], p.a[i], dt)
        for past in ti.static(self.past):
            if dt < 0.0:
                x = past.position(i, dt, tick)
        return self.geometry.place(x)

    @ti.func
    def velocity(self, i, dt, tick):
        """Velocity [m/s] of particle `i` that forces see, `dt` [s] after its last evaluation."""
        p = self.particles
        v = self.integrator.predict_velocity(p.v[i], p.a[i], dt)
        for past in ti.static(self.past):
            if dt < 0.0:
                v = past.velocity(i, dt, tick)
        return v

    @ti.func
    def density(self, i, dt, tick):
        """Density [kg/m^3] of particle `i` that neighbours see, `dt` [s] after its last evaluation."""
        p = self.particles
        rho = p.rho[i]
        if ti.static(p.has_rho_rate):
            rho += p.rho_rate[i] * dt
        for past in ti.static(self.past):
            if dt < 0.0:
                rho = past.density(i, dt, tick)
        return rho

    @ti.func
    def limit(self, vector, largest: ti.template()):
        """Shorten `vector` to length `largest`, and count it."""
        limited = vector
        length2 = vector.norm_sqr()
        if length2 > largest * largest:
            limited = vector * (largest / ti.sqrt(length2))
            self.runaways.add(0, 1)
        return limited

    @ti.kernel
    def sort_particles(self, now: ti.i32, tick: float):
        """Algorithm 1, line 4: sort every particle into the cell of its present position."""
        self.grid.insert_all(self.present_position, now, tick)
        self.grid.sort(self.particles.identity)

    @ti.func
    def present_position(self, i, now, tick):
        """Position [m] of particle `i` at tick `now`."""
        return self.position(i, self.elapsed(i, now, tick), tick)

    @ti.kernel
    def predict_neighbourhood(self, read_at: ti.template(), now: ti.i32, tick: float):
        """Lines 25-26, for all particles in blocks that a due particle may read, and for no others."""
        for m in range(self.grid.occupied_count[None]):
            block = self.grid.occupied[m]
            if read_at[block] >= 0:
                for k in range(self.grid.first(block), self.grid.first(block + 1)):
                    i = self.grid.order[k]
                    dt = self.elapsed(i, now + read_at[block], tick)
                    self.near.x[k] = self.position(i, dt, tick)
                    self.near.v[k] = self.velocity(i, dt, tick)
                    rho = self.density(i, dt, tick)
                    self.near.rho[k] = rho
                    self.near.p_over_rho2[k] = self.equation_of_state.pressure_of(i, rho) / (rho * rho)
                    if ti.static(self.near.has_acceleration):
                        self.near.a[k] = self.particles.a[i]
                        self.near.elapsed[k] = dt
                    if ti.static(self.near.has_viscosity):
                        self.near.viscosity[k] = self.particles.viscosity[i]

    @ti.kernel
    def advance_due(self, due: ti.template(), now: ti.i32, tick: float):
        """Lines 22-29: new acceleration of each due particle, then its corrected state, which holds from this time on."""
        self.momentum.sum.visit(self.advance, due, now, tick)

    @ti.func
    def advance(self, k, fluid, by_walls, due: ti.template(), now, tick):
        """The same for the particle at place `k`, given the shares of the fluid and of the walls in its rates."""
        p, i = self.particles, self.grid.order[k]
        present = now + due.read_at[self.grid.block(i)]
        dt = self.elapsed(i, present, tick)
        a = p.a[i]
        rates = self.momentum.other_rates(k, fluid, present, tick) + by_walls
        a_new, power = a, 0.0  # [W/kg]
        for d in ti.static(range(p.dim)):
            a_new[d] = rates[d]
        self.formulation.keep_rates(i, rates, dt)
        for books in ti.static(self.books):
            power = books.power(k)
        for guide in ti.static(self.guides):
            if guide.leads(i, present):
                power = -a_new.dot(p.v[i])
                a_new = ti.zero(a)
        x = self.integrator.correct_position(self.near.x[k], a, a_new, dt)
        v = self.integrator.correct_velocity(p.v[i], a, a_new, dt)
        v, a_new = self.limit(v, self.largest_speed), self.limit(a_new, self.largest_acceleration)
        self.count_broken(
            p.x[i] + v + a_new
        )  # also what was given: a position that is NaN has been clamped to a corner by now
        v_free = v
        x, v = self.confine(x, v, present, tick)
        for books in ti.static(self.books):
            books.keep(i, dt, by_walls, v_free, v, power)
        for past in ti.static(self.past):
            past.keep(i, x)
        p.x[i], p.v[i], p.a[i] = x, v, a_new
        p.updated[i] = present
        due.evaluated(i, a_new, tick)

    @ti.func
    def count_broken(self, state):
        """Count a `state` with an entry that is not finite."""
        finite = True
        for d in ti.static(range(self.particles.dim)):
            finite = finite and not (ti.math.isnan(state[d]) or ti.math.isinf(state[d]))
        if not finite:
            self.not_finite.add(0, 1)

    @ti.func
    def confine(self, x, v, present, tick):
        """Keep a centre at `x` [m] inside the domain and outside obstacles, and take from `v` [m/s] what leads there."""
        inside, v_face = self.geometry.place(x), ti.zero(v)
        for wall in ti.static(self.faces):
            held = wall.hold(inside, present, tick)
            if held[wall.axis] != inside[wall.axis]:
                _displacement, v_face[wall.axis] = wall.motion(present, tick)
            inside = held
        for d in ti.static(range(self.particles.dim)):
            if ti.static(not self.geometry.periodic[d]):
                if inside[d] != x[d]:
                    self.stopped.add(0, 1)
                    if (x[d] - inside[d]) * (v[d] - v_face[d]) > 0.0:
                        v[d] = v_face[d]
        for keeper in ti.static(self.keepers):
            inside, v, times = keeper.hold(inside, v, present, tick, 0.0)
            if times > 0:
                self.stopped_by_obstacles.add(0, times)
        return inside, v

    @ti.kernel
    def export(
        self,
        now: ti.i32,
        tick: float,
        ahead: float,
        x: ti.types.ndarray(),
        v: ti.types.ndarray(),
        rho: ti.types.ndarray(),
        level: ti.types.ndarray(),
        updated: ti.types.ndarray(),
        a: ti.types.ndarray(),
    ):
        """Write the state at `ahead` [s] after `now`, by particle id, into arrays outside Taichi.

        That is position, velocity and density; and of the last evaluation the level, 0 before it, the tick `updated` and the
        acceleration.
        """
        for i in range(self.particles.alive[None]):
            dt = self.elapsed(i, now, tick) + ahead
            position = self.position(i, dt, tick)
            for keeper in ti.static(self.keepers):
                position, _slowed, _times = keeper.hold(position, ti.zero(position), now, tick, ahead)
            velocity = self.particles.v[i] + self.particles.a[i] * dt
            if ti.static(len(self.past) > 0):
                velocity = self.velocity(i, dt, tick)
            identity = self.particles.identity[i]
            for d in ti.static(range(self.particles.dim)):
                x[identity, d] = position[d]
                v[identity, d] = velocity[d]
                a[identity, d] = self.particles.a[i][d]
            rho[identity] = self.particles.rho[i]
            if ti.static(len(self.past) > 0):
                rho[identity] = self.density(i, dt, tick)
            level[identity] = self.particles.level[i]
            updated[identity] = self.particles.updated[i]
