"""Fluids of a SPlisHSPlasH scene: the same particles in the same places, as blocks, particle files and inflows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from taichi_rts.scene.files.splishsplash_format import ZERO, Configuration, Emitter, FluidBlock, Material, turn_of
from taichi_rts.scene.parts.rotations import rotation_matrix

NEAR_WALL = 4.0
"""An emitter may stand so many spacings in front of the wall behind it to be an inflow on it."""
VISCOSITY_GROUPS = {1: "Standard viscosity", 6: "Weiler et al. 2018"}
"""Methods whose coefficient is a kinematic viscosity [m^2/s], with where their parameters stand."""
OLD_WEILER = 7  # before version 2.9, which wrote the coefficient into the material itself
ALIGNED = 1e-4


def block(part: FluidBlock, spacing: float, dim: int) -> dict[str, Any] | None:
    """Plain data of a fluid block, None if it holds nothing.

    SPlisHSPlasH puts round(L/d) - 1 particles along an edge L, the first one diameter d from its lower end
    (`SimulatorBase::createFluidBlocks`, dense mode 0), and nothing if that is only one. Ours fill whole cells, so the cells
    begin half a diameter before.
    """
    scale, move = np.asarray(part.scale), np.asarray(part.translation)
    low, high = scale * part.start + move, scale * part.end + move
    counts = [round_half_up(float(b - a) / spacing) - 1 for a, b in zip(low, high, strict=True)]
    if min(counts) <= 1:
        return None
    first = low[:dim] + 0.5 * spacing
    last = first + spacing * np.array(counts[:dim])
    return {"lower": first.tolist(), "upper": last.tolist()} | motion(part, 0.5 * (first + last))


def round_half_up(value: float) -> int:
    """Nearest whole number as C's `round` has it; Python's takes the even one in the middle."""
    return math.floor(value + 0.5)


def motion(part: Any, centre: np.ndarray) -> dict[str, Any]:
    """Velocity of a fluid at the start, turning about its `centre` [m], (dim,), if it turns."""
    dim = len(centre)
    spin, velocity = part.initial_angular_velocity, part.initial_velocity[:dim]
    if any(spin):
        x, y, z = spin
        gradient = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])[:dim, :dim]
        return {"velocity": {"gradient": gradient.tolist(), "value": list(velocity), "origin": centre.tolist()}}
    return {"velocity": list(velocity)} if any(velocity) else {}


def clip(
    data: dict[str, Any], lower: np.ndarray, upper: np.ndarray, spacing: float
) -> tuple[dict[str, Any] | None, bool]:
    """Leave out of a block what lies outside the domain from `lower` to `upper` [m], by whole layers.

    Return what stays, None for nothing, and whether that is less.
    """
    low, high = np.array(data["lower"]), np.array(data["upper"])
    layers = [np.ceil(np.maximum(beyond, 0.0) / spacing - 1e-6) for beyond in (lower - low, high - upper)]
    low, high = low + spacing * layers[0], high - spacing * layers[1]
    if (high - low < spacing * (1.0 - 1e-6)).any():
        return None, True
    low, high = np.maximum(low, lower), np.minimum(high, upper)  # where rounding left it outside
    return data | {"lower": low.tolist(), "upper": high.tolist()}, bool(np.any(layers))


def viscosity(material: Material, configuration: Configuration) -> tuple[float | None, str]:
    """Kinematic viscosity [m^2/s] of a material, None for none, and the name of its method if that is another."""
    method = material.viscosity_method
    group = (material.model_extra or {}).get(VISCOSITY_GROUPS.get(method, ""), {})
    plain = material.viscosity if material.viscosity is not None else configuration.viscosity
    found = group.get("viscosity", plain) if isinstance(group, dict) else plain
    if method == 0:
        return None, ""
    if method in VISCOSITY_GROUPS or (method == OLD_WEILER and plain is not None):
        right = isinstance(found, (int, float)) and not isinstance(found, bool) and 0.0 <= found < math.inf
        return (
            (float(found), "") if found is not None and right else (None, "" if found is None else f"value {found!r}")
        )
    return None, f"viscosityMethod {method}"


def inflow(
    part: Emitter, lower: np.ndarray, upper: np.ndarray, spacing: float, end: float
) -> tuple[dict[str, Any] | None, str]:
    """Plain data of the inflow that an emitter is, in a domain from `lower` to `upper` [m], (dim,), and what is changed.

    None, and why, if it cannot be one: it has to look along an axis, away from a wall close behind it.
    """
    dim = len(lower)
    turn = turn_of(part, dim)
    axes = rotation_matrix(np.radians(turn)) if turn else np.eye(dim)
    direction, position = axes[:, 0], np.array(part.translation[:dim])
    axis = int(np.argmax(np.abs(direction)))
    if abs(abs(direction[axis]) - 1.0) > ALIGNED:
        return None, "looks along no axis"
    forward = direction[axis] > 0.0
    face = float(lower[axis] if forward else upper[axis])
    distance = abs(position[axis] - face)
    if distance > NEAR_WALL * spacing * (1 + 1e-6):
        return None, f"stands {distance:.3g} m from the wall behind it"
    sides = [part.height, part.width] if part.type == 0 else [part.width, part.width]
    if part.type == 1 and dim == 3:
        sides = [0.5 * math.sqrt(math.pi) * part.width] * 2  # a square of the disc's area
    half = 0.5 * spacing * sum(side * np.abs(axes[:, k + 1]) for k, side in enumerate(sides[: dim - 1]))
    low, high = np.maximum(position - half, lower), np.minimum(position + half, upper)
    low[axis] = high[axis] = face
    stop = {} if part.emit_end_time is None or part.emit_end_time > end else {"stop": part.emit_end_time}
    if part.emit_start_time >= min(end, part.emit_end_time or end):
        return None, f"starts at {part.emit_start_time:g} s, after the end"
    velocity = part.velocity * np.round(direction)
    data = {"lower": low.tolist(), "upper": high.tolist(), "velocity": velocity.tolist(), "start": part.emit_start_time}
    changes = [f"moved {distance:.3g} m back onto the wall"] if distance > 0.0 else []
    changes += ["made square"] if part.type == 1 and dim == 3 else []
    return data | stop, ", ".join(changes)


def at_rest(part: Any) -> bool:
    """Whether a fluid does not move at the start."""
    return part.initial_velocity == ZERO and part.initial_angular_velocity == ZERO
