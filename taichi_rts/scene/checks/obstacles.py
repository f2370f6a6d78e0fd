"""What can be wrong with a scene's obstacles: every finding is one line with value, limit and remedy."""

from __future__ import annotations

import numpy as np

from taichi_rts.errors import SceneError
from taichi_rts.scene.geometry.drowned import is_drowned
from taichi_rts.scene.geometry.spanning import scene_solid, spans
from taichi_rts.scene.obstacles.shape import ObstacleShape
from taichi_rts.scene.obstacles.solid import Solid
from taichi_rts.scene.parts.conditions import AXES
from taichi_rts.scene.scales import SceneScales

FAR_LARGER = 20.0
"""Extent of an obstacle over the domain's from which its file must be in another unit."""


def obstacle_faults(scene: SceneScales) -> list[str]:
    """Find what is wrong with each obstacle, and fluids that lie wholly in one."""
    faults: list[str] = []
    solids = []
    for k, obstacle in enumerate(scene.obstacles):
        found = [f"obstacles.{k}: {fault}" for fault in _dimension_faults(scene, obstacle)]
        if not found:
            try:
                solid = scene_solid(scene, obstacle)
            except SceneError as error:
                found = [f"obstacles.{k}: {error}"]
            else:
                found = [f"obstacles.{k}: {fault}" for fault in _place_faults(scene, obstacle, solid)]
                solids.append((k, solid))
        faults += found
    return faults or _drowned_faults(scene, solids)


def _dimension_faults(scene: SceneScales, obstacle: ObstacleShape) -> list[str]:
    """Find vectors that have not the scene's number of components."""
    dim = scene.dim
    if obstacle.dim != dim:
        return [f"{obstacle.shape} has {obstacle.dim} dimensions; the domain has {dim}"]
    expected = 1 if dim == 2 else 3
    named = [("rotation", getattr(obstacle, "rotation", None), expected)]
    if obstacle.motion is not None:
        named.append(("motion.pivot", obstacle.motion.pivot, dim))
        for name, value, turns in obstacle.motion.components():
            named.append((f"motion.{name}", value, expected if turns else dim))
    return [
        f"{name} {value} has {len(value)} components; in {dim} dimensions give {count}"
        for name, value, count in named
        if value is not None and len(value) != count
    ]


def _place_faults(scene: SceneScales, obstacle: ObstacleShape, solid: Solid) -> list[str]:
    """Find an obstacle of the wrong size or outside the domain."""
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    size = float((solid.upper - solid.lower).max())
    where = f"{obstacle.shape} from {_text(solid.lower)} to {_text(solid.upper)}"
    scale = getattr(obstacle, "scale", None)  # of a file, whose unit is not known
    if scale and size > FAR_LARGER * float((high - low).max()):
        return [
            f"{obstacle.shape} is {size:g} m across, the domain {(high - low).max():g} m, so its file is in another unit; "
            f"set scale, 0.001 if it is in mm (now {max(scale):g})"
        ]
    if solid.thickness < scene.spacing * (1 - 1e-6):
        unit = ", or set scale if its file is in another unit" if scale else ""
        return [
            f"{obstacle.shape} is {solid.thickness:g} m thin, the spacing {scene.spacing:g}; "
            f"use a spacing of at most {solid.thickness:g}{unit}"
        ]
    if (solid.upper <= low).any() or (solid.lower >= high).any():
        return [f"{where} lies outside the domain from {_text(low)} to {_text(high)}; move it inside"]
    around = np.array(scene.is_periodic)
    if obstacle.motion is not None:
        return _image_faults(scene, obstacle, solid)
    if ((solid.lower < low) | (solid.upper > high))[around].any():
        return [f"{where} crosses a periodic face of the domain; move it inside"]
    return []


def _image_faults(scene: SceneScales, obstacle: ObstacleShape, solid: Solid) -> list[str]:
    """Find a moving body so long that fluid would meet two of its images along a periodic axis: it knows the nearest alone."""
    motion = obstacle.motion
    if motion is None or not any(scene.is_periodic):
        return []
    pivot = solid.middle if motion.pivot is None else np.array(motion.pivot)
    reach = np.maximum(np.abs(solid.lower - pivot), np.abs(solid.upper - pivot))
    if motion.pieces(scene.dim).spins.any():
        reach[:] = np.linalg.norm(reach)
    around = np.array(scene.is_periodic) & ~spans(scene, obstacle)
    limits = 0.5 * np.array(scene.domain.size) - scene.support
    return [
        f"{obstacle.shape} reaches {reach[d]:g} m from its pivot along the periodic axis {AXES[d]!r}, more than {limits[d]:g}, "
        "half the domain's length less a support radius; put motion.pivot in its middle, make it smaller, or enlarge the domain"
        for d in range(scene.dim)
        if around[d] and reach[d] > limits[d] * (1 + 1e-9)
    ]


def _drowned_faults(scene: SceneScales, solids: list[tuple[int, Solid]]) -> list[str]:
    """Find fluids of which nothing is left outside the obstacles."""
    return [
        f"fluids.{n}: lies wholly inside obstacles.{k}; move or shrink one of them"
        for n, fluid in enumerate(scene.fluids)
        if len(fluid.lower) == scene.dim
        for k, solid in solids
        if is_drowned(fluid, solid, scene.spacing)
    ]


def _text(x: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:g}" for value in x) + ")"
