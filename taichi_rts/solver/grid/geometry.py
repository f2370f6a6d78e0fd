"""How space is cut into blocks and cells, all of which are kept; `tiles.py` keeps some."""

import math
from collections.abc import Sequence

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.device.counts import CELLS_PER_BLOCK

MARGIN = 1  # blocks around the domain, so that no neighbour index leaves the grid; wall particles lie there


@ti.data_oriented
class Geometry:
    """How space is cut: origin [m], block side [m], shape in blocks with margin.

    With `drift` zero a block's side is the support radius. Where the grid serves for longer than one step, particles may
    drift by up to `drift` [m] from where they were sorted in, and two that interact by twice that: the side grows by as much,
    so that they still lie in neighbouring blocks, and `reach` is how far from a particle its neighbours were sorted in.

    Along a `periodic` axis blocks are a little longer, so that a whole number fits, and the first lies beside the last.

    Blocks and cells are numbered with x fastest. What is kept for each lies at its number, and the `blocks` and `cells` there
    are places for. All else asks for neighbours by `beside`, `across`, `first_cell` and `base_beside`.
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

    @property
    def across_count(self) -> int:
        """Number of rows of blocks in and around a row: 9, in two dimensions 3."""
        return int(3 ** (self.dim - 1))

    @ti.func
    def number(self, block):
        """Number of `block` among all of the domain and its margin."""
        return block

    @ti.func
    def step(self, block, axis: ti.template()):
        """How many blocks `block` lies from the first along `axis`, that of the margin."""
        return (block // self.block_strides[axis]) % self.shape[axis]

    @ti.func
    def across(self, block, k: ti.template()):
        """Index of the block across x from `block` in the k-th row in and around its own, on axes that are not periodic."""
        other = block + (k % 3 - 1) * self.block_strides[1]
        if ti.static(self.dim == 3):
            other += (k // 3 - 1) * self.block_strides[2]
        return other

    @ti.func
    def run_of(self, block):
        """Row and column of `block`, which `block_at` and `first_cell` take; in a run along x columns follow each other."""
        return block // self.shape[0], block % self.shape[0]

    @ti.func
    def columns_behind(self, column):
        """How many columns follow on `column` in a row at least."""
        return self.shape[0] - 1 - column

    @ti.func
    def block_at(self, row, column):
        """Index of the block at `column` of `row`."""
        return row * self.shape[0] + column

    @ti.func
    def first_cell(self, row, column, above):
        """First cell of the block at `column` in the row number `above` (0-8, or 0-2) of those in and around `row`."""
        place = column
        if ti.static(self.periodic[0]):
            if place < MARGIN:
                place += self.inside[0]
            elif place >= MARGIN + self.inside[0]:
                place -= self.inside[0]
        other = self.row_beside(row, above % 3 - 1, above // 3 - 1)
        return other * self.row_length + place * CELLS_PER_BLOCK

    @ti.func
    def base_beside(self, cell, dy, dz):
        """Number to which a column of cells is added for its cell in the row `dy` and `dz` further than that of `cell`."""
        return self.row_beside(cell // self.row_length, dy, dz) * self.row_length

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
    def has_left(self, cell, x):
        """Whether position `x` [m], (dim,), does not lie in `cell`, or that is negative."""
        return self.cell(x) != cell

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
