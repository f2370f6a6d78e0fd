"""Axis-aligned boxes."""

from __future__ import annotations

from typing import Any

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.validation import FROZEN, Vector, validated

CORNERS = ("lower", "upper")
"""Fields of a box that are coordinates."""


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class Box:
    """An axis-aligned box.

    Attributes:
        lower, upper: two opposite corners [m], (dim,).
    """

    lower: Vector
    upper: Vector
    places = CORNERS

    @model_validator(mode="after")
    def _check(self) -> Box:
        check_corners(self.lower, self.upper)
        return self

    @property
    def size(self) -> tuple[float, ...]:
        """Edge lengths [m], (dim,)."""
        return tuple(b - a for a, b in zip(self.lower, self.upper, strict=True))

    def reach(self, direction: Vector) -> float:
        """Largest value of direction.x over the box [m times the unit of `direction`, (dim,)]."""
        return box_reach(self.lower, self.upper, direction)


def box_reach(lower: Vector, upper: Vector, direction: Vector) -> float:
    """Largest value of direction.x over the box from `lower` to `upper` [m], which may be flat; `direction` is (dim,)."""
    return sum(max(d * a, d * b) for d, a, b in zip(direction, lower, upper, strict=True))


def corners(shape: Any) -> list[Vector]:
    """Corners [m], 2^dim of (dim,), of the bounding box from `shape.lower` to `shape.upper`."""
    found: list[Vector] = [()]
    for a, b in zip(shape.lower, shape.upper, strict=True):
        found = [(*corner, x) for corner in found for x in (a, b)]
    return found


def check_corners(lower: Vector, upper: Vector) -> None:
    """Raise `ValueError` unless the corners [m], (dim,) each, enclose a box."""
    if len(lower) != len(upper):
        raise ValueError(f"lower {lower} and upper {upper} differ in dimension; give both 2 or both 3 components")
    if not all(a < b for a, b in zip(lower, upper, strict=True)):
        raise ValueError(f"upper {upper} must exceed lower {lower} in every component")
