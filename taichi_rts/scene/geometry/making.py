"""From an obstacle's description to its solid; the shapes are in `primitives.py`, meshes in `meshes.py`."""

from __future__ import annotations

import functools
import os
from typing import Any

from taichi_rts.scene.geometry.primitives import box_solid, cylinder_solid, polygon_solid, sphere_solid
from taichi_rts.scene.geometry.solid import Solid
from taichi_rts.scene.parts.obstacles import BoxObstacle, CylinderObstacle, MeshObstacle, SphereObstacle


def make_solid(obstacle: Any, spacing: float, domain: Any = None) -> Solid:
    """Return the geometry of an obstacle, for a scene of `spacing` [m] and `domain`, a `Box`.

    An upright box at rest that reaches a face of the domain is continued through it: nothing can get under it. Raises
    `SceneError` for a mesh that cannot be used.
    """
    stamp = os.path.getmtime(obstacle.file) if _is_file(obstacle) else 0.0
    return _make_solid(obstacle, spacing, domain, stamp)


def _is_file(obstacle: Any) -> bool:
    return isinstance(obstacle, MeshObstacle) and os.path.isfile(obstacle.file)


@functools.lru_cache(maxsize=64)
def _make_solid(obstacle: Any, spacing: float, domain: Any, stamp: float) -> Solid:
    if isinstance(obstacle, MeshObstacle):
        from taichi_rts.scene.geometry.meshes import mesh_solid  # only here, because it needs the extra `mesh`

        return mesh_solid(obstacle, spacing)
    if isinstance(obstacle, BoxObstacle):
        return box_solid(obstacle, spacing, domain)
    if isinstance(obstacle, SphereObstacle):
        return sphere_solid(obstacle)
    if isinstance(obstacle, CylinderObstacle):
        return cylinder_solid(obstacle)
    return polygon_solid(obstacle)
