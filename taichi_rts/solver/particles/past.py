"""The evaluation before the last, so that particles can be read at a time before their last one."""

from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.solver.particles.particles import FluidState


@ti.data_oriented
class Past:
    """Reads between a particle's last two evaluations; `dt` < 0 is the time [s] after the last.

    `geometry` is the grid's.
    """

    def __init__(self, particles: FluidState, geometry: Any) -> None:
        self.particles = particles
        self.geometry = geometry

    @ti.func
    def share(self, i, dt, tick):
        """How much the evaluation before the last counts in linear interpolation."""
        return -dt / (ti.cast(self.particles.updated[i] - self.particles.past_updated[i], float) * tick)

    @ti.func
    def position(self, i, dt, tick):
        """Position [m] on the cubic through the positions and velocities of both (Hermite)."""
        p = self.particles
        h = ti.cast(p.updated[i] - p.past_updated[i], float) * tick
        s = 1.0 + dt / h
        ascent, descent = s * s * (3.0 - 2.0 * s), (1.0 - s) * (1.0 - s) * (1.0 + 2.0 * s)
        slopes = (1.0 - s) * p.past_v[i] - s * p.v[i]
        return descent * p.past_x[i] + ascent * p.x[i] + (s * (1.0 - s) * h) * slopes

    @ti.func
    def velocity(self, i, dt, tick):
        """Velocity [m/s], linear in between."""
        p = self.particles
        return p.v[i] + self.share(i, dt, tick) * (p.past_v[i] - p.v[i])

    @ti.func
    def density(self, i, dt, tick):
        """Density [kg/m^3], linear in between."""
        p = self.particles
        return p.rho[i] + self.share(i, dt, tick) * (p.past_rho[i] - p.rho[i])

    @ti.func
    def keep_density(self, i):
        """Density is about to change to that of a new evaluation."""
        self.particles.past_rho[i] = self.particles.rho[i]

    @ti.func
    def keep(self, i, x):
        """Position and velocity are about to change, the position to `x` [m]."""
        p = self.particles
        p.past_x[i] = p.x[i]
        if ti.static(self.geometry.repeats):  # the image that lies beside the new position
            p.past_x[i] = x - self.geometry.difference(x, p.x[i])
        p.past_v[i] = p.v[i]
        p.past_updated[i] = p.updated[i]

    @ti.func
    def begin(self, i, now):
        """Particle `i` has just come in, at tick `now`."""
        p = self.particles
        p.past_x[i], p.past_v[i], p.past_rho[i], p.past_updated[i] = p.x[i], p.v[i], p.rho[i], now
