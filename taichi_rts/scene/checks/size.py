"""How large a scene is, worked out from lengths alone: nothing is sampled, so that it can be asked of any spacing."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.scene.rows import cell_volume
from taichi_rts.scene.scales import SceneScales

MOST = 2**31 - 1
"""Particles and cells of the grid are counted with 32 bits on the device."""
MARGIN = 4.0  # blocks that the grid has more along an axis than fit into the domain, at most


@dataclass(frozen=True)
class SceneSize:
    """Numbers of fluid particles (those that flow in too), wall particles of the domain, and blocks of the grid; real numbers.

    They are those of the volumes and areas, and so may be a few per cent off: exact ones would need the lattices.
    """

    particles: float
    walls: float
    blocks: float


def size_of(scene: SceneScales, spacing: float | None = None) -> SceneSize:
    """Return the size of `scene`, or the one that it would have with another `spacing` [m]."""
    s = scene.spacing if spacing is None else spacing
    volume = sum(fluid.volume_at(s) for fluid in scene.fluids)
    faces = []
    for plane in range(scene.wall_planes if scene.walls else 0):
        sides = [length / s + 2.0 * (plane + 1) for length in scene.domain.size]
        faces += [
            2.0 * math.prod(sides[:axis] + sides[axis + 1 :])
            for axis, periodic in enumerate(scene.is_periodic)
            if not periodic
        ]
    return SceneSize(
        particles=volume / cell_volume(scene, s) + sum(_flowing_in(scene, inflow, s) for inflow in scene.inflows),
        walls=sum(faces),
        blocks=math.prod(length / (scene.support_ratio * s) + MARGIN for length in scene.domain.size),
    )


SPARSE = 0.01
"""Share of the domain that the water fills, below which the domain is what makes a scene large."""


def remedy(scene: SceneScales, best: float) -> str:
    """Say how to make `scene` smaller: by a smaller domain where the water is lost in it, by a spacing of at least `best` [m]."""
    found = [f"use a spacing of at least {best:g}"] if math.isfinite(best) else []
    share = scene.spacing**scene.dim * size_of(scene).particles / math.prod(scene.domain.size)
    if share < SPARSE:
        sides = " x ".join(f"{length:g}" for length in scene.domain.size)
        cells = CELLS_PER_BLOCK * size_of(scene).blocks
        found.insert(
            0,
            f"the domain of {sides} m has {cells:.2g} cells and its walls, of which the water fills {share:.1g}: make the domain "
            "smaller",
        )
    return ", or ".join(found) or "free some, or make the scene smaller"


def _flowing_in(scene: SceneScales, inflow: Any, spacing: float) -> float:
    patch = math.prod(
        (b - a) / spacing for d, (a, b) in enumerate(zip(inflow.lower, inflow.upper, strict=True)) if d != inflow.axis
    )
    stop = scene.end_time if inflow.stop is None else inflow.stop
    return patch * max(0.0, (stop - inflow.start) * inflow.normal_speed / spacing)


def finest_spacing(fits: Callable[[float], bool], spacing: float) -> float:
    """Return the smallest spacing [m] at or above `spacing` that `fits`, rounded up to two digits."""
    below = above = spacing
    while not fits(above):
        below, above = above, 2.0 * above
        if not math.isfinite(above):
            return above
    for _ in range(12):
        middle = math.sqrt(below * above)
        below, above = (below, middle) if fits(middle) else (middle, above)
    digit = 10.0 ** (math.floor(math.log10(above)) - 1)
    return float(f"{math.ceil(above / digit) * digit:.2g}")


def size_faults(scene: SceneScales) -> list[str]:
    """Find counts that do not fit into 32 bits."""

    def counts(spacing: float) -> dict[str, float]:
        size = size_of(scene, spacing)
        return {
            "fluid particles": size.particles,
            "wall particles": size.walls,
            "cells of the grid": CELLS_PER_BLOCK * size.blocks,
        }

    found = counts(scene.spacing)
    name = max(found, key=lambda each: found[each])
    if found[name] <= MOST:
        return []
    best = finest_spacing(lambda s: max(counts(s).values()) <= MOST, scene.spacing)
    return [
        f"spacing: {scene.spacing:g} makes {found[name]:.3g} {name}, more than the {MOST} that 32 bits count; "
        f"{remedy(scene, best)}, or a smaller scene"
    ]


HUGE = 300.0
"""Extent [m] from which a domain looks as if its numbers were millimetres."""


def warn_of_size(scene: SceneScales) -> None:
    """Warn of a domain that was perhaps drawn in millimetres: nothing else says so, as all of a run follows from its lengths."""
    extent = max(scene.domain.size)
    if extent >= HUGE and any(scene.acceleration):
        warnings.warn(
            f"the domain of {scene.name!r} is {extent:g} m across, and lengths are metres; if it was drawn in millimetres, "
            f"divide all its lengths by 1000 (that is {extent / 1000:g} m)",
            stacklevel=2,
        )
