"""The momentum equation: gravity, a body force, pressure and the scene's viscosity terms, in one loop over neighbours."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from taichi_rts.device.backend import Backend, ti
from taichi_rts.medium.medium import Medium
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.neighbour_sum import NeighbourSum
from taichi_rts.solver.grid.sums import make_wall_sum
from taichi_rts.solver.grid.windows import FluidWindows
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.own_forces import OwnBodies, OwnForces, OwnPairs
from taichi_rts.solver.physics.timetable import Timetable, store


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
    def fluid_pair(self, near: ti.template(), i, j, x_ij, v_ij, d2):
        """Acceleration along x_ij per unit of m times the gradient factor."""
        return -(near.p_over_rho2[i] + near.p_over_rho2[j])

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall: ti.template()):
        """Acceleration along x_ib per unit of rho_0 V_b times the gradient factor."""
        return -self.near.p_over_rho2[i]


@ti.data_oriented
class Gravity:
    """Gravity and the body force: what accelerates fluid without neighbours."""

    def __init__(self, scene: Scene) -> None:
        self.gravity = scene.acceleration
        self.dim = scene.dim
        self.changes = bool(scene.gravity_changes)
        if self.changes:
            table = scene.gravity_table
            self.linear, count = table.linear, len(table.times)
            self.table = Timetable(table.times, [*np.diff(table.times), 1e30])
            self.value = ti.Vector.field(self.dim, float, count)
            store(self.value, table.values)
            if self.linear:
                self.rate = ti.Vector.field(self.dim, float, count)
                store(self.rate, table.rates)
        force = scene.body_force
        self.has_body_force = force is not None
        if force is not None:
            self.force_gradient = force.gradient
            self.force_origin, self.force_value = force.base_near(scene.domain.lower, scene.domain.upper)

    @ti.func
    def acceleration(self, x, now, tick):
        """Acceleration [m/s^2], (dim,), at position `x` [m] and tick `now`."""
        total = ti.Vector(self.gravity)
        if ti.static(self.changes):
            n = self.table.piece(now, tick, 0.0)
            total = self.value[n]
            if ti.static(self.linear):
                total += self.table.since_start(n, now, tick, 0.0) * self.rate[n]
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

    Pressure acts along x_ij; viscosity terms act along x_ij or v_ij, as their `along` says, and share the denominator
    (rho_i + rho_j) (|x_ij|^2 + 0.01 h^2), so that a pair costs one division. A term has two ti.funcs, `fluid_pair(near, i, j,
    x_ij, v_ij, d2)` and `wall_pair(i, b, x_ib, v_ib, d2, wall)`, which return its coefficient per unit of mass times gradient
    factor (see `smoothing`), a viscosity's times that denominator. `own` are forces of a user's own.
    """

    def __init__(
        self,
        pressure: Pressure,
        viscosities: Sequence[Any],
        near: Neighbourhood,
        grid: BlockGrid,
        windows: FluidWindows | None,
        walls: Sequence[Any],
        medium: Medium,
        gravity: Gravity,
        backend: Backend,
        *,
        with_rho_rate: bool = False,
        diffusion: Any = None,
        own: OwnForces | None = None,
    ) -> None:
        self.near = near
        self.gravity = gravity
        self.dim = dim = grid.geometry.dim
        diffuses = diffusion is not None
        own = own or OwnForces()
        pairs = OwnPairs(own.pairs, medium)
        self.own_bodies = OwnBodies(own, grid.geometry)
        self.width = width = dim + int(with_rho_rate) + int(diffuses)
        kernel, mass, rest_density = medium.kernel, medium.mass, medium.rest_density
        tiny, regular = medium.tiny, medium.regular
        straight = [term for term in viscosities if term.along == "x"]
        sideways = [term for term in viscosities if term.along == "v"]

        @ti.func
        def rates(pushed, along_x, along_v, spread, x_ij, v_ij, slip, d2, rho):
            """Rates per unit of mass from the coefficients of pressure, viscosities and diffusion; `rho` is rho_i + rho_j.

            Viscosities along v act along `slip`, against fluid v_ij.
            """
            d = ti.sqrt(d2 + tiny)
            thick, factor = 1.0, 0.0
            if ti.static(len(viscosities) > 0):
                thick = rho * (d2 + regular)
                factor = kernel.derivative(d) / (d * thick)
            else:
                factor = kernel.gradient_factor(d)
            result = ti.Vector.zero(backend.dtype, width)
            for e in ti.static(range(dim)):
                result[e] = factor * (thick * pushed + along_x) * x_ij[e]
                if ti.static(len(sideways) > 0):
                    result[e] += factor * along_v * slip[e]
            if ti.static(width > dim):
                result[dim] = factor * thick * v_ij.dot(x_ij)
            if ti.static(diffuses):
                result[width - 1] = factor * thick * spread
            return result

        @ti.func
        def fluid_pair(near, i, j):
            x_ij, v_ij = near.difference(i, j), near.v[i] - near.v[j]
            d2 = x_ij.norm_sqr()
            along_x, along_v, spread = 0.0, 0.0, 0.0
            for term in ti.static(straight):
                along_x += term.fluid_pair(near, i, j, x_ij, v_ij, d2)
            for term in ti.static(sideways):
                along_v += term.fluid_pair(near, i, j, x_ij, v_ij, d2)
            if ti.static(diffuses):
                spread = diffusion.fluid_pair(near, i, j, x_ij, d2)
            pushed = pressure.fluid_pair(near, i, j, x_ij, v_ij, d2)
            total = mass * rates(pushed, along_x, along_v, spread, x_ij, v_ij, v_ij, d2, near.rho[i] + near.rho[j])
            if ti.static(len(own.pairs) > 0):
                drawn = pairs.fluid_pair(near, i, j, x_ij, v_ij, d2)
                for e in ti.static(range(dim)):
                    total[e] += drawn[e]
            return total

        @ti.func
        def push(i, b, wall: ti.template()):
            """Rates due to a wall particle, as those of a fluid particle of the same density."""
            x_ib, v_ib = wall.difference(i, b), wall.relative_velocity(i, b)
            d2 = x_ib.norm_sqr()
            along_x, along_v = 0.0, 0.0
            for term in ti.static(straight):
                along_x += term.wall_pair(i, b, x_ib, v_ib, d2, wall)
            slip = v_ib
            if ti.static(len(sideways) > 0):
                slip = wall.slip(i, b, x_ib, v_ib)
            for term in ti.static(sideways):
                along_v += term.wall_pair(i, b, x_ib, v_ib, d2, wall)
            pushed = pressure.wall_pair(i, b, x_ib, v_ib, d2, wall)
            found = rates(pushed, along_x, along_v, 0.0, x_ib, v_ib, slip, d2, 2.0 * near.rho[i])
            total = rest_density * wall.volume[b] * found
            if ti.static(len(own.pairs) > 0):
                drawn = pairs.wall_pair(i, b, x_ib, v_ib, d2, wall)
                for e in ti.static(range(dim)):
                    total[e] += drawn[e]
            return total

        def wall_pair(wall: Any) -> Any:
            @ti.func
            def pair(i, b):
                return push(i, b, wall)

            return pair

        def power_pair(wall: Any) -> Any:
            @ti.func
            def pair(i, b):
                pushed, v_ib = push(i, b, wall), wall.relative_velocity(i, b)
                v_b = near.v[i] - v_ib
                power = 0.0
                for e in ti.static(range(dim)):
                    power += pushed[e] * v_b[e]
                if ti.static(len(sideways) > 0):  # friction works with the velocity of the face
                    x_ib, along_v = wall.difference(i, b), 0.0
                    d2, slip = x_ib.norm_sqr(), wall.slip(i, b, x_ib, v_ib)
                    for term in ti.static(sideways):
                        along_v += term.wall_pair(i, b, x_ib, v_ib, d2, wall)
                    drag = rates(0.0, 0.0, along_v, 0.0, x_ib, v_ib, slip, d2, 2.0 * near.rho[i])
                    for e in ti.static(range(dim)):
                        power += rest_density * wall.volume[b] * drag[e] * (v_ib[e] - slip[e])
                return ti.Vector([power])

            return pair

        self.wall_pair = wall_pair
        self.moving = [wall for wall in walls if wall.moves]
        names = ["x", "v", "rho", "p_over_rho2", *(["viscosity"] if near.has_viscosity else [])]
        layered = any(wall.layered for wall in walls if not wall.moves)
        wall_names = [
            "x",
            "volume",
            *(["normal"] if sideways or own.pairs else []),
            *(["depths"] if sideways and layered else []),
        ]
        self.sum = NeighbourSum(fluid_pair, wall_pair, width, names, wall_names, near, grid, windows, walls, backend)
        self.wall_power = make_wall_sum(self.moving, grid, power_pair, 1, backend)
        """Power [W/kg] of moving walls on the particle at a place, (1,): their accelerations times their velocities."""

    @ti.func
    def other_rates(self, k, fluid, now, tick):
        """All but the walls' share of the rates, (width,), of the particle at place `k` at tick `now`; `fluid`: the fluid's."""
        total = fluid
        outer = self.gravity.acceleration(self.near.x[k], now, tick)
        for d in ti.static(range(self.dim)):
            total[d] += outer[d]
        if ti.static(len(self.own_bodies.bodies) > 0):
            drawn = self.own_bodies.acceleration(self.near.x[k], now, tick)
            for d in ti.static(range(self.dim)):
                total[d] += drawn[d]
        return total
