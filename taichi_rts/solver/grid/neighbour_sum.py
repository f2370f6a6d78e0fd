"""Sums over the neighbours of all due particles, in tasks that threads take one by one."""

from collections.abc import Callable, Sequence
from typing import Any

from taichi_rts.device.backend import CHUNK, Backend, ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.sums import make_neighbour_sum, make_wall_sum
from taichi_rts.solver.grid.windows import RUN, FluidWindows
from taichi_rts.solver.particles.neighbourhood import Neighbourhood

TASKS = 64  # shares of the due particles that threads take one by one


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

        Return the number of the next occupied block.
        """
        block = self.grid.occupied[m]
        row, column = self.grid.geometry.run_of(block)
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
        """Gather the particles around the run of at most `most` blocks that hold due particles, from `column` of `row` on.

        The first is occupied block number `m`.

        Return the number of columns [blocks] gathered, from that before the run to that behind it; fewer than 3 if the fluid
        around a single block does not fit.
        """
        base, number = thread * self.windows.size, thread * self.windows.columns
        n, held = base, 0
        most = ti.min(most, ti.min(RUN, self.grid.geometry.columns_behind(column)))
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
                some += self.wall.near[self.grid.geometry.block_at(row, column + ahead)]
            if some > 0:
                end = thread * self.wall.windows.size
                for side in range(ti.max(held, 3)):
                    end = self.wall.windows.gather(
                        self.wall_copies, row, column - 1 + side, number + side * CELLS_PER_BLOCK, end
                    )
                self.wall.windows.close(self.wall_copies, number + ti.max(held, 3) * CELLS_PER_BLOCK, end)
        return held
