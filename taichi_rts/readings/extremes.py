"""How far a run went from incompressible flow: the largest Mach number and density it had at any frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from taichi_rts.medium.medium import Medium
from taichi_rts.readings.reading import Readable

DENSE = 1.03
"""Density over rest above which water counts as compressed: three times the 1 % that sound speeds aim at."""

MOST_MACH = 0.3
"""Local Mach number M from which flow is no longer weakly compressible: pressure changes the density by M^2/2, 4.5 %."""
MOST_DENSE = 0.25
"""Share of particles above `DENSE` that says the same; a splash presses a few together for a moment."""


class Run(Readable, Protocol):
    """What is looked at: a `Simulation`, or what stands in for it."""

    medium: Medium
    sound: Any


class Extremes:
    """Looks at runs at their frames and keeps the largest local Mach number |v_i|/c_i and the largest density over rest."""

    def __init__(self, runs: Mapping[Any, Run]) -> None:
        self.runs = runs
        self.mach = dict.fromkeys(runs, 0.0)
        self.density = dict.fromkeys(runs, 0.0)
        self.dense = dict.fromkeys(runs, 0.0)

    def look(self) -> None:
        """Take note of the present states."""
        for key, run in self.runs.items():
            now = run.read()
            ratio = now.density_ratios
            self.mach[key] = max(self.mach[key], now.max_mach)
            self.density[key] = max(self.density[key], float(ratio.max(initial=0.0)))
            self.dense[key] = max(self.dense[key], float((ratio > DENSE).sum()) / max(1, len(ratio)))

    def data(self) -> list[list[float]]:
        """Return what has been seen so far, run by run, for a checkpoint."""
        return [[self.mach[key], self.density[key], self.dense[key]] for key in self.runs]

    def take(self, data: Sequence[Sequence[float]]) -> None:
        """Go on from what `data` returned."""
        for key, values in zip(self.runs, data, strict=True):
            self.mach[key], self.density[key], self.dense[key] = values

    def is_weakly_compressible(self, key: Any) -> bool:
        """Whether the run stayed within `MOST_MACH` and `MOST_DENSE`."""
        return self.mach[key] <= MOST_MACH and self.dense[key] <= MOST_DENSE

    def facts(self, key: Any) -> list[tuple[str, str]]:
        """Return rows for the table of a run; red, with the remedy, is what weakly compressible flow does not have."""
        beyond = f"; {self.dense[key]:.2%} of the particles above {DENSE:.0%} at worst" if self.dense[key] else ""
        mach, density = f"{self.mach[key]:.3f}", f"{self.density[key]:.3f} of rest{beyond}"
        if self.mach[key] > MOST_MACH:
            mach = f"[bold red]{mach}[/], above {MOST_MACH:g}: too fast for the sound speed; {self._remedy(key)}"
        if self.dense[key] > MOST_DENSE:
            density = f"[bold red]{density}[/]: too much compressed; {self._remedy(key)}"
        return [("largest local Mach number", mach), ("largest density", density)]

    def _remedy(self, key: Any) -> str:
        run = self.runs[key]
        if run.sound is not None:
            return "give --sound-speed a number, ten times the largest speed"
        c = run.medium.sound_speed
        wanted = c * max(2.0, 10.0 * self.mach[key])
        return f"use --sound-speed {wanted:.2g} (now {c:.3g} m/s), ten times the largest speed"
