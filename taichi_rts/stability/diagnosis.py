"""What a run that has blown up has to say: when, which particle, where, what is exceeded, and what to do about it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from taichi_rts.motion import RUNAWAY_ACCELERATION, RUNAWAY_SPEED
from taichi_rts.simulation import Simulation

AT_LIMIT = 0.999  # share of a limit from which on a value counts as limited; rounding lies below
STRONG_MACH = 0.2  # beyond it flow is no longer weakly compressible: twice what the default sound speed is chosen for
LARGE_COURANT = 0.4  # of the longest step, up to which the defaults go


@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """The particle that is worst off, and why.

    Attributes:
        time: [s].
        particle: its id.
        position, velocity: [m], [m/s], (dim,).
        level, step: its level n and its step [s].
        exceeded: what it exceeds, with value and limit.
        cause, remedy: in words.
    """

    time: float
    particle: int
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    level: int
    step: float
    exceeded: str
    cause: str
    remedy: str

    def __str__(self) -> str:
        """Return it in three sentences."""
        place = ", ".join(f"{x:.4g}" for x in self.position)
        return (
            f"at t = {self.time:.4g} s particle {self.particle} at ({place}) m, level {self.level} with a step of "
            f"{1e3 * self.step:.3g} ms: {self.exceeded}. Likely cause: {self.cause}. Remedy: {self.remedy}."
        )


def diagnose(sim: Simulation) -> Diagnosis | None:
    """Find the particle that is worst off in a run that has blown up, or return None for one that has not.

    It reads the present state, so it says most when called soon after things went wrong.
    """
    if not int(sim.motion.runaways[None]) and not int(sim.motion.not_finite[None]):
        return None
    x, v, rho, levels = (np.asarray(values, dtype=np.float64) for values in sim.state())
    finite = np.isfinite(x).all(axis=1) & np.isfinite(v).all(axis=1) & np.isfinite(rho)
    c, r = sim.medium.sound_speed, sim.medium.support
    a = sim.particles.to_numpy(sim.particles.a).astype(np.float64)
    speed, acceleration = np.linalg.norm(v, axis=1), np.linalg.norm(a, axis=1)
    shares = np.stack([speed / (RUNAWAY_SPEED * c), acceleration / (RUNAWAY_ACCELERATION * c * c / r)])
    shares[:, ~finite] = np.inf
    shares = np.where(np.isnan(shares), np.inf, shares)
    particle = int(shares.max(axis=0).argmax())
    steps = sim.steps()
    cause, remedy = _cause(sim, speed[finite], float(steps.max()) * c / r)
    return Diagnosis(
        time=sim.time,
        particle=particle,
        position=tuple(x[particle]),
        velocity=tuple(v[particle]),
        level=int(levels[particle]),
        step=float(steps[particle]),
        exceeded=_exceeded(sim, particle, shares[:, particle], speed, acceleration, rho),
        cause=cause,
        remedy=remedy,
    )


def _exceeded(sim: Simulation, i: int, shares: Any, speed: Any, acceleration: Any, rho: Any) -> str:
    c, r = sim.medium.sound_speed, sim.medium.support
    if not np.isfinite(shares).all():
        return "its state is not a finite number"
    density = f"density {rho[i] / sim.medium.rest_density:.3g} of rest"
    if shares.max() < AT_LIMIT:
        count = sim.statistics["runaways"]
        return f"speed {speed[i]:.3g} m/s = {speed[i] / c:.2g} c_s, {density}; {count:,} earlier values were limited"
    if shares[0] >= AT_LIMIT:
        return f"speed {speed[i]:.3g} m/s reaches the limit of {RUNAWAY_SPEED:g} c_s = {RUNAWAY_SPEED * c:.3g} m/s, {density}"
    limit = RUNAWAY_ACCELERATION * c * c / r
    return (
        f"acceleration {acceleration[i]:.3g} m/s^2 reaches the limit of {RUNAWAY_ACCELERATION:g} c_s^2/r = {limit:.3g} m/s^2, "
        f"{density}"
    )


def _cause(sim: Simulation, speed: np.ndarray, courant: float) -> tuple[str, str]:
    """Return the likely cause and its remedy, `courant` being that of the longest step in use."""
    c, expected = sim.medium.sound_speed, sim.scene.estimate_max_speed()
    slower = f"a smaller courant (the longest step is {courant:.3g} r/c_s now)"
    if expected > STRONG_MACH * c:
        faster = f"a larger sound_speed (now {c:.3g} m/s; ten times the largest speed is {10 * expected:.3g} m/s)"
        return (
            f"fluid that starts or falls at up to {expected:.3g} m/s = {expected / c:.2g} c_s, an impact that compresses it "
            "so much that its own sound outruns the step",
            f"{faster}, or {slower}",
        )
    if courant > LARGE_COURANT * (1 + 1e-6):
        return (f"steps of up to {courant:.3g} r/c_s, beyond the {LARGE_COURANT:g} of the defaults", slower)
    fastest = float(speed.max(initial=0.0))
    return (
        f"speeds of up to {fastest:.3g} m/s where {expected:.3g} m/s was expected",
        f"{slower}, or a larger sound_speed (now {c:.3g} m/s)",
    )


class FirstDiagnoses:
    """Keeps the first diagnosis of each of several runs: later ones only show the debris."""

    def __init__(self, runs: Mapping[Any, Simulation]) -> None:
        self.runs = runs
        self.found: dict[Any, Diagnosis] = {}

    def look(self) -> None:
        """Look at every run that has none yet; costs two small reads each while all is well."""
        for name, sim in self.runs.items():
            if name not in self.found and (diagnosis := diagnose(sim)) is not None:
                self.found[name] = diagnosis
