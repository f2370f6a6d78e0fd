"""The passes that move particles: where they are at a given time, what neighbours see of them, and the corrected new state."""

from collections.abc import Sequence
from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.device.counters import Counters
from taichi_rts.medium.medium import Medium
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.particles.particles import FluidState
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
    """

    def __init__(
        self,
        particles: FluidState,
        near: Neighbourhood,
        grid: BlockGrid,
        momentum: MomentumEquation,
        integrator: Any,
        medium: Medium,
        *,
        integrates_density: bool = False,
        keepers: Sequence[Any] = (),
    ) -> None:
        self.integrates_density = integrates_density
        self.moving_walls = momentum.moving
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

        Within its step that is the prediction; before it (dt < 0) the cubic through the positions and velocities of its
        last two evaluations (Hermite), so that reading at an earlier time interpolates as well.
        """
        p = self.particles
        x = self.integrator.predict_position(p.x[i], p.v[i], p.a[i], dt)
        if ti.static(p.has_past):
            if dt < 0.0:
                h = ti.cast(p.updated[i] - p.past_updated[i], float) * tick
                s = 1.0 + dt / h
                ascent, descent = s * s * (3.0 - 2.0 * s), (1.0 - s) * (1.0 - s) * (1.0 + 2.0 * s)
                slopes = (1.0 - s) * p.past_v[i] - s * p.v[i]
                x = descent * p.past_x[i] + ascent * p.x[i] + (s * (1.0 - s) * h) * slopes
        return self.geometry.place(x)

    @ti.func
    def share_of_past(self, i, dt, tick):
        """How much the evaluation before the last counts, `dt` < 0 [s] after the last, in linear interpolation."""
        return -dt / (ti.cast(self.particles.updated[i] - self.particles.past_updated[i], float) * tick)

    @ti.func
    def velocity(self, i, dt, tick):
        """Velocity [m/s] of particle `i` that forces see, `dt` [s] after its last evaluation."""
        p = self.particles
        v = self.integrator.predict_velocity(p.v[i], p.a[i], dt)
        if ti.static(p.has_past):
            if dt < 0.0:
                v = p.v[i] + self.share_of_past(i, dt, tick) * (p.past_v[i] - p.v[i])
        return v

    @ti.func
    def density(self, i, dt, tick):
        """Density [kg/m^3] of particle `i` that neighbours see, `dt` [s] after its last evaluation."""
        p = self.particles
        rho = p.rho[i]
        if ti.static(p.has_rho_rate):
            rho += p.rho_rate[i] * dt
        if ti.static(p.has_past):
            if dt < 0.0:
                rho = p.rho[i] + self.share_of_past(i, dt, tick) * (p.past_rho[i] - p.rho[i])
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
    def observe_walls(self, due: ti.template(), now: ti.i32, tick: float):
        """Note for every particle that is due in the schedule `due` where the moving walls are at its time."""
        for n in range(due.due_count[None]):
            k = due.due[n]
            present = now + due.read_at[self.grid.block(self.grid.order[k])]
            for wall in ti.static(self.moving_walls):
                wall.observe(k, present, tick)

    @ti.kernel
    def advance_due(self, due: ti.template(), now: ti.i32, tick: float):
        """Lines 22-29: new acceleration of each due particle, then its corrected state, which holds from this time on."""
        self.momentum.sum.visit(self.advance, due, now, tick)

    @ti.func
    def advance(self, k, fluid, by_walls, due: ti.template(), now, tick):
        """The same for the particle at place `k`, given the shares of the fluid and of the walls in its rates."""
        i = self.grid.order[k]
        present = now + due.read_at[self.grid.block(i)]
        dt = self.elapsed(i, present, tick)
        a = self.particles.a[i]
        rates = self.momentum.other_rates(k, fluid, present, tick) + by_walls
        a_new = a
        for d in ti.static(range(self.particles.dim)):
            a_new[d] = rates[d]
        if ti.static(self.particles.has_rho_rate):
            self.particles.rho_rate[i] = rates[self.particles.dim]
        if ti.static(self.integrates_density):
            diffusion = rates[self.particles.dim + 1]
            self.particles.rho[i] += (0.5 * dt) * (diffusion - self.particles.diffusion[i])
            self.particles.diffusion[i] = diffusion
            self.particles.rho_rate[i] += diffusion
        power = 0.0  # [W/kg]
        if ti.static(self.particles.has_budget and len(self.moving_walls) > 0):
            power = self.momentum.wall_power(k)[0]
        if ti.static(self.particles.has_guide):
            if present < self.particles.guided_until[i]:
                power = -a_new.dot(self.particles.v[i])
                a_new = ti.zero(a)
        x = self.integrator.correct_position(self.near.x[k], a, a_new, dt)
        v = self.integrator.correct_velocity(self.particles.v[i], a, a_new, dt)
        v, a_new = self.limit(v, self.largest_speed), self.limit(a_new, self.largest_acceleration)
        finite = True  # also of the values given: a position that is NaN has been clamped to a corner by now
        for d in ti.static(range(self.particles.dim)):
            total = self.particles.x[i][d] + v[d] + a_new[d]
            finite = finite and not (ti.math.isnan(total) or ti.math.isinf(total))
        if not finite:
            self.not_finite.add(0, 1)
        inside = self.geometry.place(x)
        v_free, v_face = v, ti.zero(v)
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
        if ti.static(self.particles.has_budget):
            a_walls = a
            for d in ti.static(range(self.particles.dim)):
                a_walls[d] = by_walls[d]
            if ti.static(self.particles.has_past):
                self.particles.past_wall_push[i] = self.particles.wall_push[i]
            self.particles.wall_push[i] += (0.5 * dt) * (self.particles.a_walls[i] + a_walls) + v - v_free
            self.particles.a_walls[i] = a_walls
            self.particles.work[i] += (0.5 * dt) * (self.particles.power[i] + power)
            self.particles.power[i] = power
        if ti.static(self.particles.has_past):
            self.particles.past_x[i] = self.particles.x[i]
            if ti.static(self.geometry.repeats):  # the image that lies beside the new position
                self.particles.past_x[i] = inside - self.geometry.difference(inside, self.particles.x[i])
            self.particles.past_v[i] = self.particles.v[i]
            self.particles.past_updated[i] = self.particles.updated[i]
        self.particles.x[i] = inside
        self.particles.v[i] = v
        self.particles.a[i] = a_new
        self.particles.updated[i] = present
        due.evaluated(i, a_new, tick)

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
            if ti.static(self.particles.has_past):
                velocity = self.velocity(i, dt, tick)
            identity = self.particles.identity[i]
            for d in ti.static(range(self.particles.dim)):
                x[identity, d] = position[d]
                v[identity, d] = velocity[d]
                a[identity, d] = self.particles.a[i][d]
            rho[identity] = self.particles.rho[i]
            if ti.static(self.particles.has_past):
                rho[identity] = self.density(i, dt, tick)
            level[identity] = self.particles.level[i]
            updated[identity] = self.particles.updated[i]
