"""Tait's equation of state (Monaghan 1994; Becker & Teschner 2007, Eq. 7), cut off at zero pressure."""

from typing import Any

import numpy as np

from taichi_rts.device.backend import ti


@ti.func
def tait(stiffness, ratio):
    """B ((rho/rho_ref)^7 - 1) [Pa] for the stiffness B [Pa] and the ratio of densities."""
    square = ratio * ratio
    return stiffness * (square * square * square * ratio - 1.0)


@ti.data_oriented
class Tait:
    """p = p_b + B ((rho/rho_0)^7 - 1) with B = rho_0 c_s^2 / 7; p >= 0, because a free surface cannot pull.

    `background_pressure` p_b [Pa] is for fluid that has none.
    """

    def __init__(self, rest_density: float, sound_speed: float, background_pressure: float = 0.0) -> None:
        self.rest_density = rest_density
        self.stiffness = rest_density * sound_speed**2 / 7.0
        """B [Pa]."""
        self.background = background_pressure
        self.least_ratio = max(0.0, 1.0 - background_pressure / self.stiffness) ** (1.0 / 7.0)
        """rho/rho_0 at which the pressure is cut off."""

    @ti.func
    def pressure(self, rho):
        """Pressure [Pa] at density `rho` [kg/m^3]."""
        pressure = tait(self.stiffness, rho * (1.0 / self.rest_density))
        if ti.static(self.background > 0.0):
            pressure += self.background
        return ti.max(pressure, 0.0)

    @ti.func
    def pressure_of(self, i, rho):
        """Pressure [Pa] of particle `i` at density `rho` [kg/m^3]."""
        return self.pressure(rho)

    @ti.func
    def energy_of(self, i, rho):
        """Energy of compression [J/kg] of particle `i` at density `rho` [kg/m^3], as `specific_energy` gives it."""
        ratio = ti.max(rho / self.rest_density, self.least_ratio)
        compression = self.stiffness / self.rest_density * (ti.pow(ratio, 6.0) / 6.0 + 1.0 / ratio - 7.0 / 6.0)
        return compression + self.background / self.rest_density * (1.0 - 1.0 / ratio)

    @ti.func
    def adapt(self, i, block, rho, elapsed):
        """Take note that particle `i` in `block` now has density `rho` [kg/m^3], `elapsed` [s] after its last evaluation."""

    sound: Any = None
    """Sound speeds [m/s], (N,), by particle id, where `on_host` has each particle's own."""

    def on_host(self) -> Any:
        """Return what gives `pressure_numpy`, `specific_energy` and `sound` at the present state, also once that has changed."""
        return self

    def pressure_numpy(self, rho: Any) -> Any:
        """Pressure [Pa] for a NumPy array of densities [kg/m^3]."""
        return np.maximum(self.background + self.stiffness * ((rho / self.rest_density) ** 7 - 1.0), 0.0)

    def density(self, pressure: Any) -> Any:
        """Density [kg/m^3] at a NumPy array of pressures [Pa] above the background."""
        return self.rest_density * (1.0 + pressure / self.stiffness) ** (1.0 / 7.0)

    def specific_energy(self, rho: Any) -> Any:
        """Energy of compression [J/kg]: the integral of p/rho^2 from rho_0 to rho, constant where p is cut off."""
        ratio = np.maximum(rho / self.rest_density, self.least_ratio)
        compression = self.stiffness / self.rest_density * (ratio**6 / 6.0 + 1.0 / ratio - 7.0 / 6.0)
        return compression + self.background / self.rest_density * (1.0 - 1.0 / ratio)
