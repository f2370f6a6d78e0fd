"""The momentum equation: gravity, a body force, pressure and the scene's viscosity terms, in one loop over neighbours."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from taichi_rts.backend import Backend
from taichi_rts.grid import BlockGrid, make_neighbour_sum
from taichi_rts.particles import Neighbourhood
from taichi_rts.physics.medium import Medium
from taichi_rts.physics.walls import make_wall_sum
from taichi_rts.scene import Scene


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
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall: ti.template()):
        """Acceleration per unit of rho_0 V_b times the gradient factor."""
        return -self.near.p_over_rho2[i] * x_ib


@ti.data_oriented
class Gravity:
    """Gravity and the body force: what accelerates fluid without neighbours."""

    def __init__(self, scene: Scene) -> None:
        self.gravity = scene.acceleration
        self.changes = [(change.time, change.gravity) for change in scene.gravity_changes]
        self.dim = scene.dim
        force = scene.body_force
        self.has_body_force = force is not None
        if force is not None:
            self.force_gradient = force.gradient
            self.force_origin, self.force_value = force.base

    @ti.func
    def acceleration(self, x, time):
        """Acceleration [m/s^2], (dim,), at position `x` [m] and `time` [s]."""
        total = ti.Vector(self.gravity)
        for change in ti.static(self.changes):
            if time >= change[0]:
                total = ti.Vector(change[1])
        if ti.static(self.has_body_force):
            for d in ti.static(range(self.dim)):
                total[d] += self.force_value[d]
                for e in ti.static(range(self.dim)):
                    total[d] += self.force_gradient[d][e] * (x[e] - self.force_origin[e])
        return total


@ti.data_oriented
class MomentumEquation:
    """Adds up the terms' accelerations for one particle, and with them, if wanted, the rate of its density.

    The rate is d rho_i/dt = sum_j m v_ij . grad W_ij + sum_b rho_0 V_b v_ib . grad W_ib, the derivative of
    `SummationDensity`; with it the density of a particle that is not due can be carried through its step. All come as one
    vector of "rates": dv/dt [m/s^2], (dim,), with `with_rho_rate` then d rho/dt [kg/(m^3 s)], with a `diffusion` of the
    density, such as `DensityDiffusion`, that last.

    A term is an object with two ti.funcs, `fluid_pair(i, j, x_ij, d2)` and `wall_pair(i, b, x_ib, v_ib, d2, wall)`, that
    return the acceleration per unit of mass times gradient factor (see `smoothing`), as a vector.
    """

    def __init__(
        self,
        terms: Sequence[Any],
        near: Neighbourhood,
        grid: BlockGrid,
        walls: Sequence[Any],
        medium: Medium,
        gravity: Gravity,
        backend: Backend,
        *,
        with_rho_rate: bool = False,
        diffusion: Any = None,
    ) -> None:
        self.grid = grid
        self.near = near
        self.gravity = gravity
        geometry = grid.geometry
        self.dim = dim = geometry.dim
        diffuses = diffusion is not None
        self.width = width = dim + int(with_rho_rate) + int(diffuses)
        kernel, mass, rest_density = medium.kernel, medium.mass, medium.rest_density
        tiny = medium.tiny
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
            x_ij = geometry.difference(near.x[i], near.x[j])
            d2 = x_ij.norm_sqr()
            acceleration = ti.Vector.zero(backend.dtype, dim)
            for term in ti.static(terms):
                acceleration += term.fluid_pair(i, j, x_ij, d2)
            result = rates(acceleration, near.v[i] - near.v[j], x_ij)
            if ti.static(diffuses):
                result[width - 1] = diffusion.fluid_pair(i, j, x_ij, d2)
            return mass * kernel.gradient_factor(ti.sqrt(d2 + tiny)) * result

        @ti.func
        def push(i, b, wall: ti.template()):
            """Difference of places and velocities, acceleration per unit of factor, and the factor, of a wall particle."""
            x_ib, v_ib = wall.difference(i, b), wall.relative_velocity(i, b)
            d2 = x_ib.norm_sqr()
            acceleration = ti.Vector.zero(backend.dtype, dim)
            for term in ti.static(terms):
                acceleration += term.wall_pair(i, b, x_ib, v_ib, d2, wall)
            return x_ib, v_ib, acceleration, rest_density * wall.volume[b] * kernel.gradient_factor(ti.sqrt(d2 + tiny))

        def wall_pair(wall: Any) -> Any:
            @ti.func
            def pair(i, b):
                x_ib, v_ib, acceleration, factor = push(i, b, wall)
                return factor * rates(acceleration, v_ib, x_ib)

            return pair

        def power_pair(wall: Any) -> Any:
            @ti.func
            def pair(i, b):
                _x_ib, v_ib, acceleration, factor = push(i, b, wall)
                return ti.Vector([factor * acceleration.dot(near.v[i] - v_ib)])

            return pair

        self.wall_pair = wall_pair
        self.moving = [wall for wall in walls if wall.moves]
        self.sum_fluid = make_neighbour_sum(geometry, grid.start, fluid_pair, width, backend)
        self.wall_rates = make_wall_sum(walls, grid, wall_pair, width, backend)
        """The walls' share of the rates, (width,), of the particle at a place."""
        self.wall_power = make_wall_sum(self.moving, grid, power_pair, 1, backend)
        """Power [W/kg] of moving walls on the particle at a place, (1,): their accelerations times their velocities."""

    @ti.func
    def other_rates(self, k, time):
        """All but the walls' share of the rates, (width,), of the particle at place `k` at `time` [s]."""
        x = self.near.x[k]
        total = self.sum_fluid(k, x, self.grid.cell_of[self.grid.order[k]])
        outer = self.gravity.acceleration(x, time)
        for d in ti.static(range(self.dim)):
            total[d] += outer[d]
        return total
