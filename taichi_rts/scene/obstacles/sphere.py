"""Spheres and discs as obstacles."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.obstacles.motion import Motion
from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.solid import Solid, spiral
from taichi_rts.scene.parts.box import Box
from taichi_rts.scene.validation import FROZEN, Positive, Vector, validated


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class SphereObstacle(ObstacleShape):
    """A sphere, in two dimensions a disc.

    Attributes:
        centre: [m], (dim,).
        radius: [m].
        motion: how it moves; None: not at all.
        shape: "sphere", as a scene file has it.

    Raises `SceneError`.
    """

    centre: Vector
    radius: Positive
    motion: Motion | None = None
    shape: Literal["sphere"] = "sphere"
    places = ("centre",)

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return len(self.centre)

    def solid(self, spacing: float, domain: Box | None) -> Solid:
        """Return a sphere, in two dimensions a disc."""
        centre, radius = np.array(self.centre), self.radius

        def distance(x: np.ndarray) -> np.ndarray:
            return np.linalg.norm(x - centre, axis=1) - radius

        def surface(step: float) -> np.ndarray:
            if len(centre) == 2:
                angle = np.linspace(0.0, 2.0 * np.pi, max(8, int(np.ceil(2.0 * np.pi * radius / step))), endpoint=False)
                return centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            way, angle = spiral(max(32, int(np.ceil(4.0 * np.pi * (radius / step) ** 2))))
            z = 1.0 - 2.0 * way
            flat = np.sqrt(1.0 - z * z)
            return centre + radius * np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)

        def even(depth: float, step: float) -> np.ndarray:
            smaller = SphereObstacle(self.centre, max(radius - depth, 0.25 * radius))
            return smaller.solid(spacing, domain).surface(step)

        return Solid(distance, surface, centre - radius, centre + radius, 2.0 * radius, even)
