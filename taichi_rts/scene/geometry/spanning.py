"""Boxes that span a periodic axis: they have no ends there, and slide along themselves."""

from __future__ import annotations

import dataclasses

import numpy as np

from taichi_rts.scene.fields import SceneFields
from taichi_rts.scene.obstacles.box import BoxObstacle
from taichi_rts.scene.obstacles.making import make_solid
from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.solid import Solid

BEYOND = 4.0  # spacings that such a box goes on for beyond the domain


def spans(scene: SceneFields, obstacle: ObstacleShape) -> np.ndarray:
    """Along which axes, (dim,) booleans, an upright box that moves and does not turn reaches from end to end of the domain."""
    found = np.array(scene.is_periodic)
    motion = obstacle.motion
    if (
        not isinstance(obstacle, BoxObstacle)
        or motion is None
        or obstacle.dim != scene.dim
        or any(obstacle.rotation or ())
    ):
        return np.zeros_like(found)
    if not found.any() or motion.pieces(scene.dim).spins.any():
        return np.zeros_like(found)
    slack = 1e-6 * scene.spacing
    low, high = np.array(scene.domain.lower) + slack, np.array(scene.domain.upper) - slack
    return found & (np.array(obstacle.lower) <= low) & (np.array(obstacle.upper) >= high)


def scene_solid(scene: SceneFields, obstacle: ObstacleShape, beyond: float | None = None) -> Solid:
    """Return the geometry of an obstacle of `scene`.

    Where it spans a periodic axis it goes on for `beyond` [m] beyond the domain, by default 4 spacings, whatever length it was
    given: its ends count for nothing. Raises `SceneError` for a mesh that cannot be used.
    """
    mask = spans(scene, obstacle)
    if mask.any() and isinstance(obstacle, BoxObstacle):
        more = BEYOND * scene.spacing if beyond is None else beyond
        low, high = np.array(scene.domain.lower) - more, np.array(scene.domain.upper) + more
        obstacle = dataclasses.replace(
            obstacle,
            lower=tuple(np.where(mask, low, obstacle.lower).tolist()),
            upper=tuple(np.where(mask, high, obstacle.upper).tolist()),
        )
    return make_solid(obstacle, scene.spacing, scene.domain)
