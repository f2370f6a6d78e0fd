"""Signed distances, bounds and surface points of boxes, spheres, cylinders and polygons."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_rts.scene.geometry.solid import Solid
from taichi_rts.scene.parts.obstacles import BoxObstacle, CylinderObstacle, PolygonObstacle, SphereObstacle
from taichi_rts.scene.parts.rotations import rotation_matrix


def grounded(obstacle: BoxObstacle, domain: Any, slack: float) -> tuple[np.ndarray, np.ndarray]:
    """Whether an upright box at rest reaches the domain's lower and upper faces, (dim,) booleans each."""
    fixed = domain is not None and obstacle.motion is None and not any(obstacle.rotation or ())
    lower, upper = np.array(obstacle.lower), np.array(obstacle.upper)
    if not fixed:
        return np.zeros(len(lower), bool), np.zeros(len(lower), bool)
    return lower <= np.array(domain.lower) + slack, upper >= np.array(domain.upper) - slack


def box_solid(obstacle: BoxObstacle, spacing: float, domain: Any) -> Solid:
    """Return a box for a scene of `spacing` [m] and `domain`, through whose faces it goes on (see `making.make_solid`)."""
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


def sphere_solid(obstacle: SphereObstacle) -> Solid:
    """Return a sphere, in two dimensions a disc."""
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
        return sphere_solid(SphereObstacle(obstacle.centre, max(radius - depth, 0.25 * radius))).surface(step)

    return Solid(distance, surface, centre - radius, centre + radius, 2.0 * radius, even)


def cylinder_solid(obstacle: CylinderObstacle) -> Solid:
    """Return a cylinder with flat ends."""
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


def polygon_solid(obstacle: PolygonObstacle) -> Solid:
    """Return a polygon in two dimensions."""
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
