"""What all shapes of obstacles have in common."""

from __future__ import annotations

from typing import ClassVar

from taichi_rts.scene.obstacles.motion import ConstantMotion, Keyframes
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.parts.box import Box


class ObstacleShape:
    """A shape of obstacle. Each one has a file of its own and a place in the list `shapes.OBSTACLE_SHAPES`.

    Attributes:
        shape: what a scene file calls it.
        motion: how it moves; None: not at all.
        places: those of its fields that are coordinates (see `placing.translated`).
        reaches_domain: whether its solid depends on the domain.
    """

    shape: str
    motion: ConstantMotion | Keyframes | None
    places: ClassVar[tuple[str, ...]]
    reaches_domain: ClassVar[bool] = False

    @property
    def dim(self) -> int:
        """Number of space dimensions, 2 or 3."""
        raise NotImplementedError

    def solid(self, spacing: float, domain: Box | None) -> Solid:
        """Return its geometry at time 0 for a scene of `spacing` [m], and in `domain` if it `reaches_domain`.

        Raises `SceneError` for what cannot be used. Called by `making.make_solid` alone, which keeps what it returns.
        """
        raise NotImplementedError
