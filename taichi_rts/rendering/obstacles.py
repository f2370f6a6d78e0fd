"""Obstacles in pictures: their surface as spheres of the particles' size, just below it."""

from __future__ import annotations

import numpy as np

from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.obstacles.making import make_solid
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.scene import Scene

COLOUR = (0.55, 0.54, 0.52)  # sRGB, of none of the palettes
OVERLAP = 1.1  # radii between spheres


class ObstaclePoints:
    """Points, (M, dim), that show the obstacles of a scene with spheres of `radius` [m]."""

    def __init__(self, scene: Scene, radius: float) -> None:
        self.moving = {body.number: body for body in bodies(scene)}
        self.points = []
        self.low = scene.domain.lower
        for k, obstacle in enumerate(scene.obstacles):
            points = _spheres(make_solid(obstacle, scene.spacing), radius)
            if k not in self.moving:
                low, high = np.array(scene.domain.lower) - radius, np.array(scene.domain.upper) + radius
                points = points[((points >= low) & (points <= high)).all(axis=1)]
            self.points.append(points)

    def add(self, x: np.ndarray, tints: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Positions `x` [m], (N, dim), and colours, (N, 3), of the fluid, with the obstacles' at `time` [s] behind them."""
        if not self.points:
            return x, tints
        placed = [self.carry(k, points, time) if k in self.moving else points for k, points in enumerate(self.points)]
        solid = np.concatenate(placed)
        return np.concatenate([x, solid]), np.concatenate([tints, np.tile(COLOUR, (len(solid), 1))])

    def carry(self, k: int, points: np.ndarray, time: float) -> np.ndarray:
        """Return where moving obstacle `k` has its `points` [m], (M, dim), at `time` [s]: along periodic axes in the domain."""
        x = self.moving[k].place(points, time)
        for d, length in enumerate(self.moving[k].periods):
            if length:
                x[:, d] -= length * np.floor((x[:, d] - self.low[d]) / length)
        return x


def _spheres(solid: Solid, radius: float) -> np.ndarray:
    """Points [m], (M, dim), a radius below the surface of a solid, in two dimensions also what it encloses."""
    points = solid.surface(OVERLAP * radius)
    points = points - radius * solid.normals(points, 0.2 * radius)
    points = points[solid.distance(points) < -0.6 * radius]  # at sharp edges others stand already
    if points.shape[1] == 3:
        return points
    axes = [np.arange(a, b, OVERLAP * radius) for a, b in zip(solid.lower, solid.upper, strict=True)]
    inner = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.concatenate([points, inner[solid.distance(inner) < -radius]])
