"""What is run: every combination of the sweeps, and the uniform runs that serve as baselines."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import taichi_rts as rts
from taichi_rts.compare import sweeps
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.stepping.steppers import stepper_data

SWEEP, BASE_STEP, LARGEST_STABLE = "sweep", "base step", "largest stable"


@dataclasses.dataclass(frozen=True)
class Variant:
    """One run of a comparison.

    Attributes:
        scene: number of the scene among those compared.
        family: one of `sweeps.kinds`.
        courant: the sweep's number (`sweeps.make_stepper`).
        options: the stepper's parameters that were set.
        changes: the scene's parameters that were set.
        stepper: the stepper as plain data.
        role: why it runs: as part of the sweep, or as a baseline (`BASE_STEP`, `LARGEST_STABLE`).
        equal_step: Courant number of the uniform run that is its baseline at equal step: that of the base step dt_b, for
            asynchronous steps that of the longest, and with the regional sound speed the same number.
    """

    scene: int
    family: str
    courant: float
    options: dict[str, Any]
    changes: dict[str, Any]
    stepper: dict[str, Any]
    equal_step: float
    role: str = SWEEP

    @property
    def series(self) -> str:
        """Name of its line in the plot: all but the Courant number."""
        return " ".join(part for part in (self.family, sweeps.describe(self.options | self.changes)) if part)

    @property
    def label(self) -> str:
        """Its name on screen."""
        return f"{self.series} λ={self.courant:.4g}"


def make_variants(
    scenes: Sequence[tuple[Scene, dict[str, Any]]],
    families: Sequence[str],
    courants: Sequence[float],
    sets: Sequence[sweeps.Sweep],
) -> list[Variant]:
    """Return every combination for every scene, and the baselines at the regional variants' base steps, uniform ones first."""
    found: list[Variant] = []
    for number, (scene, changes) in enumerate(scenes):
        here = []
        for family in families:
            for options in sweeps.for_stepper(sets, family):
                for courant in courants:
                    stepper = sweeps.make_stepper(family, courant, options)
                    equal = courant if sweeps.changes_by(family) else stepper.equal_step(scene)
                    here.append(Variant(number, family, courant, options, changes, stepper_data(stepper), equal))
        bases = [uniform_variant(v.scene, v.equal_step, changes, BASE_STEP) for v in here if v.family != "uniform"]
        known = {(v.courant) for v in here if v.family == "uniform" and not v.options}
        extra = {v.courant: v for v in bases if v.courant not in known}
        found += sorted([*extra.values(), *here], key=lambda v: v.family != "uniform")
    return found


def uniform_variant(scene: int, courant: float, changes: dict[str, Any], role: str) -> Variant:
    """Return a run with uniform steps at their defaults."""
    stepper = stepper_data(rts.Uniform(courant=courant))
    return Variant(scene, "uniform", courant, {}, changes, stepper, courant, role)


def smallest_step(variants: Sequence[Variant]) -> float:
    """Smallest Courant number of a uniform or base step among the variants."""
    return min(min(v.equal_step, v.courant) for v in variants)
