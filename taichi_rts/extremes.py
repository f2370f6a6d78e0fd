"""How far a run went from incompressible flow: the largest Mach number and density it had at any frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from taichi_rts.simulation import Simulation

DENSE = 1.03
"""Density over rest above which water counts as compressed: three times the 1 % that sound speeds aim at."""


class Extremes:
    """Looks at runs at their frames and keeps the largest local Mach number |v_i|/c_i and the largest density over rest."""

    def __init__(self, runs: Mapping[Any, Simulation]) -> None:
        self.runs = runs
        self.mach = dict.fromkeys(runs, 0.0)
        self.density = dict.fromkeys(runs, 0.0)
        self.dense = dict.fromkeys(runs, 0.0)

    def look(self) -> None:
        """Take note of the present states."""
        for key, sim in self.runs.items():
            _x, v, rho, _level = sim.state()
            mach = np.linalg.norm(v, axis=1) / sim.sound_speeds()
            ratio = rho / sim.medium.rest_density
            self.mach[key] = max(self.mach[key], float(mach.max(initial=0.0)))
            self.density[key] = max(self.density[key], float(ratio.max(initial=0.0)))
            self.dense[key] = max(self.dense[key], float((ratio > DENSE).sum()) / max(1, len(ratio)))

    def data(self) -> list[list[float]]:
        """Return what has been seen so far, run by run, for a checkpoint."""
        return [[self.mach[key], self.density[key], self.dense[key]] for key in self.runs]

    def take(self, data: Sequence[Sequence[float]]) -> None:
        """Go on from what `data` returned."""
        for key, values in zip(self.runs, data, strict=True):
            self.mach[key], self.density[key], self.dense[key] = values

    def facts(self, key: Any) -> list[tuple[str, str]]:
        """Return rows for the table of a run."""
        beyond = f"; {self.dense[key]:.2%} of the particles above {DENSE:.0%} at worst" if self.dense[key] else ""
        return [
            ("largest local Mach number", f"{self.mach[key]:.3f}"),
            ("largest density", f"{self.density[key]:.3f} of rest{beyond}"),
        ]
