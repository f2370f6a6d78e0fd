"""The constants every formulation needs, worked out once from a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from taichi_rts.medium.equation_of_state import Tait
from taichi_rts.medium.smoothing import make_kernel
from taichi_rts.scene.scene import Scene


@dataclass(frozen=True)
class Medium:
    """The fluid as the solver sees it.

    `mass` m of a particle [kg], `rest_density` rho_0 [kg/m^3], `support` radius r [m], `sound_speed` c_s [m/s] (where it is
    regional, the largest), the smoothing `kernel` and the `equation_of_state`.
    """

    mass: float
    rest_density: float
    support: float
    sound_speed: float
    kernel: Any
    equation_of_state: Tait

    @property
    def tiny(self) -> float:
        """A squared length [m^2] that keeps grad W of a particle at itself, which is 0, from becoming 0/0."""
        return (1e-6 * self.support) ** 2

    @property
    def regular(self) -> float:
        """0.01 h^2 [m^2] with h = r/2: keeps viscosity finite where particles meet (Monaghan 1992)."""
        return 0.01 * (0.5 * self.support) ** 2

    @classmethod
    def of(cls, scene: Scene, mass: float) -> Medium:
        """Work out the constants of `scene` for particles of `mass` [kg]."""
        return cls(
            mass=mass,
            rest_density=scene.rest_density,
            support=scene.support,
            sound_speed=scene.wave_speed,
            kernel=make_kernel(scene.kernel, scene.dim, scene.support),
            equation_of_state=Tait(scene.rest_density, scene.wave_speed, scene.background_pressure),
        )
