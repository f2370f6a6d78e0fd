"""Sums over all neighbours of the due particles: the inner loops of the solver, one way for CPUs and one for GPUs.

On a GPU a thread has a particle and walks over the rows of cells around it. On a CPU a thread has a run of blocks along x. It
gathers what lies in them and around them into a window: the nine rows of blocks (three in two dimensions) that surround the run,
column of cells by column of cells, one array for each quantity. What lies near a particle is then one contiguous range, over
which LLVM makes vector instructions with a single sum at the end (docs/speed.md has the figures).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import taichi as ti

from taichi_rts.backend import CHUNK, Backend, threads
from taichi_rts.grid import CELLS_PER_BLOCK, MARGIN, BlockGrid, Geometry, make_neighbour_sum
from taichi_rts.particles import Neighbourhood, components
from taichi_rts.physics.walls import make_wall_sum

TASKS = 64  # shares of the due particles that threads take one by one
RUN = 16  # most blocks that share a window
VECTOR = 32
"""Loops go on to a multiple of it, or LLVM leaves a scalar remainder; who lies there is too far away to count."""
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
FAR = 1e3  # distance over the support radius of those behind the last


def room(dim: int, per_block: float) -> int:
    """Particles that a window has room for, on fluid of `per_block` particles a block."""
    return math.ceil(ROOM * 3 ** (dim - 1) * (RUN + 2) * per_block)


def entries(capacity: int) -> int:
    """Entries of the windows of all threads together, of which each has room for `capacity` particles."""
    return threads() * (capacity + VECTOR)


@ti.data_oriented
class Windows:
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
        self.columns = (RUN + 2) * CELLS_PER_BLOCK + 1
        self.column_start = ti.field(ti.i32, threads() * self.columns)
        """First entry of each column of a window; the next one's ends it."""
        self.own_start = ti.field(ti.i32, threads() * self.columns)
        """First entry of those in the run's own row."""
        self.far = geometry.upper[0] + FAR * geometry.reach

    def copies(self, names: Sequence[str], source: Any, copy: Any) -> list[tuple[ti.Field, ti.Field, float, int]]:
        """List field, copy, what stands for nobody, and axis (-1 if not a position), of each scalar of `names` of two objects."""
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
    def cell(self, row, column, above):
        """First cell of the block at `column` [blocks] in the row of blocks number `above` (0-8) of those around `row`."""
        place = column
        if ti.static(self.geometry.periodic[0]):
            if place < MARGIN:
                place += self.geometry.inside[0]
            elif place >= MARGIN + self.geometry.inside[0]:
                place -= self.geometry.inside[0]
        other = self.geometry.row_beside(row, above % 3 - 1, above // 3 - 1)
        return other * self.geometry.row_length + place * CELLS_PER_BLOCK

    @ti.func
    def count(self, row, column):
        """Number of particles in the blocks at `column` in all rows around `row`."""
        total = 0
        for above in range(self.rows):
            cell = self.cell(row, column, above)
            total += self.start[cell + CELLS_PER_BLOCK] - self.start[cell]
        return total

    @ti.func
    def gather(self, copies: ti.template(), row, column, number, begin):
        """Copy who lies in the blocks at `column` to entry `begin` and on, as the columns `number` and on; return the end."""
        n = begin
        rows = self.row_count[None]
        for part in range(CELLS_PER_BLOCK):
            self.column_start[number + part] = n
            for above in range(rows):
                if above == self.rows // 2:
                    self.own_start[number + part] = n
                cell = self.cell(row, column, above) + part
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
        for field, copy, _nobody, axis in ti.static(copies):
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
        """Let nobody stand behind the last entry, so that loops may go on there."""
        self.column_start[number] = end
        for _field, copy, nobody, _axis in ti.static(copies):
            for n in range(end, end + VECTOR):
                copy[n] = nobody

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


class WallWindows(Windows):
    """Windows on the particles of a wall at rest, `inside`."""

    transient = frozenset({"inside"})

    def __init__(self, wall: Any) -> None:
        geometry = wall.geometry
        counts = np.diff(wall.start.to_numpy()[::CELLS_PER_BLOCK]).reshape(geometry.shape[::-1])
        for axis in range(geometry.dim - 1):
            counts = counts + np.roll(counts, 1, axis) + np.roll(counts, -1, axis)
        super().__init__(geometry, wall.start, int(counts.max()) * (RUN + 2), 1)
        self.inside = wall.room_for(self.entries)


@ti.data_oriented
class NeighbourSum:
    """Sums of `pair(near, i, j)` over the fluid near each due particle, and of `make_wall_pair(wall)(k, b)` over all walls.

    Both are vectors of `width`. `near` is where i and j are to be read: `Neighbourhood` itself, or a window of it; `names` lists
    the quantities that `pair` reads there, `wall_names` those that wall pairs read of a wall. Pairs beyond the support are
    offered too, so they must vanish there by themselves.
    """

    transient = frozenset({"dtype", "copies", "wall_copies", "windows", "by_windows"})

    def __init__(
        self,
        pair: Callable[..., Any],
        make_wall_pair: Callable[[Any], Callable[..., Any]],
        width: int,
        names: Sequence[str],
        wall_names: Sequence[str],
        near: Neighbourhood,
        grid: BlockGrid,
        windows: FluidWindows | None,
        walls: Sequence[Any],
        backend: Backend,
    ) -> None:
        self.width = width
        self.near = near
        self.grid = grid
        self.pair = pair
        self.dtype = backend.dtype
        self.by_windows = windows is not None
        wall: Any = next((wall for wall in walls if wall.windows is not None), None)
        self.wall = wall
        """The wall at rest, of which there is one at most, if it has windows."""
        self.has_wall = wall is not None
        if windows is not None:
            self.windows = windows
            self.copies = windows.copies(names, near, windows.inside)
        if self.has_wall:
            self.wall_copies = wall.windows.copies(wall_names, wall, wall.windows.inside)
            self.wall_pair = make_wall_pair(wall.windows.inside)

        @ti.func
        def pair_here(i, j):
            return pair(near, i, j)

        # A plain loop: a GPU wants it, and beside windows it is seldom used.
        self.plain_fluid = make_neighbour_sum(grid.geometry, grid.start, pair_here, width, backend, lanes=1)
        self.other_walls = make_wall_sum(
            [other for other in walls if other is not wall], grid, make_wall_pair, width, backend
        )

    @ti.func
    def visit(self, finish: ti.template(), due: ti.template(), now, tick):
        """Call `finish(k, fluid, walls, due, now, tick)` with both sums for the place k of each due particle of schedule `due`.

        To be called at the outermost level of a kernel, where its loops run in parallel.
        """
        if ti.static(not self.by_windows):
            for n in range(due.due_count[None]):
                k = due.due[n]
                finish(k, self.plain(k), self.other_walls(k), due, now, tick)
        else:
            for turn in range(TASKS * CHUNK):  # the first iteration of each chunk does a task
                task, m, end = turn // CHUNK, 0, 0
                thread = ti.global_thread_idx()
                if turn % CHUNK == 0:
                    m, end = self.share(due, task), self.share(due, task + 1)
                while m < end:
                    first, last = due.due_in(m)
                    if first < last:
                        m = self.visit_run(finish, due, now, tick, thread, m, end)
                    else:
                        m += 1

    @ti.func
    def share(self, due: ti.template(), task):
        """Number of a task's first occupied block: each has as many due particles as the others, give or take a block's."""
        wanted = ti.cast(ti.cast(task, ti.i64) * due.due_count[None] // TASKS, ti.i32)
        low, high = 0, self.grid.occupied_count[None]
        while low < high:
            middle = (low + high) // 2
            first, _last = due.due_in(middle)
            if first < wanted:
                low = middle + 1
            else:
                high = middle
        return low

    @ti.func
    def plain(self, k):
        """The fluid's sum for the particle at place `k`, without a window."""
        return self.plain_fluid(k, self.near.x[k], self.grid.cell_of[self.grid.order[k]])

    @ti.func
    def visit_run(self, finish: ti.template(), due: ti.template(), now, tick, thread, m, end):
        """Visit the due particles of occupied block number `m` and of those behind it as far as a window reaches.

        Return who comes next.
        """
        block = self.grid.occupied[m]
        row, column = block // self.grid.geometry.shape[0], block % self.grid.geometry.shape[0]
        held = self.open(due, thread, row, column, m, end - m)
        done = ti.max(held - 2, 1)
        number = thread * self.windows.columns
        for ahead in range(done):
            first, last = due.due_in(m + ahead)
            cell = (block + ahead) * CELLS_PER_BLOCK
            local = number + (ahead + 1) * CELLS_PER_BLOCK
            for n in range(first, last):
                k = due.due[n]
                while k >= self.grid.start[cell + 1]:
                    cell += 1
                    local += 1
                fluid = ti.Vector.zero(self.dtype, self.width)
                if held >= 3:
                    i = self.windows.own_start[local] + k - self.grid.start[cell]
                    low, high = self.windows.near(local)
                    for j in range(low, high):
                        fluid += self.pair(self.windows.inside, i, j)
                else:  # a run that has blown up: too many in too little space
                    fluid = self.plain(k)
                walls = self.other_walls(k)
                if ti.static(self.has_wall):
                    if self.wall.near[block + ahead] == 1:
                        low, high = self.wall.windows.near(local)
                        for b in range(low, high):
                            walls += self.wall_pair(k, b)
                finish(k, fluid, walls, due, now, tick)
        return m + done

    @ti.func
    def open(self, due: ti.template(), thread, row, column, m, most):
        """Gather who lies around the run of at most `most` blocks in which somebody is due, from `column` of `row` on.

        The first is occupied block number `m`.

        Return the number of columns [blocks] gathered, from that before the run to that behind it; fewer than 3 if the fluid
        around a single block does not fit.
        """
        base, number = thread * self.windows.size, thread * self.windows.columns
        n, held = base, 0
        most = ti.min(most, ti.min(RUN, self.grid.geometry.shape[0] - 1 - column))
        fits = self.windows.count(row, column - 1) <= self.windows.capacity
        while fits:
            n = self.windows.gather(self.copies, row, column - 1 + held, number + held * CELLS_PER_BLOCK, n)
            held += 1
            fits = held < 3
            if held >= 3 and held - 2 < most:
                first, last = due.due_in(m + held - 2)
                fits = first < last and self.grid.occupied[m + held - 2] == self.grid.occupied[m] + held - 2
            if fits:
                fits = n - base + self.windows.count(row, column - 1 + held) <= self.windows.capacity
        self.windows.close(self.copies, number + held * CELLS_PER_BLOCK, n)
        if ti.static(self.has_wall):
            some = 0
            for ahead in range(ti.max(held - 2, 1)):
                some += self.wall.near[row * self.grid.geometry.shape[0] + column + ahead]
            if some > 0:
                end = thread * self.wall.windows.size
                for side in range(ti.max(held, 3)):
                    end = self.wall.windows.gather(
                        self.wall_copies, row, column - 1 + side, number + side * CELLS_PER_BLOCK, end
                    )
                self.wall.windows.close(self.wall_copies, number + ti.max(held, 3) * CELLS_PER_BLOCK, end)
        return held
