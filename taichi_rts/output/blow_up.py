"""Stops a run that has blown up, and saves the state before and after, and a diagnosis."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from taichi_rts.errors import OutputError, SimulationDivergedError
from taichi_rts.files.writing import write_json
from taichi_rts.output.export import ATTRIBUTES, capture, write_particles
from taichi_rts.particle_files.frame import ParticleFrame
from taichi_rts.readings.diagnosis import Diagnosis, diagnose
from taichi_rts.readings.reading import Readable, Reading

FOLDER = "blow_up"


class BlowUpGuard:
    """Looks at runs once a frame; costs one copy of their state on the host.

    The kernels count what is not finite or runs away as they go (`Motion.not_finite`, `Motion.runaways`), so nothing is read
    back in between. Of several runs that are shown side by side some may blow up, which is what a comparison may be about: only
    when none is whole any more is there nothing left to show.

    Attributes:
        found: the first diagnosis of each run that has blown up; later ones would only show the debris.
    """

    def __init__(self, runs: Mapping[Any, Readable], folder: Path) -> None:
        self.runs = runs
        self.folder = folder / FOLDER
        self.found: dict[Any, Diagnosis] = {}
        self._before: dict[Any, ParticleFrame] = {}

    def look(self) -> None:
        """Look at every run that was whole; raises `SimulationDivergedError` if none is any more."""
        for number, (key, run) in enumerate(self.runs.items()):
            if key in self.found:
                continue
            now = run.read()
            if (diagnosis := diagnose(now)) is None:
                self._before[key] = capture(now, tuple(ATTRIBUTES))
            else:
                self.found[key] = diagnosis
                self._dump(number, key, now)
        if len(self.found) == len(self.runs):
            self.stop()

    def stop(self) -> None:
        """Raise `SimulationDivergedError` with the first diagnosis."""
        first = min(self.found.values(), key=lambda each: each.time)
        raise SimulationDivergedError(f"blown up: {first} The state before and after is in {self.folder}")

    def _dump(self, number: int, key: Any, now: Reading) -> None:
        """Write the state at the last whole frame, if there was one, the present one, and the diagnosis."""
        end = "" if number == 0 else f"_{number + 1}"
        try:
            if key in self._before:
                write_particles(self.folder / f"before{end}.vtu", self._before[key])
            write_particles(self.folder / f"after{end}.vtu", capture(now, tuple(ATTRIBUTES)))
            write_json(self.folder / f"diagnosis{end}.json", plain(self.found[key]))
        except OutputError:  # the diagnosis is more important than the full disk
            self.folder = self.folder.with_name(f"{FOLDER} (which could not be written)")


def plain(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a diagnosis as JSON has it: what is not finite is a text."""

    def number(value: Any) -> Any:
        if isinstance(value, (tuple, list)):
            return [number(each) for each in value]
        return str(value) if isinstance(value, float) and not math.isfinite(value) else value

    return {key: number(value) for key, value in dataclasses.asdict(diagnosis).items()}
