"""Density integrated in time with the continuity equation, and the diffusion that keeps it smooth (delta-SPH)."""

from collections.abc import Callable
from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.medium.medium import Medium
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.density import Density
from taichi_rts.solver.physics.momentum import Pressure

DELTA = 0.1
"""Strength of the diffusion (Antuono, Colagrossi & Marrone 2012; Fourtakas et al. 2019)."""


@ti.data_oriented
class ContinuityDensity(Density):
    """d rho_i/dt = sum_j m v_ij . grad W_ij + sum_b rho_0 V_b v_ib . grad W_ib + D_i (Monaghan 1994; D_i: `DensityDiffusion`).

    The step: rho' = rho + dt [sum_j m v_ij . grad W_ij] + dt D_i with the sum taken at the middle of the step, at the
    positions and velocities that lead to the predicted ones: v - a dt/2 and x - v dt/2 + a dt^2/8. Then density follows
    positions to second order, as a summed one does, and acoustic waves are stable up to the same step. (The rate at the end of
    the predicted step, corrected like velocities, is the second Adams-Bashforth scheme for them, which is unstable without
    viscosity.) D_i is that of the last evaluation; `Motion.advance_due` corrects it afterwards.
    """

    integrates = True
    reads = ("x", "v", "a", "elapsed")
    needs = frozenset({"rho_rate", "diffusion", "acceleration"})

    def pairs(self, medium: Medium) -> tuple[Any, Any]:
        """Return m v_ij . grad W_ij at the middle of the step, and rho_0 V_b v_ib . grad W_ib for a wall."""
        near = self.near
        kernel, mass, rest_density, tiny = medium.kernel, medium.mass, medium.rest_density, medium.tiny

        @ti.func
        def compression(x_ij, v_ij, a_ij, dt):
            """V . grad W per unit of mass at the middle of a step of `dt` [s] that ends at x_ij, v_ij."""
            v = v_ij - (0.5 * dt) * a_ij
            x = x_ij - (0.5 * dt) * v - (0.125 * dt * dt) * a_ij
            return ti.Vector([kernel.gradient_factor(ti.sqrt(x.norm_sqr() + tiny)) * v.dot(x)])

        @ti.func
        def fluid_pair(near, i, j):
            x_ij = near.difference(i, j)
            return mass * compression(x_ij, near.v[i] - near.v[j], near.a[i] - near.a[j], near.elapsed[i])

        def wall_pair(wall: Any) -> Callable[..., Any]:
            @ti.func
            def pair(i, b):
                x_ib, v_ib = wall.difference(i, b), wall.relative_velocity(i, b)
                return rest_density * wall.volume[b] * compression(x_ib, v_ib, near.a[i], near.elapsed[i])

            return pair

        return fluid_pair, wall_pair

    @ti.func
    def found(self, i, k, total):
        """Density at the end of the step."""
        return self.particles.rho[i] + self.near.elapsed[k] * (total + self.particles.diffusion[i])

    @ti.func
    def keep_rates(self, i, rates, dt):
        """Take the rate of the density and correct its diffusion over the step of `dt` [s]."""
        p = self.particles
        p.rho_rate[i] = rates[p.dim]
        diffusion = rates[p.dim + 1]
        p.rho[i] += (0.5 * dt) * (diffusion - p.diffusion[i])
        p.diffusion[i] = diffusion
        p.rho_rate[i] += diffusion


def rise_of_pressure(scene: Scene) -> tuple[float, ...]:
    """-g/rho_0 [m^4/(kg s^2)], (dim,): how p/rho_0^2 rises in water at rest; 0 where gravity changes."""
    return tuple(0.0 if scene.gravity_changes else -g / scene.rest_density for g in scene.acceleration)


def with_image(own, rise, larger: ti.template()):
    """p_i/rho_i^2 of a particle and that of its image in the wall, where the water between them adds `rise`.

    In NumPy and, as `_with_image`, in kernels: `larger` is the maximum of the one or the other.
    """
    return own + larger(own + rise, 0.0)


_with_image = ti.func(with_image)


@ti.data_oriented
class MirroredPressure(Pressure):
    """Pressure against walls that have the pressure of the particle they push, and below it that of the water between.

    -sum_b rho_0 V_b (p_i/rho_i^2 + max(0, p_i/rho_i^2 - g . x_ib / rho_0)) grad W_ib: Adami et al. 2012, Eq. 27, with the
    particle itself in place of the mean over the wall's neighbours, so that a wall needs no state. A summed density does not
    bear it (see `Pressure`); an integrated one, which the diffusion damps, does: a column of water rests under its hydrostatic
    pressure to 1-2 %, where the one-sided force leaves 10 % (docs/evidence/validation.md).
    """

    def __init__(self, near: Neighbourhood, scene: Scene) -> None:
        super().__init__(near)
        self.rise = rise_of_pressure(scene)

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall: ti.template()):
        """Acceleration along x_ib per unit of rho_0 V_b times the gradient factor."""
        return -_with_image(self.near.p_over_rho2[i], ti.Vector(self.rise).dot(x_ib), ti.max)


@ti.data_oriented
class DensityDiffusion:
    """D_i = 2 delta h c_s sum_j V_j psi_ij x_ij . grad W_ij / |x_ij|^2 with h = r/2 (Molteni & Colagrossi 2009).

    psi_ij = rho_i - rho_j - rho_0 g . x_ij / c_s^2: what the densities differ by more than in water at rest, so that it comes
    to rest under hydrostatic pressure (Fourtakas et al. 2019, Eq. 18, linearised). Where gravity changes, g is left out.
    """

    def __init__(self, medium: Medium, scene: Scene) -> None:
        h = 0.5 * medium.support
        self.factor = 2.0 * DELTA * h * medium.sound_speed
        self.regular = 0.01 * h * h
        stiffness = 0.0 if scene.gravity_changes else medium.rest_density / medium.sound_speed**2
        self.hydrostatic = tuple(stiffness * g for g in scene.acceleration)
        """Density gradient [kg/m^4] of water at rest, (dim,)."""

    @ti.func
    def fluid_pair(self, near: ti.template(), i, j, x_ij, d2):
        """Rate [kg/(m^3 s)] per unit of m times the gradient factor."""
        excess = near.rho[i] - near.rho[j] - ti.Vector(self.hydrostatic).dot(x_ij)
        return self.factor * excess * d2 / (near.rho[j] * (d2 + self.regular))
