"""The momentum equation: gravity, a body force, pressure and the scene's viscosity terms, in one loop over neighbours."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from taichi_rts.backend import Backend
from taichi_rts.grid import BlockGrid, make_neighbour_sum
from taichi_rts.particles import Neighbourhood
from taichi_rts.physics.medium import Medium
from taichi_rts.physics.walls import Walls
from taichi_rts.shapes import LinearField


@ti.data_oriented
class Pressure:
    """a_i = -sum_j m (p_i/rho_i^2 + p_j/rho_j^2) grad W_ij (Monaghan 1992; Becker & Teschner 2007, Eq. 6).

    Against a wall: -sum_b rho_0 V_b p_i/rho_i^2 grad W_ib (Akinci et al. 2012, Eq. 9), the derivative of the same energy.
    Mirroring the wall's pressure (p_b = p_i) is not: it feeds energy in, and a still pool simmers at 0.05 sqrt(gH)
    instead of 0.004.
    """

    def __init__(self, near: Neighbourhood) -> None:
        self.near = near

    @ti.func
    def fluid_pair(self, i, j, x_ij, d2):
        """Acceleration per unit of m times the gradient factor."""
        return -(self.near.p_over_rho2[i] + self.near.p_over_rho2[j]) * x_ij

    @ti.func
    def wall_pair(self, i, b, x_ib, d2):
        """Acceleration per unit of rho_0 V_b times the gradient factor."""
        return -self.near.p_over_rho2[i] * x_ib


@ti.data_oriented
class MomentumEquation:
    """Adds up the terms' accelerations for one particle, and with them, if wanted, the rate of its density.

    The rate is d rho_i/dt = sum_j m v_ij . grad W_ij + sum_b rho_0 V_b v_i . grad W_ib, the derivative of `SummationDensity`
    beside walls at rest; with it the density of a particle that is not due can be carried through its step. Both come as one
    vector of "rates": dv/dt [m/s^2], (dim,), and with `with_rho_rate` as its last entry d rho/dt [kg/(m^3 s)].

    A term is an object with two ti.funcs, `fluid_pair(i, j, x_ij, d2)` and `wall_pair(i, b, x_ib, d2)`, that return the
    acceleration per unit of mass times gradient factor (see `smoothing`), as a vector.
    """

    def __init__(
        self,
        terms: Sequence[Any],
        near: Neighbourhood,
        grid: BlockGrid,
        walls: Walls | None,
        medium: Medium,
        gravity: Sequence[float],
        backend: Backend,
        body_force: LinearField | None = None,
        *,
        with_rho_rate: bool = False,
    ) -> None:
        self.grid = grid
        self.near = near
        self.walls = walls
        self.has_walls = walls is not None
        self.dtype = backend.dtype
        self.gravity = tuple(gravity)
        self.has_body_force = body_force is not None
        if body_force is not None:
            self.force_gradient = body_force.gradient
            self.force_origin, self.force_value = body_force.base
        self.dim = dim = grid.geometry.dim
        self.width = width = dim + int(with_rho_rate)
        kernel, mass, rest_density = medium.kernel, medium.mass, medium.rest_density
        tiny = (1e-6 * medium.support) ** 2  # keeps grad W of a particle on itself, which is zero, from becoming 0/0
        terms = list(terms)

        @ti.func
        def rates(acceleration, v_ij, x_ij):
            """Put the contribution to the density's rate, per unit of gradient factor, behind the acceleration."""
            result = ti.Vector.zero(backend.dtype, width)
            for d in ti.static(range(dim)):
                result[d] = acceleration[d]
            if ti.static(width > dim):
                result[dim] = v_ij.dot(x_ij)
            return result

        @ti.func
        def fluid_pair(i, j):
            x_ij = near.x[i] - near.x[j]
            d2 = x_ij.norm_sqr()
            acceleration = ti.Vector.zero(backend.dtype, dim)
            for term in ti.static(terms):
                acceleration += term.fluid_pair(i, j, x_ij, d2)
            return mass * kernel.gradient_factor(ti.sqrt(d2 + tiny)) * rates(acceleration, near.v[i] - near.v[j], x_ij)

        @ti.func
        def wall_pair(i, b):
            x_ib = near.x[i] - walls.x[b]
            d2 = x_ib.norm_sqr()
            acceleration = ti.Vector.zero(backend.dtype, dim)
            for term in ti.static(terms):
                acceleration += term.wall_pair(i, b, x_ib, d2)
            factor = rest_density * walls.volume[b] * kernel.gradient_factor(ti.sqrt(d2 + tiny))
            return factor * rates(acceleration, near.v[i], x_ib)

        self.sum_fluid = make_neighbour_sum(grid.geometry, grid.start, fluid_pair, width, backend)
        if walls is not None:
            self.sum_walls = make_neighbour_sum(grid.geometry, walls.start, wall_pair, width, backend)

    @ti.func
    def wall_rates(self, k):
        """The walls' share of the rates, (width,), of the particle at place `k`."""
        total = ti.Vector.zero(self.dtype, self.width)
        if ti.static(self.has_walls):
            i = self.grid.order[k]
            if self.walls.near[self.grid.block(i)] == 1:
                total = self.sum_walls(k, self.near.x[k], self.grid.cell_of[i])
        return total

    @ti.func
    def other_rates(self, k):
        """All but the walls' share of the rates, (width,), of the particle at place `k`."""
        x = self.near.x[k]
        total = self.sum_fluid(k, x, self.grid.cell_of[self.grid.order[k]])
        for d in ti.static(range(self.dim)):
            total[d] += self.gravity[d]
        if ti.static(self.has_body_force):
            for d in ti.static(range(self.dim)):
                total[d] += self.force_value[d]
                for e in ti.static(range(self.dim)):
                    total[d] += self.force_gradient[d][e] * (x[e] - self.force_origin[e])
        return total
