"""All shapes of obstacles: a new one is a file beside this one and a place in `OBSTACLE_SHAPES`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from taichi_rts.scene.obstacles.box import BoxObstacle
from taichi_rts.scene.obstacles.cylinder import CylinderObstacle
from taichi_rts.scene.obstacles.mesh import MeshObstacle
from taichi_rts.scene.obstacles.polygon import PolygonObstacle
from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.sphere import SphereObstacle
from taichi_rts.scene.schema import one_of

OBSTACLE_SHAPES: tuple[type[ObstacleShape], ...] = (
    BoxObstacle,
    SphereObstacle,
    CylinderObstacle,
    PolygonObstacle,
    MeshObstacle,
)
BY_NAME = {kind.shape: kind for kind in OBSTACLE_SHAPES}


def _kind(data: Any) -> type | None:
    shape = data.get("shape") if isinstance(data, dict) else getattr(data, "shape", None)
    return BY_NAME.get(shape) if isinstance(shape, str) else None


if TYPE_CHECKING:
    Obstacle = ObstacleShape
else:
    Obstacle = one_of(
        OBSTACLE_SHAPES,
        _kind,
        custom_error_type="unknown_shape",
        custom_error_message=f"shape is missing or unknown; choose one of {', '.join(BY_NAME)}",
    )
"""A body of any shape; a scene file names it by `shape`."""
