"""The geometry of obstacles: signed distances, bounds and dense points of their surface. Pure NumPy; meshes: `meshes.py`."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_rts.obstacles import (
    BoxObstacle,
    CylinderObstacle,
    MeshObstacle,
    PolygonObstacle,
    SphereObstacle,
)
from taichi_rts.rotations import rotation_matrix

GRID_STEPS = 2  # nodes of a signed-distance grid per spacing
MOST_NODES = 2e7


@dataclass(frozen=True)
class Solid:
    """A closed body as it stands at time 0.

    Attributes:
        distance: signed distances [m], (N,), of points, (N, dim), negative inside.
        surface: dense points, (M, dim), on the surface, about as far apart as its argument [m].
        lower, upper: bounding box [m], (dim,).
        thickness: smallest extent [m].
        even: points, (M, dim), as far below the surface as its first argument [m] and as far apart as its second, where a
            shape has a formula for them; else `layers.line_solid` finds them.
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

    They are lowered by what linear interpolation exceeds 0 by on the surface, at sharp edges: whoever is outside by the
    grid is outside.
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
    pad = 2.0 * spacing
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
        from taichi_rts.meshes import mesh_solid  # only here, because it needs the extra `mesh`

        return mesh_solid(obstacle, spacing)
    if isinstance(obstacle, BoxObstacle):
        return _box(obstacle, spacing, domain)
    if isinstance(obstacle, SphereObstacle):
        return _sphere(obstacle)
    if isinstance(obstacle, CylinderObstacle):
        return _cylinder(obstacle)
    return _polygon(obstacle)


def grounded(obstacle: BoxObstacle, domain: Any, slack: float) -> tuple[np.ndarray, np.ndarray]:
    """Whether an upright box at rest reaches the domain's lower and upper faces, (dim,) booleans each."""
    fixed = domain is not None and obstacle.motion is None and not any(obstacle.rotation or ())
    lower, upper = np.array(obstacle.lower), np.array(obstacle.upper)
    if not fixed:
        return np.zeros(len(lower), bool), np.zeros(len(lower), bool)
    return lower <= np.array(domain.lower) + slack, upper >= np.array(domain.upper) - slack


def _box(obstacle: BoxObstacle, spacing: float, domain: Any) -> Solid:
    lower, upper = np.array(obstacle.lower), np.array(obstacle.upper)
    thickness = float((upper - lower).min())
    at_lower, at_upper = grounded(obstacle, domain, 1e-6 * spacing)
    if at_lower.any() or at_upper.any():  # by whole and a half spacings, so that its lattice continues the fluid's
        depth = 4.0 * spacing
        lower = np.where(at_lower, np.array(domain.lower) - depth, lower)
        upper = np.where(at_upper, np.array(domain.upper) + depth, upper)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    dim = len(middle)
    degrees = obstacle.rotation or (0.0,) * (1 if dim == 2 else 3)
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
            # who goes on beyond a face does so by 4 spacings, so these nodes lie half a spacing from the face inside
            first, last = -h + (0.5 * spacing if low else depth), h - (0.5 * spacing if high else depth)
            count = max(1, round((last - first) / step))
            axes.append(np.linspace(first, last, count + 1) if last > first else np.zeros(1))
        return middle + box_surface(axes, list(zip(~at_lower, ~at_upper, strict=True))) @ turn.T

    reach = np.abs(turn) @ half
    return Solid(distance, surface, middle - reach, middle + reach, thickness, even)


def box_surface(axes: list[np.ndarray], ends: list[tuple[bool, bool]] | None = None) -> np.ndarray:
    """Nodes of a lattice with these coordinates that lie on its faces, (N, dim); `ends` says which faces there are."""
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    outer = np.zeros(len(points), bool)
    for d, axis in enumerate(axes):
        first, last = ends[d] if ends else (True, True)
        outer |= ((points[:, d] == axis[0]) & first) | ((points[:, d] == axis[-1]) & last)
    return points[outer]


def _spiral(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the way, (count,), and angles [rad] of points that cover a disc or a sphere evenly (Vogel 1979)."""
    k = np.arange(count)
    return (k + 0.5) / count, np.pi * (3.0 - np.sqrt(5.0)) * k


def _sphere(obstacle: SphereObstacle) -> Solid:
    centre, radius = np.array(obstacle.centre), obstacle.radius

    def distance(x: np.ndarray) -> np.ndarray:
        return np.linalg.norm(x - centre, axis=1) - radius

    def surface(step: float) -> np.ndarray:
        if len(centre) == 2:
            angle = np.linspace(0.0, 2.0 * np.pi, max(8, int(np.ceil(2.0 * np.pi * radius / step))), endpoint=False)
            return centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        way, angle = _spiral(max(32, int(np.ceil(4.0 * np.pi * (radius / step) ** 2))))
        z = 1.0 - 2.0 * way
        flat = np.sqrt(1.0 - z * z)
        return centre + radius * np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)

    def even(depth: float, step: float) -> np.ndarray:
        return _sphere(SphereObstacle(obstacle.centre, max(radius - depth, 0.25 * radius))).surface(step)

    return Solid(distance, surface, centre - radius, centre + radius, 2.0 * radius, even)


def _cylinder(obstacle: CylinderObstacle) -> Solid:
    start, end, radius = np.array(obstacle.start), np.array(obstacle.end), obstacle.radius
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    side = np.eye(3)[int(np.argmin(np.abs(axis)))]
    one = np.cross(axis, side) / np.linalg.norm(np.cross(axis, side))
    two = np.cross(axis, one)
    middle = 0.5 * (start + end)

    def distance(x: np.ndarray) -> np.ndarray:
        along = (x - middle) @ axis
        across = np.linalg.norm(x - middle - along[:, None] * axis, axis=1)
        q = np.stack([across - radius, np.abs(along) - 0.5 * length], axis=1)
        return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)

    def ring(angle: np.ndarray) -> np.ndarray:
        return np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * two

    def surface(step: float) -> np.ndarray:
        return even(0.0, step)

    def even(depth: float, step: float) -> np.ndarray:
        outer, half = max(radius - depth, 0.25 * radius), max(0.5 * length - depth, 0.0)
        around = np.linspace(0.0, 2.0 * np.pi, max(6, round(2.0 * np.pi * outer / step)), endpoint=False)
        heights = np.linspace(-half, half, max(1, round(2.0 * half / step)) + 1) if half else np.zeros(1)
        wall = (heights[:, None, None] * axis + outer * ring(around)).reshape(-1, 3)
        inner = max(outer - 0.5 * step, 0.0)  # the wall's last rings are the caps' rims
        way, angle = _spiral(max(1, round(np.pi * (inner / step) ** 2)))
        cap = inner * np.sqrt(way)[:, None] * ring(angle)
        caps = [cap - half * axis, cap + half * axis] if half else [cap]
        return middle + np.concatenate([wall, *caps])

    reach = 0.5 * length * np.abs(axis) + radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0))
    return Solid(distance, surface, middle - reach, middle + reach, min(length, 2.0 * radius), even)


def _polygon(obstacle: PolygonObstacle) -> Solid:
    a = np.array(obstacle.points)
    b = np.roll(a, -1, axis=0)
    edge = b - a

    def distance(x: np.ndarray) -> np.ndarray:
        way = x[:, None] - a
        share = np.clip((way * edge).sum(axis=2) / (edge * edge).sum(axis=1), 0.0, 1.0)
        far = np.linalg.norm(way - share[:, :, None] * edge, axis=2).min(axis=1)
        spans = (a[:, 1] <= x[:, None, 1]) != (b[:, 1] <= x[:, None, 1])
        rise = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])
        crossing = a[:, 0] + (x[:, None, 1] - a[:, 1]) / rise * edge[:, 0] > x[:, None, 0]
        return np.where((spans & crossing).sum(axis=1) % 2 == 1, -far, far)

    def surface(step: float) -> np.ndarray:
        counts = np.maximum(1, np.ceil(np.linalg.norm(edge, axis=1) / step)).astype(int)
        return np.concatenate(
            [p + np.linspace(0, 1, n, endpoint=False)[:, None] * e for p, e, n in zip(a, edge, counts, strict=True)]
        )

    return Solid(distance, surface, a.min(axis=0), a.max(axis=0), float(np.ptp(a, axis=0).min()))
