"""From an obstacle's description to its solid, which is made once for each description."""

from __future__ import annotations

import functools

from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.parts.box import Box

MOST_KEPT = 64
"""Solids that are kept: the tables of meshes' distances take memory. Those of other shapes are soon made again."""


def make_solid(obstacle: ObstacleShape, spacing: float, domain: Box | None = None) -> Solid:
    """Return the geometry of an obstacle, for a scene of `spacing` [m] and `domain`.

    An upright box at rest that reaches a face of the domain is continued through it: nothing can get under it. A mesh is read
    once for each description, which knows it by its content, so that a file that is edited meanwhile changes nothing. Raises
    `SceneError` for a mesh that cannot be used.
    """
    return _make_solid(obstacle, spacing, domain if obstacle.reaches_domain else None)


@functools.lru_cache(maxsize=MOST_KEPT)
def _make_solid(obstacle: ObstacleShape, spacing: float, domain: Box | None) -> Solid:
    return obstacle.solid(spacing, domain)
