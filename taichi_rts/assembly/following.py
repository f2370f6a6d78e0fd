"""Whether a run's grid and walls follow its particles, and the parts of one where they do."""

from __future__ import annotations

import math
from typing import Any

from taichi_rts.assembly.inventory import State
from taichi_rts.device.backend import Backend, ti
from taichi_rts.sampling.faces import faces_of
from taichi_rts.scene.checks.size import size_of
from taichi_rts.scene.scales import SceneScales
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.tiles import TILE, Tiles, slots_for
from taichi_rts.solver.motion.following import Following
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.laid_walls import LaidWalls, densest_column, room_for_walls
from taichi_rts.solver.solver import Solver

MANY = 1 << 20
"""Blocks up to which all are kept: they take some 50 to 100 MB."""
GAIN = 2.0
"""Blocks in all over those that particles may need at most, above which only the latter are kept."""


def follows(scene: SceneScales, spacing: float | None = None) -> bool:
    """Say whether the grid follows the particles, with the scene's own or another `spacing` [m].

    Where the water is lost in the domain, and there are neither periodic axes nor obstacles nor moving walls.
    """
    if any(scene.is_periodic) or scene.obstacles or scene.moving_walls:
        return False
    size = size_of(scene, spacing)
    if size.blocks <= MANY:
        return False
    side = scene.support_ratio * (spacing or scene.spacing)
    shape = [math.ceil(length / side) + 3 for length in scene.domain.size]
    return size.blocks > GAIN * TILE * slots_for(math.ceil(size.particles), shape)


def laid_walls(scene: Scene, near: Neighbourhood, geometry: Tiles, particles: int, backend: Backend) -> list[Any]:
    """Return the walls of the domain, if the scene has any."""
    faces = faces_of(scene)
    if not faces:
        return []
    room = room_for_walls(scene, geometry, scene.spacing, particles)
    densest = densest_column(scene, geometry, scene.spacing)
    return [LaidWalls(scene, faces, room, densest, near, geometry, backend)]


def follow(motion: Motion, grid: BlockGrid, walls: list[Any]) -> list[Following]:
    """Return what has the grid follow the particles, if it does."""
    return [Following(motion, grid, grid.geometry, walls)] if isinstance(grid.geometry, Tiles) else []


def begin_to_follow(solver: Solver, dtype: Any) -> None:
    """Have all that `solver` keeps for blocks move along with them, and keep those near its particles; reals are of `dtype`."""
    for extra in solver.extras:
        if isinstance(extra, Following):
            blocks = (solver.grid.geometry.blocks,)
            fields = [each for each in State(solver).fields.values() if each.shape == blocks and is_scalar(each)]
            extra.carry(fields, dtype)
            extra.follow(solver.timeline.now, solver.timeline.tick)


def is_scalar(field: Any) -> bool:
    """Whether a field holds numbers, not vectors."""
    return not isinstance(field, ti.MatrixField)
