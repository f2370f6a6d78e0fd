"""Tait's equation of state (Monaghan 1994; Becker & Teschner 2007, Eq. 7), cut off at zero pressure."""

from typing import Any

import numpy as np
import taichi as ti


@ti.data_oriented
class Tait:
    """p = B ((rho/rho_0)^7 - 1) with B = rho_0 c_s^2 / 7; p >= 0, because a free surface cannot pull."""

    def __init__(self, rest_density: float, sound_speed: float) -> None:
        self.rest_density = rest_density
        self.stiffness = rest_density * sound_speed**2 / 7.0
        """B [Pa]."""

    @ti.func
    def pressure(self, rho):
        """Pressure [Pa] at density `rho` [kg/m^3]."""
        ratio = rho * (1.0 / self.rest_density)
        square = ratio * ratio
        return self.stiffness * ti.max(square * square * square * ratio - 1.0, 0.0)

    def pressure_numpy(self, rho: Any) -> Any:
        """Pressure [Pa] for a NumPy array of densities [kg/m^3]."""
        return self.stiffness * np.maximum((rho / self.rest_density) ** 7 - 1.0, 0.0)

    def specific_energy(self, rho: Any) -> Any:
        """Energy of compression [J/kg]: the integral of p/rho^2 from rho_0 to rho, zero where p is cut off."""
        ratio = np.maximum(rho / self.rest_density, 1.0)
        return self.stiffness / self.rest_density * (ratio**6 / 6.0 + 1.0 / ratio - 7.0 / 6.0)
