"""Whether an obstacle leaves anything of a fluid."""

from __future__ import annotations

import numpy as np

from taichi_rts.scene.fluids.shape import FluidShape
from taichi_rts.scene.obstacles.solid import Solid


def is_drowned(fluid: FluidShape, solid: Solid, spacing: float) -> bool:
    """Whether a fluid lies wholly in a solid, or nearer to it than half of `spacing` [m]."""
    if (solid.lower - spacing > fluid.lower).any() or (solid.upper + spacing < fluid.upper).any():
        return False  # some of it lies outside
    axes = [
        np.linspace(a, b, max(1, int((b - a) / spacing)) * 2 + 1)[1::2]
        for a, b in zip(fluid.lower, fluid.upper, strict=True)
    ]
    found = False
    for x in axes[0]:  # a layer at a time bounds the memory, and most often the first decides
        points = np.stack(np.meshgrid([x], *axes[1:], indexing="ij"), axis=-1).reshape(-1, len(axes))
        points = points[fluid.contains(points)]
        if (solid.distance(points) >= 0.5 * spacing).any():
            return False
        found = found or len(points) > 0
    return found
