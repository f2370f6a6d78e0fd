"""Density by summation, and what all formulations of density share."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from taichi_rts.backend import Backend
from taichi_rts.grid import BlockGrid, make_neighbour_sum
from taichi_rts.particles import Neighbourhood, Particles
from taichi_rts.physics.medium import Medium
from taichi_rts.physics.walls import make_wall_sum


@ti.data_oriented
class Density:
    """A formulation of density: one sum over neighbours (`pairs`), from which `update` finds what the due particles have.

    `needs` names the optional fields it works with (see `Particles`); `integrates` says whether density is carried in time.
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
        self.equation_of_state = medium.equation_of_state
        self.keeps_past = particles.has_past
        fluid_pair, wall_pair = self.pairs(medium)
        self.sum_fluid = make_neighbour_sum(grid.geometry, grid.start, fluid_pair, 1, backend)
        self.sum_walls = make_wall_sum(walls, grid, wall_pair, 1, backend)

    def pairs(self, medium: Medium) -> tuple[Any, Any]:
        """Return the ti.func `pair(i, j)` between fluid particles, and a function that makes one for a wall."""
        raise NotImplementedError

    @ti.func
    def sum_neighbours(self, k):
        """The sum over fluid and walls near the particle at place `k`."""
        total = self.sum_fluid(k, self.near.x[k], self.grid.cell_of[self.grid.order[k]]) + self.sum_walls(k)
        return total[0]

    @ti.func
    def keep(self, k, i, rho, present, tick):
        """Give particle `i` at place `k` its density [kg/m^3] of tick `present`, and with it p/rho^2."""
        elapsed = ti.cast(present - self.particles.updated[i], float) * tick
        self.equation_of_state.adapt(i, self.grid.block(i), rho, elapsed)
        if ti.static(self.keeps_past):
            self.particles.past_rho[i] = self.particles.rho[i]
        self.near.rho[k] = rho
        self.near.p_over_rho2[k] = self.equation_of_state.pressure_of(i, rho) / (rho * rho)
        self.particles.rho[i] = rho


@ti.data_oriented
class SummationDensity(Density):
    """rho_i = sum_j m W_ij + sum_b rho_0 V_b W_ib (Monaghan 1992; walls: Akinci et al. 2012, Eq. 6).

    Its rate of change comes out of the momentum equation's loop, which has grad W at hand (`MomentumEquation`).
    """

    def pairs(self, medium: Medium) -> tuple[Any, Any]:
        """Return m W_ij, and rho_0 V_b W_ib for a wall."""
        near, geometry = self.near, self.grid.geometry
        kernel, mass, rest_density, tiny = medium.kernel, medium.mass, medium.rest_density, medium.tiny

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

        return fluid_pair, wall_pair

    @ti.kernel
    def update(self, due: ti.template(), due_count: ti.template(), read_at: ti.template(), now: ti.i32, tick: float):
        """Find density [kg/m^3] and p/rho^2 of the due particles, which stand at places `due[0 .. due_count]`."""
        for n in range(due_count[None]):
            k = due[n]
            i = self.grid.order[k]
            self.keep(k, i, self.sum_neighbours(k), now + read_at[self.grid.block(i)], tick)
