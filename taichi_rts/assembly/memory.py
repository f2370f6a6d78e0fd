"""What memory a run takes, from what its parts declare: nothing is sampled, so that it can be asked of any spacing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_rts.assembly.build import make_geometry, optional_fields
from taichi_rts.assembly.following import follows
from taichi_rts.device.backend import Backend
from taichi_rts.device.fields import Declared, within
from taichi_rts.scene.checks.size import size_of
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.geometry.spanning import scene_solid
from taichi_rts.scene.obstacles.solid import Solid, grid_nodes
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.tiles import TILE, Tiles, slots_for
from taichi_rts.solver.grid.windows import RUN, FluidWindows, WallWindows, entries, room
from taichi_rts.solver.motion.following import Following
from taichi_rts.solver.motion.outlet import Outlets
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.physics.keepers import DistanceTables, RestingKeeper, bin_solids
from taichi_rts.solver.physics.laid_walls import densest_column, room_for_walls
from taichi_rts.solver.physics.moving_walls import MovingFace
from taichi_rts.solver.physics.obstacles import MovingBody
from taichi_rts.solver.physics.walls import Walls
from taichi_rts.solver.sound.rule import SoundRule
from taichi_rts.solver.stepping.base import Stepper

SAMPLING = 50
"""Bytes of the host per particle and dimension while a scene is sampled, at most (measured: 49 in two and three dimensions)."""
TABULATING = 100
"""Bytes of the host per node of an obstacle's table of distances while that is filled."""
LINING = 10 * SAMPLING
"""Bytes of the host per boundary particle of an obstacle and dimension: they are chosen from about ten times as many points."""
FIXED = 1 << 14
"""Bytes of fields whose size does not depend on the scene, about: single numbers, counts, tables of motions."""
SINGLE = 64
"""The same of those that are made between the others, at most."""
WALL_SHARE = 0.45
"""Entries of the windows on a wall at rest over those of the windows on the fluid at r = 2s, about."""


@dataclass(frozen=True)
class Counts:
    """What a run has how many of.

    Attributes:
        particles: of fluid, with those that flow in.
        blocks: of the grid.
        at_rest: wall particles that do not move, also those of obstacles.
        faces: wall particles of each moving face.
        bodies: wall particles of each moving obstacle, and blocks of its own grid.
        nodes: of all obstacles' tables of distances, and how many tables.
        bins: in which obstacles at rest are looked up, and entries in them.
        window: particles that each window on the fluid has room for.
        wall_window: the same of the windows on the wall at rest.
        slots, rows: of tiles of blocks, and rows of the domain, where the grid follows the particles; else 0.
    """

    particles: int
    blocks: int
    at_rest: int
    faces: tuple[int, ...]
    bodies: tuple[tuple[int, int], ...]
    nodes: tuple[int, int]
    bins: tuple[int, int]
    window: int
    wall_window: int
    slots: int = 0
    rows: int = 0


def count(scene: Scene, stepper: Stepper, spacing: float | None = None) -> Counts:
    """Return the counts of a run with its own or another `spacing` [m], worked out from lengths.

    Those of blocks, nodes and windows on the fluid are exact, those of particles and wall particles estimates.
    """
    s, dim = spacing or scene.spacing, scene.dim
    size, support = size_of(scene, spacing), scene.support_ratio * s
    if follows(scene, spacing):
        return _count_following(scene, stepper, s, math.ceil(size.particles))
    geometry = make_geometry(scene, stepper, support)
    solids = [scene_solid(scene, obstacle) for obstacle in scene.obstacles]
    lined = [_lining(scene, solid, s) for solid in solids]
    moving = bodies(scene)
    resting = sum(lined) - sum(lined[body.number] for body in moving)
    tables = [grid_nodes(solid.lower, solid.upper, s) for solid in solids]
    window = room(dim, math.prod(geometry.sides) / s**dim)
    return Counts(
        particles=math.ceil(size.particles),
        blocks=geometry.blocks,
        at_rest=math.ceil(size.walls + resting),
        faces=tuple(0 for _ in scene.moving_walls),  # whose particles are counted with those at rest
        bodies=tuple(
            (
                math.ceil(lined[body.number]),
                MovingBody.own_geometry(body.solid.lower - body.pivot, body.solid.upper - body.pivot, support).blocks,
            )
            for body in moving
        ),
        nodes=(sum(math.prod(map(int, shape)) for _origin, shape, _step in tables), len(tables)),
        bins=_bins([table for k, table in enumerate(tables) if scene.obstacles[k].motion is None], s),
        window=window,
        wall_window=math.ceil(WALL_SHARE * scene.wall_planes * 2.0 / scene.support_ratio * window),
    )


def _count_following(scene: Scene, stepper: Stepper, s: float, particles: int) -> Counts:
    """Return the counts where grid and walls follow the particles: room for all that so many may need at once."""
    geometry = make_geometry(scene, stepper, scene.support_ratio * s)
    slots = slots_for(particles, geometry.shape)
    return Counts(
        particles=particles,
        blocks=slots * TILE,
        at_rest=room_for_walls(scene, geometry, s, particles) if scene.walls else 0,
        faces=(),
        bodies=(),
        nodes=(0, 0),
        bins=(0, 0),
        window=room(scene.dim, math.prod(geometry.sides) / s**scene.dim),
        wall_window=densest_column(scene, geometry, s) * (RUN + 2),
        slots=slots,
        rows=math.prod(geometry.shape[1:]),
    )


def declared_fields(
    scene: Scene, stepper: Stepper, backend: Backend, counts: Counts, *, debug: bool = False
) -> dict[str, list[Declared]]:
    """List the fields of all parts that `build.assemble` makes, by what the parts are for.

    Those of one entry of the result are made one after the other; none of another one is made in between. Left out are fields
    of few entries: single numbers, and tables of prescribed motions.
    """
    scene = scene.with_sound_for(stepper)
    dim, needs, serial = scene.dim, optional_fields(scene, stepper, debug), backend.arch == "cpu"
    particles, blocks = counts.particles, counts.blocks
    near = Neighbourhood.fields(particles, dim, backend.lanes, needs)
    found = {
        "the particles' state": within("particles", FluidState.fields(particles, dim, needs)),
        "the particles' order": within("grid", BlockGrid.order_fields(particles)),
        "the grid and what neighbours see": [
            *(within("geometry", Tiles.table_fields(counts.slots, counts.rows, dim)) if counts.slots else []),
            *within("grid", BlockGrid.block_fields(particles, blocks, serial=serial)),
            *(within("sound", SoundRule.fields(blocks)) if "sound" in needs else []),
            *within("near", near),
            *(within("windows", _windows(scene, backend, counts, needs)) if serial else []),
        ],
        "walls": list(_walls(scene, backend, counts)),
        "the distances from obstacles": [
            *(within("tables", DistanceTables.fields(*counts.nodes, dim)) if scene.obstacles else []),
            *(within("keepers", RestingKeeper.fields(*counts.bins)) if counts.bins[0] else []),
        ],
        "steps": [
            *(within("outlets", Outlets.fields(particles)) if scene.outlets else []),
            *within("schedule", stepper.schedule_fields(scene, particles, blocks, serial=serial)),
            *(within("following", Following.fields(blocks, sound="sound" in needs)) if counts.slots else []),
        ],
    }
    names: set[str] = set()  # because two parts may ask for a field of the grid
    for purpose, declared in found.items():
        found[purpose] = [each for each in declared if each.name not in names]
        names.update(each.name for each in declared)
    return found


def _bins(tables: list[tuple[np.ndarray, Any, float]], spacing: float) -> tuple[int, int]:
    """Number of bins' starts, and of entries in them, for obstacles at rest with these tables' origins, shapes and steps."""
    if not tables:
        return 0, 0
    low = np.array([origin for origin, _shape, _step in tables])
    high = low + [step * (np.array(shape) - 1) for _origin, shape, step in tables]
    _origin, _shape, _side, start, entries = bin_solids(low, high, spacing)
    return len(start), len(entries)


def _windows(scene: Scene, backend: Backend, counts: Counts, needs: frozenset[str]) -> list[Declared]:
    """List the fields of the windows on the fluid and on the wall at rest."""
    fluid = FluidWindows.fields(scene.dim, counts.window, backend.lanes, needs)
    if counts.at_rest == 0 or any(scene.is_periodic):
        return fluid
    inside = Walls.particle_fields(entries(counts.wall_window), scene.dim, scene.wall_planes > 1)
    return fluid + within("wall", WallWindows.fields(inside))


def _walls(scene: Scene, backend: Backend, counts: Counts) -> Iterator[Declared]:
    """List the fields of the walls at rest, of moving faces and of moving obstacles."""
    dim, layered = scene.dim, scene.wall_planes > 1
    at_rest = [(counts.at_rest, counts.blocks, list[Declared]())] if counts.at_rest else []
    faces = [(count, counts.blocks, MovingFace.place_fields(counts.particles)) for count in counts.faces]
    turning = [(*each, MovingBody.pose_fields(counts.blocks, dim)) for each in counts.bodies]
    for k, (particles, blocks, more) in enumerate([*at_rest, *faces, *turning]):
        laid = Walls.particle_fields(particles + backend.lanes, dim, layered)
        yield from within(f"walls.{k}", [*laid, *Walls.block_fields(blocks), *more])


def device_bytes(
    scene: Scene,
    stepper: Stepper,
    precision: str,
    *,
    debug: bool = False,
    spacing: float | None = None,
    on_cpu: bool = True,
) -> float:
    """Bytes of all fields of a `Simulation`."""
    return sum(buffer_bytes(scene, stepper, precision, debug=debug, spacing=spacing, on_cpu=on_cpu).values())


def buffer_bytes(
    scene: Scene,
    stepper: Stepper,
    precision: str,
    *,
    debug: bool = False,
    spacing: float | None = None,
    on_cpu: bool = False,
) -> dict[str, float]:
    """Bytes of the fields that a `Simulation` makes one after the other, of which none launches a kernel in between, or more."""
    backend = Backend("cpu" if on_cpu else "vulkan", precision)
    counts = count(scene, stepper, spacing)
    found = declared_fields(scene, stepper, backend, counts, debug=debug)
    real = 8 if precision == "f64" else 4
    sizes = {purpose: float(sum(each.size(real) for each in fields)) for purpose, fields in found.items()}
    return {purpose: size + (FIXED if purpose == "steps" else SINGLE) for purpose, size in sizes.items()}


def host_bytes(scene: Scene, *, spacing: float | None = None) -> float:
    """Largest number of bytes that sampling takes on the host; the arrays of a frame need less."""
    size, s = size_of(scene, spacing), spacing or scene.spacing
    solids = [scene_solid(scene, obstacle) for obstacle in scene.obstacles]
    nodes = [math.prod(map(float, grid_nodes(solid.lower, solid.upper, s)[1])) for solid in solids]
    walls = 0.0 if follows(scene, spacing) else size.walls
    lining = sum(_lining(scene, solid, s) for solid in solids) * scene.dim * LINING
    return (size.particles + walls) * scene.dim * SAMPLING + lining + max(nodes, default=0.0) * TABULATING


def _lining(scene: Scene, solid: Solid, spacing: float) -> float:
    """Number of boundary particles of an obstacle: that of its bounding box."""
    sides = [length / spacing + 1.0 for length in solid.upper - solid.lower]
    total = sum(2.0 * math.prod(sides[:d] + sides[d + 1 :]) for d in range(scene.dim))
    return total * scene.wall_planes
