"""Viscosity terms of the momentum equation; only terms that a scene uses are compiled.

They leave out their common denominator, (rho_i + rho_j) (|x_ij|^2 + 0.01 h^2): see `MomentumEquation`.
"""

from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.medium.medium import Medium
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.particles.neighbourhood import Neighbourhood


@ti.data_oriented
class ArtificialViscosity:
    """Monaghan 1992; Becker & Teschner 2007, Eq. 10: Pi_ij = -nu (v_ij . x_ij) / (|x_ij|^2 + 0.01 h^2) where v_ij . x_ij < 0.

    nu = 2 alpha h c_s / (rho_i + rho_j) with h = r/2. The acceleration is -m Pi_ij grad W. It acts along the line of
    centres, so it damps collisions with walls and lets fluid slip along them.
    """

    along = "x"

    def __init__(self, alpha: float, h: float, sound_speed: float) -> None:
        self.factor = 2.0 * alpha * h * sound_speed

    @ti.func
    def fluid_pair(self, near: ti.template(), i, j, x_ij, v_ij, d2):
        """Coefficient of x_ij."""
        approach = v_ij.dot(x_ij)
        return self.factor * ti.select(approach < 0.0, approach, 0.0)  # quicker than min, which also handles NaN

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall: ti.template()):
        """The same against a wall, which has the particle's density."""
        return self.fluid_pair(self, i, b, x_ib, v_ib, d2)


@ti.data_oriented
class LaminarViscosity:
    """Morris, Fox & Zhu 1997, Eq. 22, for the kinematic viscosity nu [m^2/s]; no slip at walls.

    a_i = sum_j m 4 nu / (rho_i + rho_j) (x_ij . grad W) / (|x_ij|^2 + 0.01 h^2) v_ij. Where fluids differ, nu is
    2 nu_i nu_j / (nu_i + nu_j), which keeps the stress continuous (Cleary & Monaghan 1999); `nu` is then None.
    """

    along = "v"

    def __init__(self, near: Neighbourhood, nu: float | None) -> None:
        self.near = near
        self.nu: Any = nu
        self.differs = nu is None

    @ti.func
    def nu_between(self, near: ti.template(), i, j):
        """Viscosity [m^2/s] between the particles at places `i` and `j`."""
        nu = 0.0
        if ti.static(self.differs):
            one, two = near.viscosity[i], near.viscosity[j]
            nu = 2.0 * one * two / ti.max(one + two, 1e-30)
        else:
            nu = self.nu
        return nu

    @ti.func
    def fluid_pair(self, near: ti.template(), i, j, x_ij, v_ij, d2):
        """Coefficient of v_ij."""
        return 4.0 * self.nu_between(near, i, j) * d2

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall: ti.template()):
        """The same against a wall, which has the particle's density and viscosity, with no slip on its face."""
        return 4.0 * self.nu_between(self.near, i, i) * d2 * wall.shear(i, b, x_ib)


def viscosity_terms(scene: Scene, medium: Medium, near: Neighbourhood) -> list[Any]:
    """List the viscosity terms that have any effect in `scene`: none, one or both."""
    h = 0.5 * medium.support
    terms: list[Any] = []
    if scene.artificial_viscosity > 0.0:
        terms.append(ArtificialViscosity(scene.artificial_viscosity, h, scene.viscous_wave_speed))
    if max(scene.viscosities) > 0.0:
        same = len(set(scene.viscosities)) == 1
        terms.append(LaminarViscosity(near, scene.viscosities[0] if same else None))
    return terms
