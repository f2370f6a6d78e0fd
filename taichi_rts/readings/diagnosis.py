"""What a run that has blown up has to say: when, which particle, where, what is exceeded, and what to do about it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.errors import SimulationDivergedError
from taichi_rts.readings.reading import Readable, Reading
from taichi_rts.scene.placing import placed
from taichi_rts.solver.motion.motion import RUNAWAY_ACCELERATION, RUNAWAY_SPEED
from taichi_rts.solver.stepping import criteria

LEAST_DENSITY, MOST_DENSITY = 0.02, 2.0
"""Densities over rest between which a run is whole: one particle alone has 0.04 or more, an impact at 0.7 c_s 1.4."""
PAPERS_LAMBDA_F = 0.25  # Goswami & Batty 2014, for steppers without a factor of their own
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
        criteria: the largest speed and acceleration in its block, and the steps that these and the sound speed allow.
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
    criteria: str = ""

    def __str__(self) -> str:
        """Return it in three sentences."""
        place = ", ".join(f"{x:.4g}" for x in self.position)
        return (
            f"at t = {self.time:.4g} s particle {self.particle} at ({place}) m, level {self.level} with a step of "
            f"{1e3 * self.step:.3g} ms: {self.exceeded}. {self.criteria}Likely cause: {self.cause}. Remedy: {self.remedy}."
        )


def require_whole(state: Reading) -> None:
    """Raise `SimulationDivergedError` with a diagnosis if the run has blown up."""
    if (found := diagnose(state)) is not None:
        raise SimulationDivergedError(f"blown up: {found}")


def diagnose(state: Readable) -> Diagnosis | None:
    """Find the particle that is worst off in a run that has blown up, or return None for one that has not.

    `state` is a `Reading`, or a `Simulation`, whose present state is then read: it says most soon after things went wrong.
    """
    now = state.read()
    x, v, rho = (np.asarray(a, dtype=np.float64) for a in (now.local_positions, now.velocities, now.densities))
    ratio = rho / now.medium.rest_density
    thin = LEAST_DENSITY / np.maximum(ratio, 1e-30)
    if (
        not now.runaways
        and not now.not_finite
        and np.isfinite(x).all()
        and np.isfinite(v).all()
        and (ratio <= MOST_DENSITY).all()
        and (thin <= 1.0).all()
    ):
        return None
    finite = np.isfinite(x).all(axis=1) & np.isfinite(v).all(axis=1) & np.isfinite(rho)
    c, r = now.medium.sound_speed, now.medium.support
    a = now.accelerations.astype(np.float64)
    speed, acceleration = np.linalg.norm(v, axis=1), np.linalg.norm(a, axis=1)
    limits = (RUNAWAY_SPEED * c, RUNAWAY_ACCELERATION * c * c / r, MOST_DENSITY)
    shares = np.stack([speed / limits[0], acceleration / limits[1], np.maximum(ratio / limits[2], thin)])
    shares[:, ~finite] = np.inf
    shares = np.where(np.isnan(shares), np.inf, shares)
    particle = int(shares.max(axis=0).argmax())
    cause, remedy = _cause(now, speed[finite], float(now.steps.max()) * c / r)
    return Diagnosis(
        time=now.time,
        particle=particle,
        position=tuple(placed(now.scene, x[particle])),
        velocity=tuple(v[particle]),
        level=int(now.levels[particle]),
        step=float(now.steps[particle]),
        exceeded=_exceeded(now, particle, shares[:, particle], speed, acceleration, rho),
        cause=cause,
        remedy=remedy,
        criteria=_criteria(now, x, particle, speed, acceleration),
    )


def _criteria(now: Reading, x: np.ndarray, particle: int, speed: np.ndarray, acceleration: np.ndarray) -> str:
    """Return what limits the step in the particle's block, in one sentence."""
    geometry, c, r = now.geometry, now.medium.sound_speed, now.medium.support
    inside = np.clip(np.nan_to_num(x), now.local.domain.lower, now.local.domain.upper)
    blocks = geometry.cell_numpy(inside) // CELLS_PER_BLOCK
    mates = blocks == blocks[particle]
    v, a = (float(values[mates & np.isfinite(values)].max(initial=0.0)) for values in (speed, acceleration))
    lambda_f = getattr(now.stepper, "lambda_f", None) or PAPERS_LAMBDA_F
    allowed = {
        f"{LARGE_COURANT:g} r/(c_s + |v|)": criteria.acoustic_step(LARGE_COURANT, r, c + v),
        f"{lambda_f:g} sqrt(r/|a|)": criteria.force_step(lambda_f, r, a),
        "viscosity": criteria.scene_viscous_step(now.scene),
    }
    steps = ", ".join(f"{name} {1e3 * step:.3g} ms" for name, step in allowed.items() if np.isfinite(step))
    extremes = f"|v| up to {v:.3g} m/s, |a| up to {a:.3g} m/s^2"
    return f"Its block: {int(mates.sum())} particles, {extremes}, which allow steps of {steps}. "


def _exceeded(now: Reading, i: int, shares: Any, speed: Any, acceleration: Any, rho: Any) -> str:
    c, r = now.medium.sound_speed, now.medium.support
    if not np.isfinite(shares).all():
        return "its state is not a finite number"
    density = f"density {rho[i] / now.medium.rest_density:.3g} of rest"
    if shares[2] >= max(1.0, *shares[:2]):
        return f"{density} is not between {LEAST_DENSITY:g} and {MOST_DENSITY:g}"
    if shares[:2].max() < AT_LIMIT:
        count = now.runaways
        return f"speed {speed[i]:.3g} m/s = {speed[i] / c:.2g} c_s, {density}; {count:,} earlier values were limited"
    if shares[0] >= AT_LIMIT:
        return f"speed {speed[i]:.3g} m/s reaches the limit of {RUNAWAY_SPEED:g} c_s = {RUNAWAY_SPEED * c:.3g} m/s, {density}"
    limit = RUNAWAY_ACCELERATION * c * c / r
    return (
        f"acceleration {acceleration[i]:.3g} m/s^2 reaches the limit of {RUNAWAY_ACCELERATION:g} c_s^2/r = {limit:.3g} m/s^2, "
        f"{density}"
    )


def _cause(now: Reading, speed: np.ndarray, courant: float) -> tuple[str, str]:
    """Return the likely cause and its remedy, `courant` being that of the longest step in use."""
    c, expected = now.medium.sound_speed, now.scene.estimate_max_speed()
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
