"""Every field of a scene file, spoilt in every way that its type allows."""

import math
from dataclasses import dataclass
from typing import Any

from scenes import FLAT, MISSING, SOLID, Path, changed, paths, value_at

KINDS = ("missing", "wrong type", "NaN", "infinite", "negative", "zero", "huge", "tiny")
VALID = {
    "gravity": {"missing"},
    "gravity_changes": {"missing"},
    "gravity_interpolation": {"missing"},
    "body_force": {"missing"},
    "body_force.value": {"missing"},
    "body_force.origin": {"missing"},
    "density": {"missing"},
    "background_pressure": {"missing", "zero", "tiny"},
    "kernel": {"missing"},
    "support_ratio": {"missing"},
    "rest_density": {"missing"},
    "artificial_viscosity": {"missing", "zero", "tiny"},
    "kinematic_viscosity": {"missing", "zero", "tiny"},
    "hydrostatic": {"missing"},
    "walls": {"missing"},
    "periodic": {"missing"},
    "end_time": {"missing"},
    "name": {"missing"},
    "description": {"missing"},
    "fluids.0.velocity": {"missing"},
    "fluids.0.kinematic_viscosity": {"missing", "zero", "tiny"},
    "fluids.1.velocity": {"missing"},
    "moving_walls": {"missing"},
    "inflows": {"missing"},
    "inflows.0.start": {"missing", "zero", "tiny"},
    "inflows.0.stop": {"missing"},
    "probes": {"missing"},
    "probes.0.name": {"missing"},
    "gauges": {"missing"},
    "gauges.0.name": {"missing"},
    "obstacles": {"missing"},
    "obstacles.0.rotation": {"missing"},
    "obstacles.0.motion": {"missing"},
    "obstacles.0.motion.velocity": {"missing"},
    "obstacles.0.motion.angular_velocity": {"missing"},
    "obstacles.0.motion.pivot": {"missing"},
    "obstacles.0.motion.start": {"missing", "zero", "tiny"},
    "obstacles.0.motion.stop": {"missing"},
    "obstacles.1.motion": {"missing"},
    "obstacles.1.motion.displacements": {"missing"},
    "obstacles.1.motion.rotations": {"missing"},
    "obstacles.1.motion.pivot": {"missing"},
    "obstacles.3.rotation": {"missing"},
    "view": {"missing"},
    "view.azimuth": {"missing", "negative", "zero", "tiny"},
    "view.elevation": {"missing", "negative", "zero", "tiny"},
    "view.zoom": {"missing"},
    "obstacles.3.scale": {"missing"},
    "obstacles.3.translation": {"missing"},
    "2D: fluids.0.velocity": {"missing"},
    "2D: fluids.1.velocity": {"missing"},
    "2D: fluids.0.velocity.depth": {"missing"},
    "2D: fluids.0.velocity.origin": {"missing"},
    "2D: fluids.1.velocity.origin": {"missing"},
    "2D: sound_speed": {"missing"},
    "2D: sound_speed.mach": {"missing"},
    "2D: sound_speed.memory": {"missing"},
    "2D: sound_speed.floor": {"missing"},
    "2D: sound_speed.cap": {"missing"},
}
"""What is no mistake: fields that may be left out, and numbers that may be 0, next to it, or negative."""


@dataclass(frozen=True)
class FieldRow:
    """A field of a scene file and how it is spoilt, by kind: the scene and what has to be said, None where that is valid."""

    name: str
    scenes: dict[str, tuple[dict[str, Any], bool]]


def field_rows() -> list[FieldRow]:
    """Return a row for each field of `SOLID`, and of `FLAT` for what only two dimensions have."""
    rows = []
    wholes = [(SOLID, paths(SOLID)), (FLAT, [p for p in paths(FLAT) if p[0] in ("sound_speed",) or "velocity" in p])]
    wholes[1][1].extend(p for p in paths(FLAT) if p[0] == "obstacles" and len(p) > 2)
    for whole, found in wholes:
        for path in found:
            if len(path) > 1 and isinstance(path[-1], int) and isinstance(value_at(whole, path), dict):
                continue  # parts of a list, each of which may be left out
            name = ("" if whole is SOLID else "2D: ") + ".".join(map(str, path))
            rows.append(FieldRow(name, _spoilt(whole, path, VALID.get(name, set()))))
    return rows


def _spoilt(whole: dict[str, Any], path: Path, valid: set[str]) -> dict[str, tuple[dict[str, Any], bool]]:
    value = value_at(whole, path)
    values: dict[str, Any] = {"missing": MISSING, "wrong type": 7 if isinstance(value, str) else "many"}
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        values |= {"NaN": math.nan, "infinite": math.inf, "huge": 1e300}
        if isinstance(path[-1], str):  # a component of a vector may be any number
            values |= {"negative": -abs(value) or -1.0, "zero": 0.0, "tiny": 1e-300}
    return {kind: (changed(whole, path, each), kind in valid) for kind, each in values.items()}
