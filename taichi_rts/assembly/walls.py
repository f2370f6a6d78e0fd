"""The walls and obstacles of a run, from its sample."""

from __future__ import annotations

from typing import Any

from taichi_rts.assembly.following import laid_walls
from taichi_rts.device import backend as backends
from taichi_rts.sampling.sampling import Sample
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.geometry.spanning import scene_solid
from taichi_rts.scene.obstacles.solid import distance_grid
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.tiles import Tiles
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.keepers import DistanceTables, MovingKeeper, RestingKeeper
from taichi_rts.solver.physics.moving_walls import MovingFace
from taichi_rts.solver.physics.obstacles import MovingBody
from taichi_rts.solver.physics.walls import Walls


def make_walls(
    scene: Scene, start: Sample, near: Neighbourhood, grid: BlockGrid, backend: backends.Backend
) -> list[Any]:
    """Return the walls and obstacles at rest as one, if there are any, and each moving face and obstacle."""
    geometry, moving_bodies = grid.geometry, bodies(scene)
    if isinstance(geometry, Tiles):  # then nothing moves, and there are no obstacles
        return laid_walls(scene, near, geometry, near.count, backend)
    at_rest = [layer for layer, body in zip(start.obstacles, scene.obstacles, strict=True) if body.motion is None]
    layers = [start.walls.choose(start.owners == number) for number in range(len(scene.moving_walls))]
    rest = start.walls.choose(start.owners == -1)
    if at_rest:
        rest = rest.joined(at_rest)
    still: list[Any] = [Walls(rest, near, geometry, backend)] if len(rest.positions) else []
    moving = zip(scene.moving_walls, layers, strict=True)
    faces = [MovingFace(wall, layer, near, geometry, backend) for wall, layer in moving]
    turning = [
        MovingBody(body, start.obstacles[body.number], near, grid, scene.support, backend) for body in moving_bodies
    ]
    return still + faces + turning


def make_keepers(scene: Scene, geometry: Geometry) -> list[Any]:
    """Return what keeps centres out of obstacles: one part for all that are at rest, one for each that moves."""
    if not scene.obstacles:
        return []
    solids = (scene_solid(scene, obstacle) for obstacle in scene.obstacles)
    grids = [distance_grid(solid, scene.spacing) for solid in solids]
    tables = DistanceTables(grids, scene.dim)
    at_rest = [k for k, obstacle in enumerate(scene.obstacles) if obstacle.motion is None]
    keepers: list[Any] = []
    if at_rest:
        keepers.append(RestingKeeper(tables, at_rest, [grids[k] for k in at_rest], geometry, scene.spacing))
    return keepers + [MovingKeeper(tables, body, geometry) for body in bodies(scene)]
