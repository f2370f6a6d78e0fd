"""Blocks that are kept only near particles, in tiles of a few along x: memory then follows the particles, not the domain."""

import math
from collections.abc import Sequence

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.device.fields import Declared, Part, integers
from taichi_rts.solver.grid.geometry import Geometry

TILE = 4
"""Blocks in a tile, one behind the other along x. A particle far from all others keeps 9 x 2 tiles."""
CELLS = TILE * CELLS_PER_BLOCK  # of a tile
OUTSIDE = 2
"""Slots that never hold a particle: number 0, for all tiles that are not kept, and one behind the last."""
WHOLE, LEFT, RIGHT = 1, 2, 4


def slots_for(particles: int, shape: Sequence[int]) -> int:
    """Return the number of slots that so many particles need at most, in a domain of `shape` blocks, with margin.

    Around each are 9 rows (3 in two dimensions) of two tiles; and one tile more, of which it was part before.
    """
    each = 2 * 3 ** (len(shape) - 1) + 1
    return min(particles * each, tiles_in_row(shape) * math.prod(shape[1:])) + OUTSIDE


def tiles_in_row(shape: Sequence[int]) -> int:
    """Return how many tiles a row of a domain of `shape` blocks has."""
    return -(-shape[0] // TILE)


@ti.data_oriented
class Tiles(Geometry, Part):
    """A domain without periodic axes of whose blocks only some tiles are kept, at most `slots`.

    Slots hold tiles in ascending order, by row and then along x; so particles sorted by cell are in the same order as if all
    blocks were kept, and the cells of a row follow each other wherever its tiles do. A block may hold particles only if it is
    `safe`, that is if all blocks around it are kept: then an index difference of 1 along x leads to the block beside it.
    All tiles that are not kept are at slot 0, which stays empty.

    `first_slot` and `last_slot`, (rows,), are those of a row, 0 if it has none; `row_of` and `tile_of`, (slots,), say what is
    at a slot; `slot_beside` has the slots of the tile in the 9 (3) rows in and around each, and `open` whether they, and
    those to the left and to the right, are all kept.
    """

    def __init__(
        self, lower: Sequence[float], upper: Sequence[float], support: float, drift: float, particles: int
    ) -> None:
        super().__init__(lower, upper, support, drift)
        self.slots = slots_for(particles, self.shape)
        self.rows = math.prod(self.shape[1:])
        self.tiles = tiles_in_row(self.shape)
        self.rows_of_offsets = [sum((step + 1) * 3**d for d, step in enumerate(each[1:])) for each in self.offsets]
        self.blocks = self.slots * TILE
        self.cells = self.slots * CELLS
        self.make_fields(self.table_fields(self.slots, self.rows, self.dim))
        self.used = ti.field(ti.i32, ())
        """Slots in use, from number 1 on."""

    @staticmethod
    def table_fields(slots: int, rows: int, dim: int) -> list[Declared]:
        """Declare the tables for so many slots and rows of the domain."""
        return [
            *integers(rows, "first_slot", "last_slot"),
            *integers(slots, "row_of", "tile_of", "open"),
            *integers(slots * 3 ** (dim - 1), "slot_beside"),
        ]

    def keys(self) -> np.ndarray:
        """Return the tiles that are kept, (used,), ascending: row x tiles in a row + tile."""
        used = int(self.used[None])
        rows, tiles = (field.to_numpy()[1 : used + 1].astype(np.int64) for field in (self.row_of, self.tile_of))
        return rows * self.tiles + tiles

    def keys_around(self, numbers: np.ndarray, margin: int) -> np.ndarray:
        """Return the tiles within `margin` <= `TILE` blocks of the blocks `numbers`, (N,) of the whole domain; ascending."""
        row, column = np.divmod(np.unique(numbers).astype(np.int64), self.shape[0])
        ends = [np.clip(column + step, 0, self.shape[0] - 1) // TILE for step in (-margin, margin)]
        row, tile = np.divmod(np.unique(np.concatenate([row * self.tiles + end for end in ends])), self.tiles)
        span, stride = np.arange(-margin, margin + 1), 1
        for length in self.shape[1:]:
            step = row // stride % length
            rows = (row - step * stride)[:, None] + np.clip(step[:, None] + span, 0, length - 1) * stride
            row, tile = np.divmod(np.unique(rows * self.tiles + tile[:, None]), self.tiles)
            stride *= length
        return row * self.tiles + tile

    def keys_of(self, numbers: np.ndarray) -> np.ndarray:
        """Return the tiles of the blocks with these `numbers`, (N,) of the whole domain, ascending."""
        row, column = np.divmod(np.unique(numbers).astype(np.int64), self.shape[0])
        return np.unique(row * self.tiles + column // TILE)

    def keep(self, keys: np.ndarray) -> None:
        """Keep these tiles, (used,) ascending, and no others; what blocks have is another's to move (`Following`)."""
        row, tile = np.divmod(keys, self.tiles)
        self.forget_rows()
        self.used[None] = len(keys)
        self.write_tables(row.astype(np.int32), tile.astype(np.int32))
        self.join()

    @ti.kernel
    def forget_rows(self):
        for s in range(1, self.used[None] + 1):
            self.first_slot[self.row_of[s]] = 0
            self.last_slot[self.row_of[s]] = 0

    @ti.kernel
    def write_tables(self, row: ti.types.ndarray(ndim=1), tile: ti.types.ndarray(ndim=1)):
        for n in range(row.shape[0]):
            self.row_of[n + 1], self.tile_of[n + 1] = row[n], tile[n]
            if n == 0 or row[ti.max(n - 1, 0)] != row[n]:
                self.first_slot[row[n]] = n + 1
            if n + 1 == row.shape[0] or row[ti.min(n + 1, row.shape[0] - 1)] != row[n]:
                self.last_slot[row[n]] = n + 1

    @ti.kernel
    def join(self):
        for s in range(1, self.used[None] + 1):
            row, tile = self.row_of[s], self.tile_of[s]
            whole, left, right = WHOLE, LEFT, RIGHT
            for k in ti.static(range(self.across_count)):
                other = self.row_outside(row, k)
                here, before, behind = 0, 0, 0
                if other >= 0:
                    here = self.slot(other, tile)
                    before, behind = self.slot(other, tile - 1), self.slot(other, tile + 1)
                self.slot_beside[s * self.across_count + k] = here
                if here == 0:
                    whole = 0
                if before == 0:
                    left = 0
                if behind == 0:
                    right = 0
            self.open[s] = whole | left | right

    @ti.func
    def row_outside(self, row, k: ti.template()):
        """Number of the k-th row in and around `row`, -1 if that lies outside the domain and its margin."""
        y, z = row % self.shape[1] + (k % 3 - 1), 0
        inside = y >= 0 and y < self.shape[1]
        if ti.static(self.dim == 3):
            z = row // self.shape[1] + (k // 3 - 1)
            inside = inside and z >= 0 and z < self.shape[2]
        return y + z * self.shape[1] if inside else -1

    @ti.func
    def slot(self, row, tile):
        """Slot of a tile of a row, 0 if it is not kept."""
        low, high = self.first_slot[row], self.last_slot[row]
        found = 0
        if low > 0:
            while low < high:
                middle = (low + high) // 2
                if self.tile_of[middle] < tile:
                    low = middle + 1
                else:
                    high = middle
            if self.tile_of[low] == tile:
                found = low
        return found

    @ti.func
    def safe(self, cell):
        """Whether all blocks around that of `cell` are kept."""
        slot, place = cell // CELLS, cell % CELLS // CELLS_PER_BLOCK
        needed = WHOLE
        if place == 0:
            needed |= LEFT
        if place == TILE - 1:
            needed |= RIGHT
        return slot > 0 and (self.open[slot] & needed) == needed

    @ti.func
    def cell(self, x):
        """Cell index of position `x` [m], (dim,), which must lie in the domain; one of slot 0 where it is not kept."""
        column = self.column(x[0])
        tile = column // CELLS
        return self.slot(self.row(x), tile) * CELLS + column - tile * CELLS

    @ti.func
    def has_left(self, cell, x):
        """Whether position `x` [m], (dim,), does not lie in `cell`, or that is negative; without a search for its tile."""
        slot = ti.max(cell, 0) // CELLS
        column = self.tile_of[slot] * CELLS + cell % CELLS
        return cell < 0 or self.column(x[0]) != column or self.row(x) != self.row_of[slot]

    @ti.func
    def number(self, block):
        """Number of `block` among all of the domain and its margin."""
        slot = block // TILE
        return self.row_of[slot] * self.shape[0] + self.tile_of[slot] * TILE + block % TILE

    @ti.func
    def step(self, block, axis: ti.template()):
        """How many blocks `block` lies from the first along `axis`, that of the margin."""
        slot = block // TILE
        along = self.tile_of[slot] * TILE + block % TILE
        if ti.static(axis == 1):
            along = self.row_of[slot] % self.shape[1]
        if ti.static(axis == 2):
            along = self.row_of[slot] // self.shape[1]
        return along

    @ti.func
    def across(self, block, k: ti.template()):
        """Index of the block across x from `block` in the k-th row in and around its own."""
        return self.slot_beside[block // TILE * self.across_count + k] * TILE + block % TILE

    @ti.func
    def beside(self, block, k: ti.template()):
        """Index of the k-th of the 8 (26) blocks around `block`."""
        return self.across(block, ti.static(self.rows_of_offsets[k])) + self.offsets[k][0]

    @ti.func
    def run_of(self, block):
        """The index itself stands for row and column: in it the columns of a run follow each other."""
        return 0, block

    @ti.func
    def columns_behind(self, column):
        """As many as any run has: it ends at the last block that holds particles, beside which there is one more."""
        return self.shape[0]

    @ti.func
    def block_at(self, row, column):
        """Index of the block at `column`."""
        return column

    @ti.func
    def first_cell(self, row, column, above):
        """First cell of the block across x from that at `column`, in row number `above` (0-8, or 0-2) of those around it."""
        slot = self.slot_beside[column // TILE * self.across_count + above]
        return (slot * TILE + column % TILE) * CELLS_PER_BLOCK

    @ti.func
    def base_beside(self, cell, dy, dz):
        """Number to which a column of cells is added for its cell in the row `dy` and `dz` further than that of `cell`."""
        slot, above = cell // CELLS, dy + 1
        if ti.static(self.dim == 3):
            above += 3 * (dz + 1)
        return (self.slot_beside[slot * self.across_count + above] - self.tile_of[slot]) * CELLS
