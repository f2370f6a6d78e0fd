"""Cylinders as obstacles."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Len
from pydantic import model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.obstacles.motion import Motion
from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.solid import Solid, spiral
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.validation import FROZEN, Number, Positive, validated


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class CylinderObstacle(ObstacleShape):
    """A round cylinder, in three dimensions.

    Attributes:
        start, end: ends of its axis [m], (3,).
        radius: [m].
        motion: how it moves; None: not at all.
        shape: "cylinder", as a scene file has it.

    Raises `SceneError`.
    """

    start: Annotated[tuple[Number, ...], Len(3, 3)]
    end: Annotated[tuple[Number, ...], Len(3, 3)]
    radius: Positive
    motion: Motion | None = None
    shape: Literal["cylinder"] = "cylinder"
    dim = 3
    places = ("start", "end")

    @model_validator(mode="after")
    def _check(self) -> CylinderObstacle:
        if self.start == self.end:
            raise ValueError(f"start and end are both {self.start}; give the axis a length")
        return self

    def solid(self, spacing: float, domain: Box | None) -> Solid:
        """Return a cylinder with flat ends."""
        start, end, radius = np.array(self.start), np.array(self.end), self.radius
        length = float(np.linalg.norm(end - start))
        axis = (end - start) / length
        side = np.eye(3)[int(np.argmin(np.abs(axis)))]
        one = np.cross(axis, side) / np.linalg.norm(np.cross(axis, side))
        two = np.cross(axis, one)
        middle = 0.5 * (start + end)

        def distance(x: np.ndarray) -> np.ndarray:
            along = (x - middle) @ axis
            across = np.linalg.norm(x - middle - along[:, None] * axis, axis=1)
            q = np.stack([across - radius, np.abs(along) - 0.5 * length], axis=1)
            return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)

        def ring(angle: np.ndarray) -> np.ndarray:
            return np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * two

        def surface(step: float) -> np.ndarray:
            return even(0.0, step)

        def even(depth: float, step: float) -> np.ndarray:
            outer, half = max(radius - depth, 0.25 * radius), max(0.5 * length - depth, 0.0)
            around = np.linspace(0.0, 2.0 * np.pi, max(6, round(2.0 * np.pi * outer / step)), endpoint=False)
            heights = np.linspace(-half, half, max(1, round(2.0 * half / step)) + 1) if half else np.zeros(1)
            wall = (heights[:, None, None] * axis + outer * ring(around)).reshape(-1, 3)
            inner = max(outer - 0.5 * step, 0.0)  # the wall's last rings are the caps' rims
            way, angle = spiral(max(1, round(np.pi * (inner / step) ** 2)))
            cap = inner * np.sqrt(way)[:, None] * ring(angle)
            caps = [cap - half * axis, cap + half * axis] if half else [cap]
            return middle + np.concatenate([wall, *caps])

        reach = 0.5 * length * np.abs(axis) + radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0))
        return Solid(distance, surface, middle - reach, middle + reach, min(length, 2.0 * radius), even)
