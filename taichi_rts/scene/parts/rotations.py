"""Rotations as scenes give them, and their matrices."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from annotated_types import Len
from pydantic import BeforeValidator, WithJsonSchema

from taichi_rts.scene.validation import Number


def _as_tuple(value: Any) -> Any:
    return (value,) if isinstance(value, (int, float)) and not isinstance(value, bool) else value


def number_or_list(least: int) -> WithJsonSchema:
    """Tell a JSON Schema that one number will do, or `least` to 3 of them."""
    numbers = {"type": "array", "items": {"type": "number"}, "minItems": least, "maxItems": 3}
    return WithJsonSchema({"anyOf": [{"type": "number"}, numbers]})


Turn = Annotated[tuple[Number, ...], Len(1, 3), BeforeValidator(_as_tuple), number_or_list(1)]
"""A rotation: in two dimensions one number, counter-clockwise; in three a vector along the axis, as long as the angle."""


def rotation_matrix(turn: Any) -> np.ndarray:
    """Matrix, (dim, dim), of a rotation [rad] given as one number (two dimensions) or as a vector along its axis (three)."""
    turn = np.asarray(turn, float)
    if len(turn) == 1:
        c, s = np.cos(turn[0]), np.sin(turn[0])
        return np.array([[c, -s], [s, c]])
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = turn / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
