"""Obstacles that move: where they are at a time, how far they reach and how fast they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taichi_rts.scene.fields import SceneFields
from taichi_rts.scene.geometry.spanning import scene_solid, spans
from taichi_rts.scene.obstacles.motion import Pieces
from taichi_rts.scene.obstacles.solid import Solid


@dataclass(frozen=True)
class Body:
    """A moving obstacle, number `number` of its scene, with its geometry at time 0 and its motion.

    `pivot` [m], (dim,), is where the pivot is before it moves, `radius` [m] how far the body reaches from there; `periods` [m],
    (dim,), are the domain's lengths along periodic axes, 0 along others; `spans`, (dim,), flags those that it goes all the way
    round: there its pivot is in the domain's middle.
    """

    number: int
    solid: Solid
    pieces: Pieces
    pivot: np.ndarray
    radius: float
    periods: tuple[float, ...]
    spans: tuple[bool, ...]

    @property
    def speeds(self) -> np.ndarray:
        """Largest speed [m/s] of any of its points, (P,), in each piece of its motion."""
        straight, spin = self.pieces.velocities, self.pieces.spins
        return np.linalg.norm(straight, axis=1) + np.linalg.norm(spin, axis=1) * self.radius

    @property
    def top_speed(self) -> float:
        """Largest speed [m/s] of any of its points at any time."""
        return float(self.speeds.max())

    def place(self, x: np.ndarray, time: float) -> np.ndarray:
        """Where points `x` [m], (N, dim), of the body at time 0 are at `time` [s]."""
        shift, turn = self.pieces.pose(time)
        return self.pivot + shift + (x - self.pivot) @ turn.T

    def displace(self, x: np.ndarray, time: float) -> np.ndarray:
        """Where points [m], (N, dim), that the body carries to `x` at `time` [s] were at time 0."""
        shift, turn = self.pieces.pose(time)
        return self.pivot + (x - self.pivot - shift) @ turn


def bodies(scene: SceneFields) -> list[Body]:
    """List the moving obstacles of a scene."""
    found = []
    periods = tuple(size if around else 0.0 for size, around in zip(scene.domain.size, scene.is_periodic, strict=True))
    for number, obstacle in enumerate(scene.obstacles):
        if obstacle.motion is None:
            continue
        solid = scene_solid(scene, obstacle)
        pivot = solid.middle if obstacle.motion.pivot is None else np.array(obstacle.motion.pivot)
        around = spans(scene, obstacle)
        pivot = np.where(around, solid.middle, pivot)
        corners = np.stack([solid.lower - pivot, solid.upper - pivot])
        radius = float(np.linalg.norm(np.abs(corners).max(axis=0)))
        found.append(
            Body(number, solid, obstacle.motion.pieces(scene.dim), pivot, radius, periods, tuple(around.tolist()))
        )
    return found
