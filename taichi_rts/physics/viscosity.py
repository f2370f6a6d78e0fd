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
    def wall_pair(self, i, b, x_ib, d2):
        """The same against a wall at rest, which has the particle's density."""
        approach = ti.min(self.near.v[i].dot(x_ib), 0.0)
        return 0.5 * self.factor * approach / (self.near.rho[i] * (d2 + self.regular)) * x_ib


@ti.data_oriented
class LaminarViscosity:
    """Morris, Fox & Zhu 1997, Eq. 22, for one kinematic viscosity nu [m^2/s]; no slip at walls.

    a_i = sum_j m 4 nu / (rho_i + rho_j) (x_ij . grad W) / (|x_ij|^2 + 0.01 h^2) v_ij
    """

    def __init__(self, near: Neighbourhood, nu: float, h: float) -> None:
        self.near = near
        self.factor = 4.0 * nu
        self.regular = 0.01 * h * h

    @ti.func
    def fluid_pair(self, i, j, x_ij, d2):
        """Acceleration per unit of m times the gradient factor."""
        scale = self.factor * d2 / ((self.near.rho[i] + self.near.rho[j]) * (d2 + self.regular))
        return scale * (self.near.v[i] - self.near.v[j])

    @ti.func
    def wall_pair(self, i, b, x_ib, d2):
        """The same against a wall at rest, which has the particle's density."""
        return 0.5 * self.factor * d2 / (self.near.rho[i] * (d2 + self.regular)) * self.near.v[i]


def viscosity_terms(scene: Scene, medium: Medium, near: Neighbourhood) -> list[Any]:
    """List the viscosity terms that have any effect in `scene`: none, one or both."""
    h = 0.5 * medium.support
    terms: list[Any] = []
    if scene.artificial_viscosity > 0.0:
        terms.append(ArtificialViscosity(near, scene.artificial_viscosity, h, medium.sound_speed))
    if scene.kinematic_viscosity > 0.0:
        terms.append(LaminarViscosity(near, scene.kinematic_viscosity, h))
    return terms
