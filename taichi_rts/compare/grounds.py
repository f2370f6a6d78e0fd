"""What all runs on one scene are compared with."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from taichi_rts.compare.measures import Yardstick, front_position, judge
from taichi_rts.compare.trajectory import Trajectory
from taichi_rts.scene.scene import Scene


@dataclasses.dataclass
class Ground:
    """A scene that is compared on: its references, the samples before they part, and the scales of errors."""

    scene: Scene
    changes: dict[str, Any]
    keys: tuple[str, str]
    reference: Trajectory
    coarser: Trajectory
    together: int
    scale: Yardstick
    courant: float
    cached: bool
    threshold: float

    @property
    def largest_density(self) -> float:
        """Largest density of the reference at any sample, over rest."""
        return max(float(rho.max()) for rho in self.reference.densities) / self.scene.rest_density

    def facts(self) -> dict[str, Any]:
        """Return what the report says about it."""
        times = self.reference.times
        return {
            "scene": self.scene.to_dict(),
            "changes": self.changes,
            "particles": len(self.reference.positions[-1]),
            "reference_courant": self.courant,
            "reference_keys": list(self.keys),
            "reference_cached": self.cached,
            "parting_threshold": self.threshold,
            "parting_time": times[self.together],
            "parted": self.together < len(times) - 1,
            "floor": finite(judge(self.coarser, self.reference, self.scale, self.together)),
            "probes": self.scale.probes.tolist(),
        }


def finite(errors: dict[str, float | None]) -> dict[str, float | None]:
    """Return errors with None for those that are no number, which JSON cannot hold."""
    return {name: error if error is not None and math.isfinite(error) else None for name, error in errors.items()}


def curves(run: Trajectory) -> dict[str, list[float]]:
    """Return what can be drawn over time: times [s], kinetic and potential energy [J], front [m]."""
    return {
        "times": list(run.times),
        "kinetic_energy": [row[0] for row in run.energies],
        "potential_energy": [row[1] for row in run.energies],
        "front": [front_position(run, k) for k in range(len(run.times))],
    }
