"""Viscosity terms of the momentum equation; a scene that sets neither compiles neither."""

from typing import Any

import taichi as ti

from taichi_rts.particles import Neighbourhood
from taichi_rts.physics.medium import Medium
from taichi_rts.scene import Scene


@ti.data_oriented
class ArtificialViscosity:
    """Monaghan 1992; Becker & Teschner 2007, Eq. 10: Pi_ij = -nu (v_ij . x_ij) / (|x_ij|^2 + 0.01 h^2) where v_ij . x_ij < 0.

    nu = 2 alpha h c_s / (rho_i + rho_j) with h = r/2. The acceleration is -m Pi_ij grad W. It acts along the line of
    centres, so it damps collisions with walls and lets fluid slip along them.
    """

    def __init__(self, near: Neighbourhood, alpha: float, h: float, sound_speed: float) -> None:
        self.near = near
        self.factor = 2.0 * alpha * h * sound_speed
        self.regular = 0.01 * h * h

    @ti.func
    def fluid_pair(self, i, j, x_ij, d2):
        """Acceleration per unit of m times the gradient factor."""
        approach = ti.min((self.near.v[i] - self.near.v[j]).dot(x_ij), 0.0)
        return self.factor * approach / ((self.near.rho[i] + self.near.rho[j]) * (d2 + self.regular)) * x_ij

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall: ti.template()):
        """The same against a wall, which has the particle's density."""
        approach = ti.min(v_ib.dot(x_ib), 0.0)
        return 0.5 * self.factor * approach / (self.near.rho[i] * (d2 + self.regular)) * x_ib


@ti.data_oriented
class LaminarViscosity:
    """Morris, Fox & Zhu 1997, Eq. 22, for the kinematic viscosity nu [m^2/s]; no slip at walls.

    a_i = sum_j m 4 nu / (rho_i + rho_j) (x_ij . grad W) / (|x_ij|^2 + 0.01 h^2) v_ij. Where fluids differ, nu is
    2 nu_i nu_j / (nu_i + nu_j), which keeps the stress continuous (Cleary & Monaghan 1999); `nu` is then None.
    """

    def __init__(self, near: Neighbourhood, nu: float | None, h: float) -> None:
        self.near = near
        self.nu = nu
        self.differs = nu is None
        self.regular = 0.01 * h * h

    @ti.func
    def nu_between(self, i, j):
        """Viscosity [m^2/s] between the particles at places `i` and `j`."""
        nu = 0.0
        if ti.static(self.differs):
            one, two = self.near.viscosity[i], self.near.viscosity[j]
            nu = 2.0 * one * two / ti.max(one + two, 1e-30)
        else:
            nu = self.nu
        return nu

    @ti.func
    def fluid_pair(self, i, j, x_ij, d2):
        """Acceleration per unit of m times the gradient factor."""
        scale = 4.0 * self.nu_between(i, j) * d2 / ((self.near.rho[i] + self.near.rho[j]) * (d2 + self.regular))
        return scale * (self.near.v[i] - self.near.v[j])

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall: ti.template()):
        """The same against a wall, which has the particle's density and viscosity, with no slip on its face."""
        scale = 2.0 * self.nu_between(i, i) * d2 / (self.near.rho[i] * (d2 + self.regular))
        return scale * wall.shear(i, b, x_ib) * v_ib


def viscosity_terms(scene: Scene, medium: Medium, near: Neighbourhood) -> list[Any]:
    """List the viscosity terms that have any effect in `scene`: none, one or both."""
    h = 0.5 * medium.support
    terms: list[Any] = []
    if scene.artificial_viscosity > 0.0:
        terms.append(ArtificialViscosity(near, scene.artificial_viscosity, h, scene.viscous_wave_speed))
    if max(scene.viscosities) > 0.0:
        same = len(set(scene.viscosities)) == 1
        terms.append(LaminarViscosity(near, scene.viscosities[0] if same else None, h))
    return terms
