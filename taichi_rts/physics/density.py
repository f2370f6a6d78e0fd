"""Density by summation, and the pass that gives every due particle its density and pressure."""

from typing import Any

import taichi as ti

from taichi_rts.backend import Backend
from taichi_rts.grid import BlockGrid, make_neighbour_sum
from taichi_rts.particles import Neighbourhood, Particles
from taichi_rts.physics.medium import Medium
from taichi_rts.physics.walls import Walls


@ti.data_oriented
class SummationDensity:
    """rho_i = sum_j m W_ij + sum_b rho_0 V_b W_ib (Monaghan 1992; walls: Akinci et al. 2012, Eq. 6).

    Its rate of change comes out of the momentum equation's loop, which has grad W at hand (`MomentumEquation`).
    """

    def __init__(
        self,
        particles: Particles,
        near: Neighbourhood,
        grid: BlockGrid,
        walls: Walls | None,
        medium: Medium,
        backend: Backend,
    ) -> None:
        self.particles = particles
        self.near = near
        self.grid = grid
        self.walls: Any = walls
        self.has_walls = walls is not None
        self.equation_of_state = medium.equation_of_state
        self.keeps_past = particles.has_past
        kernel, mass, rest_density = medium.kernel, medium.mass, medium.rest_density
        tiny = (1e-6 * medium.support) ** 2

        @ti.func
        def value(x_ij):
            return ti.Vector([kernel.value(ti.sqrt(x_ij.norm_sqr() + tiny))])

        @ti.func
        def fluid_pair(i, j):
            return mass * value(near.x[i] - near.x[j])

        @ti.func
        def wall_pair(i, b):
            return rest_density * walls.volume[b] * value(near.x[i] - walls.x[b])

        self.sum_fluid = make_neighbour_sum(grid.geometry, grid.start, fluid_pair, 1, backend)
        if walls is not None:
            self.sum_walls = make_neighbour_sum(grid.geometry, walls.start, wall_pair, 1, backend)

    @ti.kernel
    def update(self, due: ti.template(), due_count: ti.template()):
        """Find density [kg/m^3] and p/rho^2 of the due particles, which stand at places `due[0 .. due_count]`."""
        for n in range(due_count[None]):
            k = due[n]
            i = self.grid.order[k]
            x, cell = self.near.x[k], self.grid.cell_of[i]
            total = self.sum_fluid(k, x, cell)
            if ti.static(self.has_walls):
                if self.walls.near[self.grid.block(i)] == 1:
                    total += self.sum_walls(k, x, cell)
            rho = total[0]
            if ti.static(self.keeps_past):
                self.particles.past_rho[i] = self.particles.rho[i]
            self.near.rho[k] = rho
            self.near.p_over_rho2[k] = self.equation_of_state.pressure(rho) / (rho * rho)
            self.particles.rho[i] = rho
