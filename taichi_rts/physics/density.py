"""Density by summation, and the pass that gives every due particle its density and pressure."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from taichi_rts.backend import Backend
from taichi_rts.grid import BlockGrid, make_neighbour_sum
from taichi_rts.particles import Neighbourhood, Particles
from taichi_rts.physics.medium import Medium


@ti.data_oriented
class SummationDensity:
    """rho_i = sum_j m W_ij + sum_b rho_0 V_b W_ib (Monaghan 1992; walls: Akinci et al. 2012, Eq. 6).

    Its rate of change comes out of the momentum equation's loop, which has grad W at hand (`MomentumEquation`).
    """

    integrates = False
    needs: frozenset[str] = frozenset()

    def __init__(
        self,
        particles: Particles,
        near: Neighbourhood,
        grid: BlockGrid,
        walls: Sequence[Any],
        medium: Medium,
        backend: Backend,
    ) -> None:
        self.particles = particles
        self.near = near
        self.grid = grid
        self.walls = list(walls)
        self.equation_of_state = medium.equation_of_state
        self.keeps_past = particles.has_past
        kernel, mass, rest_density = medium.kernel, medium.mass, medium.rest_density
        geometry = grid.geometry
        tiny = medium.tiny

        @ti.func
        def value(x_ij):
            return ti.Vector([kernel.value(ti.sqrt(x_ij.norm_sqr() + tiny))])

        @ti.func
        def fluid_pair(i, j):
            return mass * value(geometry.difference(near.x[i], near.x[j]))

        def wall_pair(wall: Any) -> Any:
            @ti.func
            def pair(i, b):
                return rest_density * wall.volume[b] * value(wall.difference(i, b))

            return pair

        self.sum_fluid = make_neighbour_sum(geometry, grid.start, fluid_pair, 1, backend)
        self.sum_walls = [make_neighbour_sum(geometry, wall.start, wall_pair(wall), 1, backend) for wall in self.walls]

    @ti.kernel
    def update(self, due: ti.template(), due_count: ti.template(), read_at: ti.template(), now: ti.i32, tick: float):
        """Find density [kg/m^3] and p/rho^2 of the due particles, which stand at places `due[0 .. due_count]`."""
        for n in range(due_count[None]):
            k = due[n]
            i = self.grid.order[k]
            x, cell = self.near.x[k], self.grid.cell_of[i]
            total = self.sum_fluid(k, x, cell)
            for w in ti.static(range(len(self.walls))):
                y, there = self.walls[w].seen_from(k, cell)
                if self.walls[w].near[self.grid.block_of(there)] == 1:
                    total += self.sum_walls[w](k, y, there)
            rho = total[0]
            if ti.static(self.keeps_past):
                self.particles.past_rho[i] = self.particles.rho[i]
            self.near.rho[k] = rho
            self.near.p_over_rho2[k] = self.equation_of_state.pressure(rho) / (rho * rho)
            self.particles.rho[i] = rho
