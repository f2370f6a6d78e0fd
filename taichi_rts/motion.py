"""The passes that move particles: where they are now, what neighbours see of them, and the corrected new state."""

from typing import Any

import taichi as ti

from taichi_rts.grid import BlockGrid
from taichi_rts.particles import Neighbourhood, Particles
from taichi_rts.physics.medium import Medium
from taichi_rts.physics.momentum import MomentumEquation

RUNAWAY_SPEED = 2.0
RUNAWAY_ACCELERATION = 4.0
"""Largest speed over c_s and acceleration over c_s^2/r, far beyond what weakly compressible flow can do.

They bound the damage once a run has blown up: unlimited, particles pile up in a few cells and a step takes minutes.
"""


@ti.data_oriented
class Motion:
    """Prediction and correction with one integrator. `now` is a tick, `tick` its length [s]."""

    def __init__(
        self,
        particles: Particles,
        near: Neighbourhood,
        grid: BlockGrid,
        momentum: MomentumEquation,
        integrator: Any,
        medium: Medium,
    ) -> None:
        self.particles = particles
        self.near = near
        self.grid = grid
        self.momentum = momentum
        self.integrator = integrator
        self.equation_of_state = medium.equation_of_state
        self.largest_speed = RUNAWAY_SPEED * medium.sound_speed
        self.largest_acceleration = RUNAWAY_ACCELERATION * medium.sound_speed**2 / medium.support
        self.geometry = grid.geometry
        self.stopped = ti.field(ti.i32, ())
        """How often a face of the domain stopped a centre that wall particles had let through."""
        self.not_finite = ti.field(ti.i32, ())
        self.runaways = ti.field(ti.i32, ())
        """How often a speed or an acceleration had to be limited: more than never means that the run has blown up."""

    @ti.func
    def elapsed(self, i, now, tick):
        """Time [s] since the last force evaluation of particle `i`."""
        return ti.cast(now - self.particles.updated[i], float) * tick

    @ti.func
    def position(self, i, dt):
        """Predicted position [m] of particle `i`, `dt` [s] after its last evaluation, kept inside the domain."""
        p = self.particles
        return self.geometry.clamp(self.integrator.predict_position(p.x[i], p.v[i], p.a[i], dt))

    @ti.func
    def limit(self, vector, largest: ti.template()):
        """Shorten `vector` to length `largest`, and count it."""
        limited = vector
        length2 = vector.norm_sqr()
        if length2 > largest * largest:
            limited = vector * (largest / ti.sqrt(length2))
            self.runaways[None] += 1
        return limited

    @ti.kernel
    def locate_particles(self, now: ti.i32, tick: float):
        """Algorithm 1, line 4: count every particle into the cell of its present position."""
        for i in range(self.particles.count):
            self.grid.insert(i, self.position(i, self.elapsed(i, now, tick)))

    @ti.kernel
    def predict_neighbourhood(self, touched: ti.template(), now: ti.i32, tick: float):
        """Lines 25-26, for all particles in blocks that a due particle may read, and for no others."""
        for block in touched:
            if touched[block] == 1:
                for k in range(self.grid.first(block), self.grid.first(block + 1)):
                    i = self.grid.order[k]
                    dt = self.elapsed(i, now, tick)
                    self.near.x[k] = self.position(i, dt)
                    self.near.v[k] = self.integrator.predict_velocity(self.particles.v[i], self.particles.a[i], dt)
                    rho = self.particles.rho[i]
                    if ti.static(self.particles.has_rho_rate):
                        rho += self.particles.rho_rate[i] * dt
                    self.near.rho[k] = rho
                    self.near.p_over_rho2[k] = self.equation_of_state.pressure(rho) / (rho * rho)

    @ti.kernel
    def advance_due(self, due: ti.template(), due_count: ti.template(), now: ti.i32, tick: float):
        """Lines 22-29: new acceleration of each due particle, then its corrected state, which holds from `now` on."""
        for n in range(due_count[None]):
            k = due[n]
            i = self.grid.order[k]
            dt = self.elapsed(i, now, tick)
            a = self.particles.a[i]
            a_new = self.momentum.acceleration(k)
            x = self.integrator.correct_position(self.near.x[k], a, a_new, dt)
            v = self.integrator.correct_velocity(self.particles.v[i], a, a_new, dt)
            v, a_new = self.limit(v, self.largest_speed), self.limit(a_new, self.largest_acceleration)
            finite = True  # of what was given too: a position that is not a number has been clamped to a corner by now
            for d in ti.static(range(self.particles.dim)):
                total = self.particles.x[i][d] + v[d] + a_new[d]
                finite = finite and not (ti.math.isnan(total) or ti.math.isinf(total))
            if not finite:
                self.not_finite[None] += 1
            inside = self.geometry.clamp(x)
            for d in ti.static(range(self.particles.dim)):
                if inside[d] != x[d]:
                    self.stopped[None] += 1
                    if (x[d] - inside[d]) * v[d] > 0.0:
                        v[d] = 0.0
            self.particles.x[i] = inside
            self.particles.v[i] = v
            self.particles.a[i] = a_new
            self.particles.updated[i] = now

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
    ):
        """Write the state at `ahead` [s] after `now`, in order of particle id, into arrays outside Taichi."""
        for i in range(self.particles.count):
            dt = self.elapsed(i, now, tick) + ahead
            position = self.position(i, dt)
            velocity = self.particles.v[i] + self.particles.a[i] * dt
            identity = self.particles.identity[i]
            for d in ti.static(range(self.particles.dim)):
                x[identity, d] = position[d]
                v[identity, d] = velocity[d]
            rho[identity] = self.particles.rho[i]
            level[identity] = ti.max(self.particles.level[i], 1)
