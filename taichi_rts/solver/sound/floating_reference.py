"""An equation of state whose sound speed may change without the pressure jumping: its reference density floats."""

from typing import Any, NamedTuple

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.medium.equation_of_state import Tait, tait
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.sound.rule import SoundRule


class HostReference(NamedTuple):
    """Sound speeds [m/s], stiffness B_i [Pa] and reference densities [kg/m^3], (N,), of particles at one moment, by id."""

    sound: np.ndarray
    stiffness: np.ndarray
    reference: np.ndarray

    def pressure_numpy(self, rho: Any) -> Any:
        """Pressure [Pa], (N,), of the particles at densities `rho` [kg/m^3], (N,), by particle id."""
        return np.maximum(self.stiffness * ((rho / self.reference) ** 7 - 1.0), 0.0)

    def specific_energy(self, rho: Any) -> Any:
        """Energy of compression [J/kg], (N,), as with Tait, from each particle's reference density."""
        ratio = np.maximum(rho / self.reference, 1.0)
        return self.stiffness / self.reference * (ratio**6 / 6.0 + 1.0 / ratio - 7.0 / 6.0)


@ti.data_oriented
class FloatingReference(Tait):
    """Tait's with c_i and rho_ref,i of every particle: p_i = rho_0 c_i^2/7 ((rho_i/rho_ref,i)^7 - 1), p_i >= 0.

    Why it floats: with p = p(rho) alone another c_i would make p_i jump, and with it every force nearby. So when c_i changes,
    rho_ref,i moves to where the pressure stays: rho_ref = rho (1 + 7 p/(rho_0 c_new^2))^(-1/7). Afterwards it relaxes to
    rho_0, by c dt/(memory r) of the way in a step dt: about 1 % a step, so that no particle keeps a volume that is not its
    own. Between two evaluations pressure is a function of positions alone, which is why steps may be as long as with Tait's
    (an evolved pressure needs shorter ones). Where the pressure is cut off the reference does not move: a particle of
    the free surface, whose sum is not full, must not press at half the density.

    c_i follows its block (`SoundRule`): up to the target at once, because what comes fast must meet stiff fluid, and, while it
    is above the ceiling, down by 1/c_new = 1/c + dt/(memory r).
    """

    def __init__(self, tait: Tait, particles: FluidState, rule: SoundRule) -> None:
        vars(self).update(vars(tait))
        self.particles = particles
        self.rule = rule
        particles.sound.fill(rule.floor)

    @ti.func
    def pressure_of(self, i, rho):
        """Pressure [Pa] of particle `i` at density `rho` [kg/m^3]."""
        return ti.max(tait(self.stiffness_of(i), rho / self.particles.reference[i]), 0.0)

    @ti.func
    def stiffness_of(self, i):
        """B_i = rho_0 c_i^2 / 7 [Pa]."""
        c = self.particles.sound[i]
        return (self.rest_density / 7.0) * c * c

    @ti.func
    def adapt(self, i, block, rho, elapsed):
        """Take note that particle `i` in `block` now has density `rho` [kg/m^3], `elapsed` [s] after its last evaluation."""
        pressure = self.pressure_of(i, rho)
        if ti.static(self.particles.has_budget):
            self.particles.sound_work[i] -= self.energy_of(i, rho)
        before = self.particles.sound[i]
        fallen = before / (1.0 + before * elapsed * self.rule.forgetting)
        lowered = ti.min(before, ti.max(fallen, self.rule.ceiling[block]))
        self.particles.sound[i] = ti.max(self.rule.target[block], lowered)
        if pressure > 0.0 and self.particles.sound[i] != before:  # else it stays where it is, and a power costs 30 ns
            self.particles.reference[i] = rho * ti.pow(1.0 + pressure / self.stiffness_of(i), -1.0 / 7.0)
        share = ti.min(1.0, self.particles.sound[i] * elapsed * self.rule.forgetting)
        self.particles.reference[i] += share * (self.rest_density - self.particles.reference[i])
        if ti.static(self.particles.has_budget):
            self.particles.sound_work[i] += self.energy_of(i, rho)

    @ti.func
    def energy_of(self, i, rho):
        """Energy of compression [J/kg] as `specific_energy` gives it, expanded about rho_ref so that no digits cancel."""
        s = ti.max(rho / self.particles.reference[i] - 1.0, 0.0)
        return self.stiffness_of(i) / self.particles.reference[i] * s * s * (3.5 + s * (7.0 / 3.0 + 3.5 * s))

    def pressure_numpy(self, rho: Any) -> Any:
        """Pressure [Pa], (N,), of the particles at densities `rho` [kg/m^3], (N,), by particle id."""
        return self.on_host().pressure_numpy(rho)

    def specific_energy(self, rho: Any) -> Any:
        """Energy of compression [J/kg], (N,), as with Tait, from each particle's reference density."""
        return self.on_host().specific_energy(rho)

    def on_host(self) -> HostReference:
        """Return the present sound speeds and reference densities, read from the device."""
        sound, reference = (
            self.particles.to_numpy(field) for field in (self.particles.sound, self.particles.reference)
        )
        stiffness = self.rest_density / 7.0 * sound.astype(float) ** 2
        return HostReference(sound, stiffness, reference.astype(float))
