"""Sums over all neighbours of the due particles: the inner loops of the solver, one way for CPUs and one for GPUs.

On a GPU a thread handles a particle and goes over the rows of cells around it. On a CPU a thread handles a run of blocks along
x. It gathers the particles in and around them into a window: the nine rows of blocks (three in two dimensions) around the run,
column of cells by column of cells, one array for each quantity. The possible neighbours of a particle are then one contiguous
range, for which LLVM makes vector instructions with a single sum at the end (docs/evidence/speed.md has the figures).
"""

import math
from collections.abc import Sequence
from typing import Any

from taichi_rts.device.backend import Backend, threads, ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.device.fields import Declared, Part, integers, within
from taichi_rts.solver.grid.geometry import MARGIN, Geometry
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.fields import components
from taichi_rts.solver.particles.neighbourhood import Neighbourhood

RUN = 16  # most blocks that share a window
COLUMNS = (RUN + 2) * CELLS_PER_BLOCK + 1  # of cells of a window, and one that ends the last
VECTOR = 32
"""Loops run to a multiple of it, or LLVM leaves a scalar remainder; the padding there is too far away to count."""
ROOM = 1.5  # of a window, over what lies around a run of blocks at rest
AT_ONCE = {2: 1, 3: 8}
"""Fluid entries that are copied as one vector, by dimension: mostly all of a cell's, so that no branch is mispredicted.

In two dimensions, and on walls, cells hold so few that it gains nothing and takes longer to compile. No more than lists have room
for behind their last entry (`Backend.lanes`), and windows (`VECTOR`).
"""
INDEX = 0x0FFFFFFF
"""Masks an index, by which LLVM sees that adding a few does not overflow; else it would not find out that they are one vector.

Where there are more entries than that they are copied one by one.
"""
FAR = 1e3  # distance over the support radius of the padding behind the last entry


def room(dim: int, per_block: float) -> int:
    """Particles that a window has room for, on fluid of `per_block` particles a block."""
    return math.ceil(ROOM * 3 ** (dim - 1) * (RUN + 2) * per_block)


def entries(capacity: int) -> int:
    """Entries of the windows of all threads together, of which each has room for `capacity` particles."""
    return threads() * (capacity + VECTOR)


@ti.data_oriented
class Windows(Part):
    """A window for every thread on what `start` has sorted into cells; each has room for `capacity` entries.

    One for every thread, not for every task, because it then stays in that core's cache.
    """

    transient = frozenset({"start", "column_start", "own_start"})

    def __init__(self, geometry: Geometry, start: ti.Field, capacity: int, at_once: int) -> None:
        self.geometry = geometry
        self.start = start
        self.rows = 3 ** (geometry.dim - 1)
        self.row_count = ti.field(ti.i32, ())
        """`rows` as a loop bound LLVM does not know: it would unroll the loop, which takes three times as long to compile."""
        self.row_count[None] = self.rows
        self.at_once = at_once
        self.stride = ti.field(ti.i32, ())
        """`at_once` as a step that LLVM does not know, for the same reason."""
        self.stride[None] = at_once
        self.capacity = capacity
        self.size = capacity + VECTOR
        self.entries = entries(capacity)
        self.columns = COLUMNS
        self.make_fields(self.column_fields())
        self.far = geometry.upper[0] + FAR * geometry.reach

    @staticmethod
    def column_fields() -> list[Declared]:
        """Declare the first entry of each column of a window, which ends that before it, and of those in the run's own row."""
        return integers(threads() * COLUMNS, "column_start", "own_start")

    def copies(self, names: Sequence[str], source: Any, copy: Any) -> list[tuple[ti.Field, ti.Field, float, int]]:
        """List field, copy, value of the padding, and axis (-1 if not a position), of each scalar of `names` of two objects."""
        found = []
        for name in names:
            one, two = getattr(source, name), getattr(copy, name)
            if isinstance(one, ti.MatrixField):
                place = name == "x"
                found += [
                    (of, to, self.far if place else 0.0, d if place else -1)
                    for d, (of, to) in enumerate(zip(components(one), components(two), strict=True))
                ]
            else:
                found.append((one, two, 1.0 if name == "rho" else 0.0, -1))
        return found

    @ti.func
    def count(self, row, column):
        """Number of particles in the blocks at `column` in all rows around `row`."""
        total = 0
        for above in range(self.rows):
            cell = self.geometry.first_cell(row, column, above)
            total += self.start[cell + CELLS_PER_BLOCK] - self.start[cell]
        return total

    @ti.func
    def gather(self, copies: ti.template(), row, column, number, begin):
        """Copy the particles of the blocks at `column` to entry `begin` and on, as columns `number` and on; return the end."""
        n = begin
        rows = self.row_count[None]
        for part in range(CELLS_PER_BLOCK):
            self.column_start[number + part] = n
            for above in range(rows):
                if above == self.rows // 2:
                    self.own_start[number + part] = n
                cell = self.geometry.first_cell(row, column, above) + part
                first, last = self.start[cell], self.start[cell + 1]
                k = first
                # Seldom more than once; what is copied beyond `last`, or of an empty cell, the next overwrites.
                while True:
                    self.copy(copies, self.bounded(k), self.bounded(n + k - first), row, column, above)
                    k += self.stride[None]
                    if k >= last:
                        break
                n += last - first
        return n

    @ti.func
    def bounded(self, index):
        """The same `index`, for LLVM to see that it is no more than `INDEX`."""
        return index & INDEX if ti.static(self.at_once > 1) else index

    @ti.func
    def copy(self, copies: ti.template(), k, n, row, column, above):
        """Copy `at_once` entries from `k` on, which lie in the block at `column` in row `above` of those around `row`, to `n`."""
        for field, copy, _padding, axis in ti.static(copies):
            values = ti.Vector([field[k + lane] for lane in ti.static(range(self.at_once))])
            if ti.static(axis >= 0 and self.geometry.periodic[axis]):
                middle = self.middle(row, column, above, axis)
                length = ti.static(self.geometry.lengths[axis])
                for lane in ti.static(range(self.at_once)):
                    beside = values[lane] - middle  # the image that lies where the window does
                    values[lane] = middle + beside - length * ti.floor(beside / length + 0.5)
            for lane in ti.static(range(self.at_once)):
                copy[n + lane] = values[lane]

    @ti.func
    def middle(self, row, column, above, axis: ti.template()):
        """Coordinate [m] along `axis` of the middle of a block, counted on beyond periodic faces."""
        place = column
        if ti.static(axis == 1):
            place = row % self.geometry.shape[1] + above % 3 - 1
        if ti.static(axis == 2):
            place = row // self.geometry.shape[1] + above // 3 - 1
        return self.geometry.lower[axis] + (place - MARGIN + 0.5) * self.geometry.sides[axis]

    @ti.func
    def close(self, copies: ti.template(), number, end):
        """Pad the window behind the last entry, so that loops may run on there."""
        self.column_start[number] = end
        for _field, copy, padding, _axis in ti.static(copies):
            for n in range(end, end + VECTOR):
                copy[n] = padding

    @ti.func
    def near(self, number):
        """First and last entry + 1 of those near a particle in column `number`, up to a multiple of `VECTOR`."""
        low, high = self.column_start[number - CELLS_PER_BLOCK], self.column_start[number + CELLS_PER_BLOCK + 1]
        return low, low + (high - low + (VECTOR - 1)) // VECTOR * VECTOR


class FluidWindows(Windows):
    """Windows on the fluid: entries of the `Neighbourhood` `inside`; `per_block` is how many particles a block holds at rest."""

    transient = frozenset({"inside"})

    def __init__(self, near: Neighbourhood, grid: BlockGrid, per_block: float, backend: Backend, needs: Any) -> None:
        dim = grid.geometry.dim
        capacity = room(dim, per_block)
        few = max(near.x.shape[0], entries(capacity)) <= INDEX
        super().__init__(grid.geometry, grid.start, capacity, AT_ONCE[dim] if few else 1)
        self.inside = Neighbourhood(self.entries, dim, backend, needs)
        """Its positions are unrolled along periodic axes."""

    @classmethod
    def fields(cls, dim: int, capacity: int, padding: int, needs: Any) -> list[Declared]:
        """Declare the fields of windows with room for `capacity` particles each."""
        inside = Neighbourhood.fields(entries(capacity), dim, padding, needs)
        return cls.column_fields() + within("inside", inside)


class WallWindows(Windows):
    """Windows on the particles of a wall at rest, `inside`."""

    transient = frozenset({"inside"})

    def __init__(self, wall: Any) -> None:
        super().__init__(wall.geometry, wall.start, wall.densest_column() * (RUN + 2), 1)
        self.inside = wall.room_for(self.entries)

    @classmethod
    def fields(cls, inside: list[Declared]) -> list[Declared]:
        """Declare the fields of windows `inside` which the wall's particles have these."""
        return cls.column_fields() + within("inside", inside)
