"""Boxes as obstacles."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import model_validator
from pydantic.dataclasses import dataclass

from taichi_rts.errors import SceneError
from taichi_rts.scene.obstacles.motion import Motion
from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.parts.box import CORNERS, Box
from taichi_rts.scene.parts.rotations import Turn, rotation_matrix
from taichi_rts.scene.validation import FROZEN, Vector, validated


@validated(SceneError)
@dataclass(frozen=True, config=FROZEN)
class BoxObstacle(ObstacleShape):
    """A box between two corners.

    Attributes:
        lower, upper: the corners [m], (dim,).
        rotation: [degrees] about its middle: one number in two dimensions, counter-clockwise, in three a vector along the axis.
        motion: how it moves; None: not at all.
        shape: "box", as a scene file has it.

    Raises `SceneError`.
    """

    lower: Vector
    upper: Vector
    rotation: Turn | None = None
    motion: Motion | None = None
    shape: Literal["box"] = "box"
    places = CORNERS
    reaches_domain = True

    @model_validator(mode="after")
    def _check(self) -> BoxObstacle:
        Box(self.lower, self.upper)
        return self

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return len(self.lower)

    def solid(self, spacing: float, domain: Box | None) -> Solid:
        """Return a box, continued through the faces of `domain` that it reaches upright and at rest: nothing gets under it."""
        lower, upper = np.array(self.lower), np.array(self.upper)
        thickness = float((upper - lower).min())
        at_lower, at_upper = self._grounded(domain, 1e-6 * spacing)
        if (
            domain is not None and (at_lower | at_upper).any()
        ):  # by whole and a half spacings, so that its lattice continues the fluid's
            depth = 4.0 * spacing
            lower = np.where(at_lower, np.array(domain.lower) - depth, lower)
            upper = np.where(at_upper, np.array(domain.upper) + depth, upper)
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        dim = len(middle)
        degrees = self.rotation or (0.0,) * (1 if dim == 2 else 3)
        turn = rotation_matrix(np.radians(degrees))

        def distance(x: np.ndarray) -> np.ndarray:
            q = np.abs((x - middle) @ turn) - half
            return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)

        def surface(step: float) -> np.ndarray:
            axes = [np.linspace(-h, h, max(2, int(np.ceil(2.0 * h / step)) + 1)) for h in half]
            return middle + box_surface(axes) @ turn.T

        def even(depth: float, step: float) -> np.ndarray:
            axes = []
            for h, low, high in zip(half, at_lower, at_upper, strict=True):
                # beyond a face the box goes on by 4 spacings, so these nodes lie half a spacing from the face inside
                first, last = -h + (0.5 * spacing if low else depth), h - (0.5 * spacing if high else depth)
                count = max(1, round((last - first) / step))
                axes.append(np.linspace(first, last, count + 1) if last > first else np.zeros(1))
            return middle + box_surface(axes, list(zip(~at_lower, ~at_upper, strict=True))) @ turn.T

        reach = np.abs(turn) @ half
        return Solid(distance, surface, middle - reach, middle + reach, thickness, even)

    def _grounded(self, domain: Box | None, slack: float) -> tuple[np.ndarray, np.ndarray]:
        """Whether an upright box at rest reaches the domain's lower and upper faces, (dim,) booleans each."""
        lower, upper = np.array(self.lower), np.array(self.upper)
        if domain is None or self.motion is not None or any(self.rotation or ()):
            return np.zeros(len(lower), bool), np.zeros(len(lower), bool)
        return lower <= np.array(domain.lower) + slack, upper >= np.array(domain.upper) - slack


def box_surface(axes: list[np.ndarray], ends: list[tuple[bool, bool]] | None = None) -> np.ndarray:
    """Nodes of a lattice with these coordinates that lie on its faces, (N, dim); `ends` says which faces there are."""
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    outer = np.zeros(len(points), bool)
    for d, axis in enumerate(axes):
        first, last = ends[d] if ends else (True, True)
        outer |= ((points[:, d] == axis[0]) & first) | ((points[:, d] == axis[-1]) & last)
    return points[outer]
