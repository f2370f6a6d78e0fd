"""Density by summation, and what all formulations of density share."""

from collections.abc import Sequence
from typing import Any

from taichi_rts.device.backend import Backend, ti
from taichi_rts.medium.medium import Medium
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.neighbour_sum import NeighbourSum
from taichi_rts.solver.grid.windows import FluidWindows
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.particles.past import Past


@ti.data_oriented
class Density:
    """A formulation of density: one sum over neighbours (`pairs`), from which `update` finds what the due particles have.

    `needs` names the optional fields it works with (see `FluidState`); `integrates` says whether density is carried in time.
    """

    integrates = False
    needs: frozenset[str] = frozenset()
    reads: tuple[str, ...] = ("x",)
    """What pairs read of a `Neighbourhood`."""

    def __init__(
        self,
        particles: FluidState,
        near: Neighbourhood,
        grid: BlockGrid,
        windows: FluidWindows | None,
        walls: Sequence[Any],
        medium: Medium,
        backend: Backend,
        past: Sequence[Past] = (),
    ) -> None:
        self.particles = particles
        self.near = near
        self.grid = grid
        self.equation_of_state = medium.equation_of_state
        self.past = list(past)
        fluid_pair, wall_pair = self.pairs(medium)
        self.sum = NeighbourSum(
            fluid_pair, wall_pair, 1, self.reads, ("x", "volume"), near, grid, windows, walls, backend
        )

    def pairs(self, medium: Medium) -> tuple[Any, Any]:
        """Return the ti.func `pair(near, i, j)` between fluid particles, and a function that makes one for a wall."""
        raise NotImplementedError

    @ti.func
    def found(self, i, k, total):
        """Density [kg/m^3] of particle `i` at place `k`, from the `total` of its sum."""
        raise NotImplementedError

    @ti.kernel
    def update(self, due: ti.template(), now: ti.i32, tick: float):
        """Find density [kg/m^3] and p/rho^2 of the particles that are due in the schedule `due`."""
        self.sum.visit(self.keep, due, now, tick)

    @ti.func
    def keep(self, k, fluid, walls, due: ti.template(), now, tick):
        """Give the particle at place `k` the density that follows from the sums over `fluid` and `walls`, and with it p/rho^2."""
        i = self.grid.order[k]
        rho = self.found(i, k, fluid[0] + walls[0])
        present = now + due.read_at[self.grid.block(i)]
        elapsed = ti.cast(present - self.particles.updated[i], float) * tick
        self.equation_of_state.adapt(i, self.grid.block(i), rho, elapsed)
        for past in ti.static(self.past):
            past.keep_density(i)
        self.near.rho[k] = rho
        self.near.p_over_rho2[k] = self.equation_of_state.pressure_of(i, rho) / (rho * rho)
        self.particles.rho[i] = rho

    @ti.func
    def keep_rates(self, i, rates, dt):
        """Take what its `rates` say of the density of particle `i`, at the end of a step of `dt` [s]."""
        if ti.static(self.particles.has_rho_rate):
            self.particles.rho_rate[i] = rates[self.particles.dim]


@ti.data_oriented
class SummationDensity(Density):
    """rho_i = sum_j m W_ij + sum_b rho_0 V_b W_ib (Monaghan 1992; walls: Akinci et al. 2012, Eq. 6).

    Its rate of change comes out of the momentum equation's loop, which has grad W at hand (`MomentumEquation`).
    """

    def pairs(self, medium: Medium) -> tuple[Any, Any]:
        """Return m W_ij, and rho_0 V_b W_ib for a wall."""
        kernel, mass, rest_density, tiny = medium.kernel, medium.mass, medium.rest_density, medium.tiny

        @ti.func
        def value(x_ij):
            return ti.Vector([kernel.value(ti.sqrt(x_ij.norm_sqr() + tiny))])

        @ti.func
        def fluid_pair(near, i, j):
            return mass * value(near.difference(i, j))

        def wall_pair(wall: Any) -> Any:
            @ti.func
            def pair(i, b):
                return rest_density * wall.volume[b] * value(wall.difference(i, b))

            return pair

        return fluid_pair, wall_pair

    @ti.func
    def found(self, i, k, total):
        """The sum itself."""
        return total
