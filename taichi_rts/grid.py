"""The dense block grid: blocks of side r, each cut along x into cells; counting sort, cell ranges, neighbour sums.

Blocks are the unit of the paper (one step per block). Cells are finer along x only: particles sorted by cell with x
fastest make the neighbours of a particle in one row one contiguous range, and finer cells make that range shorter.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import taichi as ti

from taichi_rts.backend import Backend
from taichi_rts.scan import ExclusiveScan

CELLS_PER_BLOCK = 2  # measured: 1, 2, 4, 8 cells take 225, 203, 269, 321 ns per particle and core in a density pass
MARGIN = 1  # blocks around the domain, so that no neighbour index leaves the grid; wall particles lie there


@ti.data_oriented
class Geometry:
    """How space is cut: origin [m], block side [m], shape in blocks with margin.

    With `drift` zero a block's side is the support radius. Where the grid serves for longer than one step, particles may
    drift by up to `drift` [m] from where they were sorted in, and two that interact by twice that: the side grows by as much,
    so that they still lie in neighbouring blocks, and `reach` is how far from a particle its neighbours were sorted in.
    """

    def __init__(self, lower: Sequence[float], upper: Sequence[float], support: float, drift: float = 0.0) -> None:
        self.dim = len(lower)
        self.lower = tuple(lower)
        self.upper = tuple(upper)
        self.side = side = support + 2.0 * drift
        self.drift = drift
        self.reach = support + drift
        inside = [max(1, math.ceil((b - a) / side - 1e-9)) for a, b in zip(lower, upper, strict=True)]
        # A centre exactly on the upper face belongs to one more block; it and the wall layers share the margin.
        self.shape = tuple(n + 2 * MARGIN + 1 for n in inside)
        self.blocks = math.prod(self.shape)
        self.cells = self.blocks * CELLS_PER_BLOCK
        self.row_length = self.shape[0] * CELLS_PER_BLOCK
        self.block_strides = tuple(math.prod(self.shape[:d]) for d in range(self.dim))
        offsets = np.stack(np.meshgrid(*[[-1, 0, 1]] * self.dim, indexing="ij"), axis=-1).reshape(-1, self.dim)
        self.neighbour_strides = [int(o @ np.array(self.block_strides)) for o in offsets if o.any()]
        """Index differences to the 8 (26) blocks around a block."""

    @ti.func
    def clamp(self, x):
        """Nearest point of the domain box to `x` [m]; also turns NaN into a corner, so no index ever leaves the grid."""
        y = x
        for d in ti.static(range(self.dim)):
            y[d] = ti.min(ti.max(x[d], self.lower[d]), self.upper[d])
        return y

    @ti.func
    def column(self, x):
        """Cell number along x of coordinate `x` [m]."""
        return ti.cast(ti.floor((x - self.lower[0]) * (CELLS_PER_BLOCK / self.side)), ti.i32) + MARGIN * CELLS_PER_BLOCK

    @ti.func
    def row(self, x):
        """Number of the row of blocks that holds position `x` [m], (dim,)."""
        number = 0
        for d in ti.static(range(1, self.dim)):
            step = ti.cast(ti.floor((x[d] - self.lower[d]) * (1.0 / self.side)), ti.i32) + MARGIN
            number += step * (self.block_strides[d] // self.shape[0])
        return number

    @ti.func
    def cell(self, x):
        """Cell index of position `x` [m], (dim,), which must lie in the domain or its margin."""
        return self.row(x) * self.row_length + self.column(x[0])

    def cell_numpy(self, x: np.ndarray) -> np.ndarray:
        """The same for a NumPy array of positions [m], (N, dim)."""
        column = np.floor((x[:, 0] - self.lower[0]) * (CELLS_PER_BLOCK / self.side)).astype(np.int64)
        cell = column + MARGIN * CELLS_PER_BLOCK
        for d in range(1, self.dim):
            step = np.floor((x[:, d] - self.lower[d]) / self.side).astype(np.int64) + MARGIN
            cell += step * self.block_strides[d] * CELLS_PER_BLOCK
        return cell


@ti.data_oriented
class BlockGrid:
    """Sorts particles into cells. `order[k]` is the particle at place k; cell c holds places `start[c] .. start[c+1]`.

    Within a cell particles stand in order of their id, so the result depends on positions alone: not on threads, not on
    history. Work: two passes over the particles, two over the cells.
    """

    def __init__(self, geometry: Geometry, count: int) -> None:
        self.geometry = geometry
        self.count = count
        self.cell_of = ti.field(ti.i32, count)
        self.rank = ti.field(ti.i32, count)
        self.order = ti.field(ti.i32, count)
        self.order.from_numpy(np.arange(count, dtype=np.int32))
        self.cell_count = ti.field(ti.i32, geometry.cells)
        self.start = ti.field(ti.i32, geometry.cells + 1)
        self.scan = ExclusiveScan(self.cell_count, self.start)

    def update(self, locate: Callable[..., Any], identity: ti.Field, *time: Any) -> None:
        """Sort anew. `locate(*time)` is a kernel that calls `insert` once for every particle."""
        self.cell_count.fill(0)
        locate(*time)
        self.scan.run()
        self.place_particles()
        self.order_cells(identity)

    @ti.func
    def insert(self, i, x):
        """Count particle `i` at position `x` [m] into its cell."""
        cell = self.geometry.cell(x)
        self.cell_of[i] = cell
        self.rank[i] = ti.atomic_add(self.cell_count[cell], 1)

    @ti.kernel
    def place_particles(self):
        for i in range(self.count):
            self.order[self.start[self.cell_of[i]] + self.rank[i]] = i

    @ti.kernel
    def order_cells(self, identity: ti.template()):
        for c in range(self.geometry.cells):
            first = self.start[c]
            for k in range(first + 1, self.start[c + 1]):  # insertion sort: a cell holds a handful
                particle = self.order[k]
                key = identity[particle]
                m = k - 1
                while m >= first and identity[self.order[m]] > key:
                    self.order[m + 1] = self.order[m]
                    m -= 1
                self.order[m + 1] = particle

    @ti.func
    def block(self, i):
        """Index of the block that held particle `i` at the last update."""
        return self.cell_of[i] // CELLS_PER_BLOCK

    @ti.func
    def first(self, block):
        """First place of a block's particles; the first of block + 1 ends them."""
        return self.start[block * CELLS_PER_BLOCK]


def make_neighbour_sum(
    geometry: Geometry, start: ti.Field, pair: Callable[..., Any], width: int, backend: Backend
) -> Callable[..., Any]:
    """Return a ti.func `total(i, x, cell)`: the sum of `pair(i, j)`, a vector of `width`, over all j near `x` [m].

    `cell` is the one that `x` was sorted into. j runs over places of the sorted arrays that `start` indexes; pairs beyond the
    support are offered too, so `pair` must vanish there by itself. The inner loop has a constant length on the CPU
    (`Backend.lanes`).
    """
    lanes = backend.lanes
    dtype = backend.dtype
    rows = [stride // geometry.shape[0] for stride in geometry.block_strides[1:]]
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

    @ti.func
    def sum_all(i, x, cell):
        total = ti.Vector.zero(dtype, width)
        low = geometry.column(x[0] - geometry.reach)
        high = geometry.column(x[0] + geometry.reach) + 1
        row = cell // row_length
        if ti.static(geometry.dim == 2):
            for dy in range(-1, 2):
                base = (row + dy) * row_length
                total += sum_range(i, start[base + low], start[base + high])
        else:
            for dz in range(-1, 2):
                for dy in range(-1, 2):
                    base = (row + dy * rows[0] + dz * rows[1]) * row_length
                    total += sum_range(i, start[base + low], start[base + high])
        return total

    return sum_all
