"""Keeps the particles of a `BlockGrid` sorted on a CPU: those that changed their cell are merged into the others."""

from typing import Any

from taichi_rts.device.backend import CHUNK, threads, ti
from taichi_rts.device.fields import Declared, Part, integers
from taichi_rts.solver.grid.tiles import Tiles

FEW = 8
"""Only if fewer than one of so many particles have changed their cell there is a list of them; else all are sorted anew."""
BITS = 32  # particles that are compared with their cells at a time


def blocks_in_part(blocks: int) -> int:
    """How many blocks a part has, so that there are enough parts for all threads."""
    return max(1, blocks // (4 * CHUNK * threads()))


def listed(count: int) -> int:
    """How many of `count` particles may have changed their cell before all are sorted anew."""
    return max(1024, count // FEW)


@ti.data_oriented
class Resorting(Part):
    """What a counting sort gives, from what the last one gave: most particles stay in their cell from step to step.

    The blocks are divided into `parts` of equally many. A part that no particle has left or come into keeps its order;
    if others before it have grown or shrunk, it moves as a whole. In the other parts the cells are read in turn: particles that
    have left are left out, those that have come are put in by their id. So the work is one comparison for each particle, in
    vector instructions, and a little for each part; the rest is in proportion to the number of particles that changed.

    While particles are inserted, `BlockGrid.cell_count` holds for each cell two things: the flag `LEFT`, if a particle has left
    it, and the first entry + 1 in the list of those that have come, of which `following` is the next. Between updates it is 0.
    """

    LEFT = 1 << 30

    def __init__(self, grid: Any, count: int) -> None:
        self.grid = grid
        self.blocks = grid.geometry.blocks
        self.blocks_each = blocks_in_part(self.blocks)
        self.parts = -(-self.blocks // self.blocks_each)
        self.divides_some = isinstance(grid.geometry, Tiles)
        if self.divides_some:
            self.some_each = ti.field(ti.i32, ())
            self.divide(self.blocks)
        self.room = listed(count)
        self.make_fields(self.fields(count, self.blocks))
        self.moved_count = ti.field(ti.i32, ())
        self.all_anew = ti.field(ti.i32, ())

    def divide(self, blocks: int) -> None:
        """Divide the first `blocks` among the parts, and leave what is behind them to the last; `restored` has to follow."""
        self.some_each[None] = max(1, -(-blocks // max(1, self.parts - 1)))

    @staticmethod
    def fields(count: int, blocks: int) -> list[Declared]:
        """Declare the fields for `count` particles in `blocks` blocks.

        `growth` is how many particles have come into each part, minus those that have left it; `occupied_in` is its number of
        occupied blocks.
        """
        parts = -(-blocks // blocks_in_part(blocks))
        return [
            *integers(listed(count), "moved", "following"),
            *integers(parts, "touched", "growth", "occupied_in", "first_occupied"),
            *integers(parts + 1, "old_first", "new_first"),
        ]

    def restored(self) -> None:
        """Take note that the order is that of another time: look at all parts at the next update."""
        self.touched.fill(1)

    @ti.func
    def insert_all(self, locate: ti.template(), now, tick):
        """Tell the grid which particles have changed their cell, where particle `i` is at `locate(i, now, tick)` [m].

        To be called at the outermost level of a kernel.
        """
        for turn in range((self.grid.alive[None] + (BITS - 1)) // BITS):
            first, changed = turn * BITS, 0
            # Nothing is stored here, so LLVM takes 8 at a time.
            for i in range(first, ti.min(first + BITS, self.grid.alive[None])):
                differs = self.grid.geometry.has_left(self.grid.cell_of[i], locate(i, now, tick))
                changed |= ti.cast(differs, ti.i32) << (i - first)
            i = first
            while changed != 0:
                if changed & 1 == 1:
                    self.grid.change(i, self.grid.geometry.cell(locate(i, now, tick)))
                changed = ti.bit_shr(changed, 1)
                i += 1

    @ti.func
    def insert(self, i, before, cell):
        """Note that particle `i`, which was in the cell `before` or, if that is negative, in none, is in `cell` now."""
        part, part_before = self.part_of(cell), -1
        self.touched[part] = 1
        if before >= 0:
            part_before = self.part_of(before)
            self.touched[part_before] = 1
            ti.atomic_or(self.grid.cell_count[before], self.LEFT)
        if part != part_before:
            self.growth[part] += 1
            if part_before >= 0:
                self.growth[part_before] -= 1
        n = ti.atomic_add(self.moved_count[None], 1)
        if n < self.room:
            self.moved[n] = i

    @ti.func
    def each(self):
        """How many blocks a part has, but perhaps for the last."""
        each = self.blocks_each
        if ti.static(self.divides_some):
            each = self.some_each[None]
        return each

    @ti.func
    def part_of(self, cell):
        """Number of the part that `cell` belongs to."""
        return ti.min(self.grid.block_of(cell) // self.each(), self.parts - 1)

    @ti.func
    def sort(self, identity: ti.template()):
        """Bring `order` and `start` of the grid up to date, at the outermost level of a kernel; `rank` is written over."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.list_arrivals()
            self.find_parts()
        for part in range(self.parts):
            if self.touched[part] == 1:
                self.merge(part, identity)
            else:
                self.shift(part)

    @ti.func
    def find_parts(self):
        """Find where the particles of each part begin, before and after."""
        before, after = 0, 0
        for part in range(self.parts):
            _first, end = self.cells_of(part)
            self.old_first[part], self.new_first[part] = before, after
            after += self.grid.start[end] - before + self.growth[part]
            before = self.grid.start[end]
            self.growth[part] = 0
        self.old_first[self.parts], self.new_first[self.parts] = before, after
        self.grid.start[self.grid.geometry.cells] = after

    @ti.func
    def list_arrivals(self):
        """Link the particles that have come into each cell. If too many have changed, all count as new."""
        grid = self.grid
        self.all_anew[None] = 0
        if self.moved_count[None] <= self.room:
            for n in range(self.moved_count[None]):
                cell = grid.cell_of[self.moved[n]]
                last = grid.cell_count[cell]
                self.following[n] = last & (self.LEFT - 1)
                grid.cell_count[cell] = (last & self.LEFT) + n + 1
        else:
            self.all_anew[None] = 1
            for cell in range(grid.geometry.cells):
                grid.start[cell] = grid.cell_count[cell] = 0
            grid.start[grid.geometry.cells] = 0
            for part in range(self.parts):
                self.touched[part], self.growth[part] = 1, 0
            for i in range(grid.alive[None]):
                cell = grid.cell_of[i]
                grid.order[i] = grid.cell_count[cell]  # of no use any more
                grid.cell_count[cell] = i + 1
                self.growth[self.part_of(cell)] += 1
        self.moved_count[None] = 0

    @ti.func
    def arrival(self, entry):
        """Return the particle at `entry` > 0 of a list of arrivals, and the entry that follows, 0 after the last."""
        i, next_entry = entry - 1, 0
        if self.all_anew[None] == 1:
            next_entry = self.grid.order[i]
        else:
            next_entry = self.following[i]
            i = self.moved[i]
        return i, next_entry

    @ti.func
    def cells_of(self, part):
        """First cell of a part, and one past its last."""
        each, cells = self.each() * self.grid.cells_each, self.grid.geometry.cells
        first, end = ti.min(part * each, cells), ti.min((part + 1) * each, cells)
        if ti.static(self.divides_some):
            if part == self.parts - 1:
                end = cells
        return first, end

    @ti.func
    def changed(self, first, end):
        """Say, one bit each, which of the cells from `first` on and before `end` a particle has left or come into."""
        bits = 0
        for cell in range(first, ti.min(first + BITS, end)):
            bits |= ti.cast(self.grid.cell_count[cell] != 0, ti.i32) << (cell - first)
        return bits

    @ti.func
    def shift(self, part):
        """Move a part in which nothing has changed to its new place in `rank`."""
        old, new = self.old_first[part], self.new_first[part]
        if old != new:
            first, end = self.cells_of(part)
            for cell in range(first, end):
                self.grid.start[cell] = self.grid.start[cell] + (new - old)  # `+=` would be atomic
            self.move(old, self.old_first[part + 1], new - old)

    @ti.func
    def move(self, first, end, by):
        """Write some entries of `order` to `rank`, `by` further on."""
        for k in range(first, end):
            self.grid.rank[k + by] = self.grid.order[k]

    @ti.func
    def merge(self, part, identity: ti.template()):
        """Write the particles in each cell of a part to `rank`, in order of their ids."""
        grid = self.grid
        first, end = self.cells_of(part)
        n, done, last = self.new_first[part], self.old_first[part], self.old_first[part + 1]
        for group in range((end - first + (BITS - 1)) // BITS):
            begin = first + group * BITS
            changed = self.changed(begin, end)
            if changed != 0 or n != done:
                for cell in range(begin, ti.min(begin + BITS, end)):
                    if changed & 1 == 0:
                        grid.start[cell] = grid.start[cell] + (n - done)
                    else:
                        old, old_end = grid.start[cell], last
                        if cell + 1 < end:
                            old_end = grid.start[cell + 1]
                        self.move(done, old, n - done)
                        n += old - done
                        grid.start[cell] = n
                        n = self.merge_cell(cell, old, old_end, n, identity)
                        done = old_end
                    changed = ti.bit_shr(changed, 1)
        self.move(done, last, n - done)
        last_block = grid.block_of(end - 1)
        # Where the next block begins is another thread's to write, so the last is asked otherwise.
        occupied = ti.cast(first < end and n + last - done > grid.first(last_block), ti.i32)
        for block in range(grid.block_of(first), last_block):
            occupied += ti.cast(not grid.is_empty(block), ti.i32)
        self.occupied_in[part] = occupied

    @ti.func
    def merge_cell(self, cell, old, old_end, first, identity: ti.template()):
        """Write a cell's particles to `rank` from `first` on; return the end. It held entries `old` to `old_end` of `order`."""
        grid = self.grid
        n, entry = first, grid.cell_count[cell]
        for k in range(old, old_end):
            i = grid.order[k]
            if grid.cell_of[i] == cell:
                grid.rank[n] = i
                n += 1
        entry &= self.LEFT - 1
        while entry > 0:
            i, entry = self.arrival(entry)
            key, m = identity[i], n
            while m > first and identity[grid.rank[m - 1]] > key:
                grid.rank[m] = grid.rank[m - 1]
                m -= 1
            grid.rank[m] = i
            n += 1
        grid.cell_count[cell] = 0
        return n

    @ti.func
    def finish(self):
        """Put the new order in its place and list the occupied blocks, at the outermost level of a kernel."""
        grid = self.grid
        ti.loop_config(serialize=True)
        for _ in range(1):
            total = 0
            for part in range(self.parts):
                self.first_occupied[part] = total
                total += self.occupied_in[part]
            grid.occupied_count[None] = total
        for part in range(self.parts):
            first, end = self.new_first[part], self.new_first[part + 1]
            if self.touched[part] == 1 or first != self.old_first[part]:
                self.touched[part] = 0
                for k in range(first, end):
                    grid.order[k] = grid.rank[k]
            if first < end:
                n = self.first_occupied[part]
                first_cell, end_cell = self.cells_of(part)
                for block in range(grid.block_of(first_cell), grid.block_of(end_cell)):
                    if not grid.is_empty(block):
                        grid.occupied[n] = block
                        n += 1
