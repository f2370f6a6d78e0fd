"""What walls and inflows give to each particle, in debug runs: momentum and work."""

from taichi_rts.device.backend import ti
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.physics.momentum import MomentumEquation


@ti.data_oriented
class Books:
    """Adds up, from evaluation to evaluation, each particle's `wall_push` and `work` (`FluidState`)."""

    def __init__(self, particles: FluidState, momentum: MomentumEquation) -> None:
        self.particles = particles
        self.momentum = momentum

    @ti.func
    def power(self, k):
        """Power [W/kg] of moving walls on the particle at place `k`."""
        power = 0.0
        if ti.static(len(self.momentum.moving) > 0):
            power = self.momentum.wall_power(k)[0]
        return power

    @ti.func
    def keep(self, i, dt, by_walls, v_free, v, power):
        """Enter a step of `dt` [s] that ends with rates `by_walls` and `power` [W/kg]; faces made `v` of `v_free` [m/s]."""
        p = self.particles
        a_walls = v
        for d in ti.static(range(p.dim)):
            a_walls[d] = by_walls[d]
        if ti.static(p.has_past):
            p.past_wall_push[i] = p.wall_push[i]
        p.wall_push[i] += (0.5 * dt) * (p.a_walls[i] + a_walls) + v - v_free
        p.a_walls[i] = a_walls
        p.work[i] += (0.5 * dt) * (p.power[i] + power)
        p.power[i] = power
