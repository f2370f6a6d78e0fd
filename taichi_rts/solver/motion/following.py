"""Has the grid follow the particles: tiles of blocks come in and go out between two steps, and walls with them."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.device.fields import Declared, Part, reals
from taichi_rts.errors import ResourceError
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.tiles import CELLS, OUTSIDE, TILE, Tiles
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.particles.extra import Extra
from taichi_rts.solver.physics.laid_walls import LaidWalls

MARGINS = (2, 1)
"""Blocks around each particle whose tiles are kept, if they all fit, else the next: 1 is needed, with 2 fewer changes."""
Indices: Any = ti.types.ndarray(dtype=ti.i32, ndim=1)


@ti.data_oriented
class Following(Part, Extra):
    """Keeps the tiles around particles (`Tiles`) up to date, before each sort.

    If a particle is where not all blocks around it are kept, all tiles are chosen anew: those near particles now, and those
    of blocks that held particles at the last sort. What blocks have moves along with them, and a tile that comes in has what
    slot 0 has, where there never is a particle. So all is as if every block were kept.
    """

    transient = frozenset({"carried", "real_scratch", "strays"})

    def __init__(self, motion: Motion, grid: BlockGrid, geometry: Tiles, walls: Sequence[LaidWalls]) -> None:
        self.motion = motion
        self.particles = motion.particles
        self.grid = grid
        self.geometry = geometry
        self.walls = list(walls)
        self.carried: list[tuple[ti.Field, ti.Field]] = []
        """What moves along with blocks, and where it is put down meanwhile."""
        self.strays = ti.field(ti.i32, ())
        self.changes = 0

    @staticmethod
    def fields(blocks: int, *, sound: bool) -> list[Declared]:
        """Declare the fields for `blocks`; `sound`: whether any has real numbers, those of the regional sound speed."""
        return reals(blocks, "real_scratch") if sound else []

    def carry(self, fields: Sequence[ti.Field], dtype: Any) -> None:
        """Have what these `fields`, (blocks,) each, hold move along with their blocks; reals are of `dtype`."""
        listed = [self.grid.occupied, *([self.grid.vacated] if self.grid.tracks_vacated else [])]
        moving = [each for each in fields if not any(each is other for other in listed)]
        self.make_fields(self.fields(self.geometry.blocks, sound=any(map(is_real, moving))), dtype)
        self.carried = [(each, self.real_scratch if is_real(each) else self.grid.cell_count) for each in moving]

    def before_sort(self, now: int, tick: float, before_change: Callable[[], object]) -> None:
        """Have blocks kept around every particle at tick `now`."""
        self.find_strays(now, tick)
        if self.strays[None] > 0:
            self.follow(now, tick)

    def restored(self) -> None:
        """Have the grid look at the tiles that are kept now, and lay their walls."""
        self.grid.divide((int(self.geometry.used[None]) + 1) * TILE)
        self.grid.restored()
        for wall in self.walls:
            wall.lay()

    def statistics(self) -> dict[str, Any]:
        """How often tiles were chosen, and how many blocks are kept of those that there is room for."""
        room = self.geometry.blocks - OUTSIDE * TILE
        return {
            "grid_changes": self.changes,
            "blocks_kept": int(self.geometry.used[None]) * TILE,
            "blocks_at_most": room,
        }

    @ti.kernel
    def find_strays(self, now: ti.i32, tick: float):
        """Count the particles around which not all blocks are kept."""
        self.strays[None] = 0
        for i in range(self.particles.alive[None]):
            x = self.motion.present_position(i, now, tick)
            if self.geometry.has_left(self.grid.cell_of[i], x):
                if not self.geometry.safe(self.geometry.cell(x)):
                    self.strays[None] += 1

    def follow(self, now: int, tick: float) -> None:
        """Choose the tiles for where particles are at tick `now`, and move what blocks have.

        Raises `ResourceError` if there is no room for them or their walls.
        """
        geometry, before = self.geometry, self.geometry.keys()
        places, held = (np.full(self.particles.capacity, -1, np.int32) for _ in range(2))
        self.list_blocks(places, held, now, tick)
        keys = self.choose(places[places >= 0], geometry.keys_of(held[held >= 0]))
        came_from = np.searchsorted(before, keys)
        there = np.isin(keys, before, assume_unique=True)
        new_slots = np.searchsorted(keys, before) + 1
        new_slots[~np.isin(before, keys, assume_unique=True)] = 0
        self.move_blocks(
            (came_from + 1).astype(np.int32), there.astype(np.int32), np.append(0, new_slots).astype(np.int32)
        )
        geometry.keep(keys)
        self.restored()
        self.changes += 1

    def choose(self, places: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Return the tiles to keep, ascending, around the blocks `places`, and those that are `held`."""
        room = self.geometry.slots - OUTSIDE
        for margin in MARGINS:
            keys = np.union1d(self.geometry.keys_around(places, margin), held)
            walls = max((wall.count_in(keys) - wall.count for wall in self.walls), default=0)
            if len(keys) <= room and walls <= 0:
                return keys
        raise ResourceError(
            f"the water has spread over {len(keys)} pieces of the grid, of which there is room for {room}, and has come near "
            f"{max(walls, 0)} wall particles more than there is room for; make the domain smaller, or use a larger spacing"
        )

    @ti.kernel
    def list_blocks(self, places: Indices, held: Indices, now: ti.i32, tick: float):
        """List the numbers in the whole domain of the blocks where particles are now, and where they were at the last sort."""
        geometry = self.geometry
        for i in range(self.particles.alive[None]):
            x = self.motion.present_position(i, now, tick)
            places[i] = geometry.row(x) * geometry.shape[0] + geometry.column(x[0]) // CELLS_PER_BLOCK
        for m in range(self.grid.occupied_count[None]):
            held[m] = geometry.number(self.grid.occupied[m])

    @ti.kernel
    def move_blocks(self, came_from: Indices, there: Indices, new_slots: Indices):
        """Move what blocks and cells have to their new slots.

        The n-th new tile was at slot `came_from[n]`, or if it was not `there`, would have been before the one that is. Slot s
        becomes `new_slots[s]`. `cell_count`, which holds nothing between two sorts, serves to put things down.
        """
        grid = self.grid
        for field, scratch in ti.static(self.carried):
            for n in range(came_from.shape[0] * TILE):
                slot = came_from[n // TILE] * there[n // TILE]
                scratch[n] = field[slot * TILE + n % TILE]
            for n in range(came_from.shape[0] * TILE):
                field[n + TILE] = scratch[n]
        for n in range(came_from.shape[0] * CELLS):
            tile = n // CELLS
            grid.cell_count[n] = grid.start[came_from[tile] * CELLS + n % CELLS * there[tile]]
        for cell in range(CELLS, self.geometry.cells):  # behind the last no particle follows
            n = cell - CELLS
            total = grid.start[self.geometry.cells]
            grid.start[cell] = grid.cell_count[n] if n < came_from.shape[0] * CELLS else total
        for n in range(came_from.shape[0] * CELLS):
            grid.cell_count[n] = 0
        for i in range(self.particles.capacity):
            cell = grid.cell_of[i]
            if cell >= 0:
                grid.cell_of[i] = new_slots[cell // CELLS] * CELLS + cell % CELLS
        for m in range(grid.occupied_count[None]):
            block = grid.occupied[m]
            grid.occupied[m] = new_slots[block // TILE] * TILE + block % TILE


def is_real(field: ti.Field) -> bool:
    """Whether a field holds real numbers."""
    return field.dtype in (ti.f32, ti.f64)
