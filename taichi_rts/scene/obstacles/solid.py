"""A solid as its signed distance, bounds and surface points, and the grid that tabulates the distance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

GRID_STEPS = 2  # nodes of a signed-distance grid per spacing
MOST_NODES = 2e7
PAD = 2.0
"""How far [spacings] a signed-distance grid reaches beyond its body."""


@dataclass(frozen=True)
class Solid:
    """A closed body as it stands at time 0.

    Attributes:
        distance: signed distances [m], (N,), of points, (N, dim), negative inside.
        surface: dense points, (M, dim), on the surface, about as far apart as its argument [m].
        lower, upper: bounding box [m], (dim,).
        thickness: smallest extent [m].
        even: points, (M, dim), as far below the surface as its first argument [m] and as far apart as its second, where a
            shape has a formula for them; else `sampling/lining.line_solid` finds them.
    """

    distance: Callable[[np.ndarray], np.ndarray]
    surface: Callable[[float], np.ndarray]
    lower: np.ndarray
    upper: np.ndarray
    thickness: float
    even: Callable[[float, float], np.ndarray] | None = None

    @property
    def middle(self) -> np.ndarray:
        """Middle of the bounding box [m], (dim,)."""
        return 0.5 * (self.lower + self.upper)

    def normals(self, x: np.ndarray, step: float) -> np.ndarray:
        """Unit gradients of the distance, (N, dim), by differences over `step` [m]."""
        offsets = 0.5 * step * np.eye(x.shape[1])
        slope = np.stack([self.distance(x + e) - self.distance(x - e) for e in offsets], axis=1)
        return slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)


@dataclass(frozen=True)
class DistanceGrid:
    """Signed distances [m] at nodes `origin` + index * `step` [m]; in between they are interpolated linearly.

    They are lowered by the largest value that interpolation has on the surface, at sharp edges: the table slightly
    underestimates distances, so a point that it reports as outside really is outside.
    """

    values: np.ndarray
    origin: np.ndarray
    step: float

    def at(self, x: np.ndarray) -> np.ndarray:
        """Interpolated distances [m], (N,), of points, (N, dim); beyond the grid those of its border."""
        shape = np.array(self.values.shape)
        place = np.clip((x - self.origin) / self.step, 0.0, shape - 1.000001)
        base = np.floor(place).astype(int)
        share = place - base
        total = np.zeros(len(x))
        for corner in np.ndindex(*[2] * x.shape[1]):
            weight = np.where(corner, share, 1.0 - share).prod(axis=1)
            total += weight * self.values[tuple((base + corner).T)]
        return total


def grid_nodes(lower: np.ndarray, upper: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Origin [m], number of nodes, (dim,), and step [m] of a grid around a body, coarser for very large ones."""
    pad = PAD * spacing
    volume = float(np.prod(upper - lower + 2.0 * pad))
    step = max(spacing / GRID_STEPS, (volume / MOST_NODES) ** (1.0 / len(lower)))
    return lower - pad, np.ceil((upper - lower + 2.0 * pad) / step).astype(int) + 1, step


def distance_grid(solid: Solid, spacing: float) -> DistanceGrid:
    """Tabulate a solid's distance for a scene of `spacing` [m]."""
    origin, shape, step = grid_nodes(solid.lower, solid.upper, spacing)
    axes = [o + step * np.arange(n) for o, n in zip(origin, shape, strict=True)]
    rows = []
    for x in axes[0]:  # a slice at a time bounds the memory
        nodes = np.stack(np.meshgrid([x], *axes[1:], indexing="ij"), axis=-1).reshape(-1, len(axes))
        rows.append(solid.distance(nodes))
    grid = DistanceGrid(np.concatenate(rows).reshape(shape), origin, step)
    excess = max(float(grid.at(solid.surface(0.5 * step)).max()), 0.0)
    return DistanceGrid(grid.values - excess - 1e-3 * spacing, origin, step)


def spiral(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the way, (count,), and angles [rad] of points that cover a disc or a sphere evenly (Vogel 1979)."""
    k = np.arange(count)
    return (k + 0.5) / count, np.pi * (3.0 - np.sqrt(5.0)) * k
