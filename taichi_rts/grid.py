"""The dense block grid: blocks of side r, each cut along x into cells; counting sort, cell ranges, neighbour sums.

Blocks are the unit of the paper (one step per block). Cells are finer along x only: particles sorted by cell with x
fastest make the neighbours of a particle in one row one contiguous range, and finer cells make that range shorter.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import taichi as ti

from taichi_rts.backend import Backend, on_cpu
from taichi_rts.resorting import Resorting
from taichi_rts.scan import ExclusiveScan

CELLS_PER_BLOCK = 2  # measured: 1, 2, 4, 8 cells take 225, 203, 269, 321 ns per particle and core in a density pass
MARGIN = 1  # blocks around the domain, so that no neighbour index leaves the grid; wall particles lie there


@ti.data_oriented
class Geometry:
    """How space is cut: origin [m], block side [m], shape in blocks with margin.

    With `drift` zero a block's side is the support radius. Where the grid serves for longer than one step, particles may
    drift by up to `drift` [m] from where they were sorted in, and two that interact by twice that: the side grows by as much,
    so that they still lie in neighbouring blocks, and `reach` is how far from a particle its neighbours were sorted in.

    Along a `periodic` axis blocks are a little longer, so that a whole number fits, and the first lies beside the last.
    """

    def __init__(
        self,
        lower: Sequence[float],
        upper: Sequence[float],
        support: float,
        drift: float = 0.0,
        periodic: Sequence[bool] | None = None,
    ) -> None:
        self.dim = len(lower)
        self.lower = tuple(lower)
        self.upper = tuple(upper)
        self.lengths = tuple(b - a for a, b in zip(lower, upper, strict=True))
        self.periodic = tuple(periodic or [False] * self.dim)
        self.repeats = any(self.periodic)
        side = support + 2.0 * drift
        self.drift = drift
        self.reach = support + drift
        inside = [
            max(1, math.floor(length / side + 1e-9) if around else math.ceil(length / side - 1e-9))
            for length, around in zip(self.lengths, self.periodic, strict=True)
        ]
        self.inside = tuple(inside)
        self.sides = tuple(
            length / n if around else side
            for length, n, around in zip(self.lengths, inside, self.periodic, strict=True)
        )
        # A centre exactly on the upper face belongs to one more block; it and the wall layers share the margin.
        self.shape = tuple(n + 2 * MARGIN + 1 for n in inside)
        self.blocks = math.prod(self.shape)
        self.cells = self.blocks * CELLS_PER_BLOCK
        self.row_length = self.shape[0] * CELLS_PER_BLOCK
        self.block_strides = tuple(math.prod(self.shape[:d]) for d in range(self.dim))
        offsets = np.stack(np.meshgrid(*[[-1, 0, 1]] * self.dim, indexing="ij"), axis=-1).reshape(-1, self.dim)
        self.offsets = [tuple(map(int, offset)) for offset in offsets if offset.any()]
        self.neighbour_strides = [int(np.array(o) @ np.array(self.block_strides)) for o in self.offsets]
        """Index differences to the 8 (26) blocks around a block, where no periodic axis is crossed."""

    @ti.func
    def beside(self, block, k: ti.template()):
        """Index of the k-th of the 8 (26) blocks around `block`."""
        other = block + self.neighbour_strides[k]
        for d in ti.static(range(self.dim)):
            if ti.static(self.periodic[d] and self.offsets[k][d] != 0):
                step, stride, inside = ti.static(self.offsets[k][d], self.block_strides[d], self.inside[d])
                place = (block // stride) % self.shape[d] + step
                if place < MARGIN:
                    other += inside * stride
                elif place >= MARGIN + inside:
                    other -= inside * stride
        return other

    def spread(self, flags: np.ndarray) -> np.ndarray:
        """Flag also the blocks around flagged ones; (blocks,) booleans."""
        grid = flags.reshape(self.shape[::-1])
        for axis, (around, inside) in enumerate(zip(self.periodic[::-1], self.inside[::-1], strict=True)):
            if around:  # the margins hold a copy of the other end
                grid = np.swapaxes(grid.copy(), 0, axis)
                grid[0], grid[MARGIN + inside] = grid[inside], grid[MARGIN]
                grid = np.swapaxes(grid, 0, axis)
        copied = grid.reshape(-1)
        spread = copied.copy()
        for stride in self.neighbour_strides:
            spread |= np.roll(copied, stride)
        return spread

    @ti.func
    def place(self, x):
        """Nearest point of the domain box to `x` [m], along periodic axes the one that stands for it.

        Also turns NaN into a corner, so no index ever leaves the grid.
        """
        y = x
        for d in ti.static(range(self.dim)):
            if ti.static(self.periodic[d]):
                y[d] -= self.lengths[d] * ti.floor((x[d] - self.lower[d]) * (1.0 / self.lengths[d]))
            y[d] = ti.min(ti.max(y[d], self.lower[d]), self.upper[d])
        return y

    @ti.func
    def difference(self, x_i, x_j):
        """x_i - x_j [m], along periodic axes to the nearest of the images of j."""
        x_ij = x_i - x_j
        for d in ti.static(range(self.dim)):
            if ti.static(self.periodic[d]):
                x_ij[d] -= self.lengths[d] * ti.floor(x_ij[d] * (1.0 / self.lengths[d]) + 0.5)
        return x_ij

    @ti.func
    def column(self, x):
        """Cell number along x of coordinate `x` [m]."""
        scale = CELLS_PER_BLOCK / self.sides[0]
        return ti.cast(ti.floor((x - self.lower[0]) * scale), ti.i32) + MARGIN * CELLS_PER_BLOCK

    @ti.func
    def row(self, x):
        """Number of the row of blocks that holds position `x` [m], (dim,)."""
        number = 0
        for d in ti.static(range(1, self.dim)):
            step = ti.cast(ti.floor((x[d] - self.lower[d]) * (1.0 / self.sides[d])), ti.i32) + MARGIN
            if ti.static(self.periodic[d]):  # where the upper face is the lower one
                step = ti.min(step, MARGIN + self.inside[d] - 1)
            number += step * (self.block_strides[d] // self.shape[0])
        return number

    @ti.func
    def cell(self, x):
        """Cell index of position `x` [m], (dim,), which must lie in the domain or its margin."""
        column = self.column(x[0])
        if ti.static(self.periodic[0]):
            column = ti.min(column, (MARGIN + self.inside[0]) * CELLS_PER_BLOCK - 1)
        return self.row(x) * self.row_length + column

    @ti.func
    def row_beside(self, row, dy, dz):
        """Number of the row of blocks `dy` and `dz` rows further, in two dimensions `dy` alone."""
        other = row + dy
        if ti.static(self.dim == 3):
            other += dz * self.shape[1]
        if ti.static(self.periodic[1]):
            y = row % self.shape[1] + dy
            if y < MARGIN:
                other += self.inside[1]
            elif y >= MARGIN + self.inside[1]:
                other -= self.inside[1]
        if ti.static(self.dim == 3 and self.periodic[-1]):
            z = row // self.shape[1] + dz
            if z < MARGIN:
                other += self.inside[2] * self.shape[1]
            elif z >= MARGIN + self.inside[2]:
                other -= self.inside[2] * self.shape[1]
        return other

    def cell_numpy(self, x: np.ndarray) -> np.ndarray:
        """The same for a NumPy array of positions [m], (N, dim)."""
        column = np.floor((x[:, 0] - self.lower[0]) * (CELLS_PER_BLOCK / self.sides[0])).astype(np.int64)
        cell = column + MARGIN * CELLS_PER_BLOCK
        for d in range(1, self.dim):
            step = np.floor((x[:, d] - self.lower[d]) / self.sides[d]).astype(np.int64) + MARGIN
            cell += step * self.block_strides[d] * CELLS_PER_BLOCK
        return cell


@ti.data_oriented
class BlockGrid:
    """Sorts the `alive[None]` first of up to `count` particles (all, if `alive` is None) into cells.

    `order[k]` is the particle at place k; cell c holds places `start[c] .. start[c+1]`. `occupied` lists the blocks that hold
    somebody, ascending, `occupied_count[None]` of them.

    Within a cell particles stand in order of their id, so the result depends on positions alone: not on threads, not on
    history. On a GPU it is a counting sort, with two passes over the particles and two over the cells; on a CPU `Resorting`
    changes what was there.
    """

    cells_each = CELLS_PER_BLOCK
    transient = frozenset(
        {
            "rank",
            "cell_count",
            "vacated",
            "vacated_count",
            "serial",
            "resorting",
            "scan",
            "occupied_flag",
            "occupied_start",
            "occupied_scan",
        }
    )

    def __init__(self, geometry: Geometry, count: int, alive: ti.Field | None = None) -> None:
        self.geometry = geometry
        self.alive = ti.field(ti.i32, ()) if alive is None else alive
        if alive is None:
            self.alive[None] = count
        self.cell_of = ti.field(ti.i32, count)
        self.cell_of.fill(-1)
        self.rank = ti.field(ti.i32, count)
        self.order = ti.field(ti.i32, count)
        self.order.from_numpy(np.arange(count, dtype=np.int32))
        self.cell_count = ti.field(ti.i32, geometry.cells)
        self.start = ti.field(ti.i32, geometry.cells + 1)
        self.occupied = ti.field(ti.i32, geometry.blocks)
        self.serial = on_cpu()
        if self.serial:
            self.resorting = Resorting(self, count)
            self.occupied_count = ti.field(ti.i32, ())
        else:
            self.scan = ExclusiveScan(self.cell_count, self.start)
            self.occupied_flag = ti.field(ti.i32, geometry.blocks)
            self.occupied_start = ti.field(ti.i32, geometry.blocks + 1)
            self.occupied_scan = ExclusiveScan(self.occupied_flag, self.occupied_start)
            self.occupied_count = self.occupied_scan.total
        self.tracks_arrivals = self.tracks_vacated = False

    def track_arrivals(self) -> None:
        """From now on note in `arrived`, (blocks,), by a 1 which blocks a particle has come into; who reads it changes it.

        Now and then, after particles were reordered in memory, `Simulation` has all blocks count. Has to be called before the
        first sort.
        """
        self.tracks_arrivals = True
        self.arrived = ti.field(ti.i32, self.geometry.blocks)

    def track_vacated(self) -> None:
        """From now on list in `vacated` the `vacated_count[None]` blocks that nobody is in any more since the last update.

        Has to be called before the first sort.
        """
        if not self.tracks_vacated:
            self.tracks_vacated = True
            self.vacated = ti.field(ti.i32, self.geometry.blocks)
            self.vacated_count = ti.field(ti.i32, ())

    def forget(self) -> None:
        """Take note that particles have other entries now: nobody is where its entry was, so all count as new in their blocks."""
        self.cell_of.fill(-1)
        self.start.fill(0)
        self.restored()

    def restored(self) -> None:
        """Take note that what is not transient has been put back to what it was at another time."""
        if self.serial:
            self.resorting.restored()

    @ti.func
    def insert_all(self, locate: ti.template(), now, tick):
        """`insert` every particle `i` at `locate(i, now, tick)` [m]; to be called at the outermost level of a kernel.

        That, or an `insert` of every particle, and then `sort`, sorts anew.
        """
        if ti.static(self.serial):
            self.resorting.insert_all(locate, now, tick)
        else:
            for i in range(self.alive[None]):
                self.insert(i, locate(i, now, tick))

    @ti.func
    def insert(self, i, x):
        """Count particle `i` at position `x` [m] into its cell."""
        cell = self.geometry.cell(x)
        if self.cell_of[i] != cell:
            self.change(i, cell)
        if ti.static(not self.serial):
            self.rank[i] = ti.atomic_add(self.cell_count[cell], 1)

    @ti.func
    def change(self, i, cell):
        """Note that particle `i`, which was in another cell, is in `cell` now."""
        before = self.cell_of[i]
        self.cell_of[i] = cell
        if ti.static(self.tracks_arrivals):
            if self.block_of(before) != self.block_of(cell):
                self.arrived[self.block_of(cell)] = 1
        if ti.static(self.serial):
            self.resorting.insert(i, before, cell)

    @ti.func
    def sort(self, identity: ti.template()):
        """Sort all that have been inserted, in a cell in the order of `identity`, at the outermost level of a kernel."""
        if ti.static(self.serial):
            self.resorting.sort(identity)
            if ti.static(self.tracks_vacated):
                self.list_vacated()
            self.resorting.finish()
        else:
            self.scan.scan()
            for i in range(self.alive[None]):
                self.order[self.start[self.cell_of[i]] + self.rank[i]] = i
            if ti.static(self.tracks_vacated):
                self.list_vacated()
            self.list_occupied()
            for m in range(self.occupied_count[None]):
                for part in range(CELLS_PER_BLOCK):
                    self.sort_cell(identity, self.occupied[m] * CELLS_PER_BLOCK + part)

    @ti.func
    def sort_cell(self, identity: ti.template(), cell):
        """Bring the particles of a cell into the order of their ids."""
        self.cell_count[cell] = 0  # for the next update
        first = self.start[cell]
        for k in range(first + 1, self.start[cell + 1]):  # insertion sort: a cell holds a handful
            particle = self.order[k]
            key = identity[particle]
            m = k - 1
            while m >= first and identity[self.order[m]] > key:
                self.order[m + 1] = self.order[m]
                m -= 1
            self.order[m + 1] = particle

    @ti.func
    def list_vacated(self):
        """Find the blocks that were occupied and no longer are."""
        self.vacated_count[None] = 0
        for m in range(self.occupied_count[None]):
            if self.is_empty(self.occupied[m]):
                self.vacated[ti.atomic_add(self.vacated_count[None], 1)] = self.occupied[m]

    @ti.func
    def list_occupied(self):
        """Find the blocks that are occupied."""
        for block in range(self.geometry.blocks):
            self.occupied_flag[block] = ti.cast(not self.is_empty(block), ti.i32)
        self.occupied_scan.scan()
        for block in range(self.geometry.blocks):
            if self.occupied_flag[block] == 1:
                self.occupied[self.occupied_start[block]] = block

    @ti.func
    def is_empty(self, block):
        """Whether a block held nobody at the last update."""
        return self.first(block) == self.first(block + 1)

    @ti.func
    def block(self, i):
        """Index of the block that held particle `i` at the last update."""
        return self.block_of(self.cell_of[i])

    @ti.func
    def block_of(self, cell):
        """Index of the block that `cell` is part of."""
        return cell // CELLS_PER_BLOCK

    @ti.func
    def first(self, block):
        """First place of a block's particles; the first of block + 1 ends them."""
        return self.start[block * CELLS_PER_BLOCK]


def make_neighbour_sum(
    geometry: Geometry,
    start: ti.Field,
    pair: Callable[..., Any],
    width: int,
    backend: Backend,
    lanes: int | None = None,
) -> Callable[..., Any]:
    """Return a ti.func `total(i, x, cell)`: the sum of `pair(i, j)`, a vector of `width`, over all j near `x` [m].

    `cell` is the one that `x` was sorted into. j runs over places of the sorted arrays that `start` indexes; pairs beyond the
    support are offered too, so `pair` must vanish there by itself. The inner loop has a constant length on the CPU
    (`lanes`, by default `Backend.lanes`; with 1 it is a plain one, which is quicker to compile).
    """
    lanes = lanes or backend.lanes
    dtype = backend.dtype
    row_length = geometry.row_length

    @ti.func
    def sum_range(i, low, high):
        total = ti.Vector.zero(dtype, width)
        if ti.static(lanes == 1):
            for j in range(low, high):
                total += pair(i, j)
        else:
            for chunk in range((high - low + (lanes - 1)) // lanes):
                part = ti.Vector.zero(dtype, width)
                base = low + chunk * lanes
                for lane in range(lanes):
                    j = base + lane
                    part += pair(i, j) * ti.cast(j < high, dtype)
                total += part
        return total

    first = MARGIN * CELLS_PER_BLOCK
    around = geometry.inside[0] * CELLS_PER_BLOCK

    @ti.func
    def sum_row(i, row, low, high):
        base = row * row_length
        total = ti.Vector.zero(dtype, width)
        if ti.static(geometry.periodic[0]):
            total += sum_range(i, start[base + ti.max(low, first)], start[base + ti.min(high, first + around)])
            if low < first:
                total += sum_range(i, start[base + low + around], start[base + first + around])
            elif high > first + around:
                total += sum_range(i, start[base + first], start[base + high - around])
        else:
            total = sum_range(i, start[base + low], start[base + high])
        return total

    @ti.func
    def sum_all(i, x, cell):
        total = ti.Vector.zero(dtype, width)
        low = geometry.column(x[0] - geometry.reach)
        high = geometry.column(x[0] + geometry.reach) + 1
        row = cell // row_length
        if ti.static(geometry.dim == 2):
            for dy in range(-1, 2):
                total += sum_row(i, geometry.row_beside(row, dy, 0), low, high)
        else:
            for dz in range(-1, 2):
                for dy in range(-1, 2):
                    total += sum_row(i, geometry.row_beside(row, dy, dz), low, high)
        return total

    return sum_all
