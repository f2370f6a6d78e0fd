"""Polygons as obstacles."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Len
from pydantic import model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.obstacles.motion import Motion
from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.validation import FROZEN, Number, validated


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class PolygonObstacle(ObstacleShape):
    """A polygon in two dimensions.

    Attributes:
        points: its corners [m], (K, 2), in either direction; edges do not cross.
        motion: how it moves; None: not at all.
        shape: "polygon", as a scene file has it.

    Raises `SceneError`.
    """

    points: Annotated[tuple[Annotated[tuple[Number, ...], Len(2, 2)], ...], Len(3)]
    motion: Motion | None = None
    shape: Literal["polygon"] = "polygon"
    dim = 2
    places = ("points",)

    @model_validator(mode="after")
    def _check(self) -> PolygonObstacle:
        x, y = np.array(self.points).T
        area = 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
        if abs(area) <= 1e-12 * (np.ptp(x) + np.ptp(y)) ** 2 or len(set(self.points)) < len(self.points):
            raise ValueError(f"points {self.points} enclose no area or repeat; give each corner once")
        return self

    def solid(self, spacing: float, domain: Box | None) -> Solid:
        """Return a polygon in two dimensions."""
        a = np.array(self.points)
        b = np.roll(a, -1, axis=0)
        edge = b - a

        def distance(x: np.ndarray) -> np.ndarray:
            way = x[:, None] - a
            share = np.clip((way * edge).sum(axis=2) / (edge * edge).sum(axis=1), 0.0, 1.0)
            far = np.linalg.norm(way - share[:, :, None] * edge, axis=2).min(axis=1)
            spans = (a[:, 1] <= x[:, None, 1]) != (b[:, 1] <= x[:, None, 1])
            rise = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])
            crossing = a[:, 0] + (x[:, None, 1] - a[:, 1]) / rise * edge[:, 0] > x[:, None, 0]
            return np.where((spans & crossing).sum(axis=1) % 2 == 1, -far, far)

        def surface(step: float) -> np.ndarray:
            counts = np.maximum(1, np.ceil(np.linalg.norm(edge, axis=1) / step)).astype(int)
            return np.concatenate(
                [p + np.linspace(0, 1, n, endpoint=False)[:, None] * e for p, e, n in zip(a, edge, counts, strict=True)]
            )

        return Solid(distance, surface, a.min(axis=0), a.max(axis=0), float(np.ptp(a, axis=0).min()))
