"""Cells (blocks of the grid) that each have a time: which of them may step together, and which particles are due.

The rule is proved in `asynchronous.py`; this file finds the cells that obey it.
"""

from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.device.counters import Counters
from taichi_rts.device.fields import Declared, integers, within
from taichi_rts.device.scan import ExclusiveScan
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping.base import Schedule
from taichi_rts.solver.stepping.limiter import EMPTY
from taichi_rts.solver.stepping.settled import SettledCells


@ti.data_oriented
class Cells(Schedule):
    """Times and steps of the occupied cells, and the choice of those that step in one pass.

    `levels` ticks are the longest step.
    """

    EMPTY = EMPTY

    def __init__(self, particles: FluidState, grid: BlockGrid, settled: SettledCells) -> None:
        super().__init__(particles, grid, settled)
        self.levels = settled.levels
        self.blocks = grid.geometry.blocks
        self.occupied, self.occupied_count = grid.occupied, grid.occupied_count
        self.proposal = self.ready  # `ready` is not read again once the next steps are proposed
        self.due_scan = ExclusiveScan(self.block_due, self.due_start)
        self.due_count = self.due_scan.total
        self.youngest = ti.field(ti.i32, ())
        self.stepping = ti.field(ti.i32, ())
        self.extrapolated = ti.field(ti.i32, ())
        self.updates = Counters(self.levels + 1)
        """Updates by the ticks that had elapsed."""

    @classmethod
    def fields(cls, settled: Any, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields for so many particles and blocks.

        `time` is the tick of each cell, the end of its youngest particle's step, and `EMPTY` where there is none; `step` is
        the shortest step [ticks] of its particles.
        """
        return [
            *super().fields(settled, particles, blocks, serial=serial),
            *integers(blocks, "time", "step", "ready", "claim", "block_due"),
            *integers(blocks + 1, "due_start"),
            *within("due_scan", ExclusiveScan.fields(blocks)),
            *within("updates", Counters.fields(settled.levels + 1)),
        ]

    def find_cells(self) -> None:
        """Find the occupied cells of a grid that has been sorted anew, their times and steps."""
        self.forget_cells()
        self.read_cells()
        self.find_youngest()

    @ti.kernel
    def forget_cells(self):
        for block in range(self.blocks):
            self.time[block] = self.EMPTY
            self.step[block] = self.EMPTY
            self.ready[block] = self.EMPTY
            self.claim[block] = self.EMPTY
            self.block_due[block] = 0
            self.read_at[block] = -1

    @ti.kernel
    def read_cells(self):
        for m in range(self.occupied_count[None]):
            self.read_cell(self.occupied[m])

    @ti.func
    def read_cell(self, block):
        """Take a cell's time and step from its particles."""
        time, step = self.EMPTY, self.EMPTY
        for k in range(self.grid.first(block), self.grid.first(block + 1)):
            i = self.grid.order[k]
            time = ti.min(time, self.end(i))
            step = ti.min(step, self.particles.level[i])
        self.time[block] = time
        self.step[block] = step

    @ti.func
    def end(self, i):
        """Tick at which the step of particle `i` ends."""
        return self.particles.updated[i] + self.particles.level[i]

    @ti.func
    def is_due(self, i, time):
        """Whether particle `i` moves with its cell at `time`: whose step is not over yet ends it there, with what has elapsed.

        Left out are only particles that were evaluated at that time or later: in a cell that was woken.
        """
        return self.particles.updated[i] < time or self.end(i) == time

    @ti.func
    def shortest_beside(self, steps, block):
        """Least of `steps` of the blocks around `block`; `EMPTY` if they are."""
        shortest = self.EMPTY
        for k in ti.static(range(len(self.grid.geometry.offsets))):
            shortest = ti.min(shortest, steps[self.grid.geometry.beside(block, k)])
        return shortest

    @ti.kernel
    def find_youngest(self):
        """T_min: the earliest time of all cells."""
        self.youngest[None] = self.EMPTY
        for m in range(self.occupied_count[None]):
            ti.atomic_min(self.youngest[None], self.time[self.occupied[m]])

    def choose(self, now: int, target: int, cycle_end: int) -> None:
        """Find the cells that may step before tick `cycle_end`, unless all are past `target`; then what is due and read."""
        self.find_ready(target, cycle_end)
        self.claim_neighbourhoods()
        self.choose_cells()
        self.due_scan.run()
        self.list_due()
        self.mark_read(now)

    @ti.kernel
    def find_ready(self, target: ti.i32, cycle_end: ti.i32):
        """A cell may step if no neighbour is younger and its own last evaluation does not lie after the youngest of all."""
        for m in range(self.occupied_count[None]):
            block = self.occupied[m]
            time, youngest = self.time[block], self.youngest[None]
            ready = self.EMPTY
            if youngest <= target and time < cycle_end and time <= self.shortest_beside(self.time, block):
                ready = time
                for k in range(self.grid.first(block), self.grid.first(block + 1)):
                    i = self.grid.order[k]
                    if self.is_due(i, time) and self.particles.updated[i] > youngest:
                        ready = self.EMPTY
            self.ready[block] = ready

    @ti.kernel
    def claim_neighbourhoods(self):
        """Every cell is interpolated to one time in a pass: the youngest of the ready cells around it has the claim."""
        for m in range(self.occupied_count[None]):
            block = self.occupied[m]
            self.claim[block] = ti.min(self.ready[block], self.shortest_beside(self.ready, block))

    @ti.kernel
    def choose_cells(self):
        """Ready cells step if their whole neighbourhood is theirs; the others wait for a later pass."""
        for m in range(self.occupied_count[None]):
            block = self.occupied[m]
            time = self.ready[block]
            due = 0
            if time != self.EMPTY and time <= self.claim[block]:
                if time <= self.shortest_beside(self.claim, block):
                    for k in range(self.grid.first(block), self.grid.first(block + 1)):
                        due += ti.cast(self.is_due(self.grid.order[k], time), ti.i32)
            self.block_due[block] = due

    @ti.kernel
    def list_due(self):
        """List the places of due particles in the grid's order, and count them by the time that has elapsed.

        No atomic stands in an inner loop: on Mesa 22.3's lavapipe that ends the whole iteration. So those of a cell that were
        evaluated with its first are counted together, the few others one by one.
        """
        self.stepping[None] = 0
        for m in range(self.occupied_count[None]):
            block = self.occupied[m]
            if self.block_due[block] > 0:
                self.stepping[None] += 1
                n, time = self.due_start[block], self.time[block]
                elapsed, count = 0, 0
                for k in range(self.grid.first(block), self.grid.first(block + 1)):
                    i = self.grid.order[k]
                    if self.is_due(i, time):
                        if n == self.due_start[block]:
                            elapsed = time - self.particles.updated[i]
                        self.due[n] = k
                        n += 1
                        if time - self.particles.updated[i] == elapsed:
                            count += 1
                self.updates.add(elapsed, count)
        for n in range(self.due_count[None]):
            i = self.grid.order[self.due[n]]
            block = self.grid.block(i)
            first = self.grid.order[self.due[self.due_start[block]]]
            if self.particles.updated[i] != self.particles.updated[first]:
                self.updates.add(self.time[block] - self.particles.updated[i], 1)

    @ti.kernel
    def mark_read(self, now: ti.i32):
        """Have the cells read that step or lie beside one that does, at its time."""
        for m in range(self.occupied_count[None]):
            block = self.occupied[m]
            due = self.block_due[block]
            for k in ti.static(range(len(self.grid.geometry.offsets))):
                due = ti.max(due, self.block_due[self.grid.geometry.beside(block, k)])
            self.read_at[block] = self.claim[block] - now if due > 0 else -1

    @ti.kernel
    def count_extrapolated(self, now: ti.i32):
        """Count reads after the end of a particle's step or before its evaluation before the last."""
        for m in range(self.occupied_count[None]):
            block = self.occupied[m]
            if self.read_at[block] >= 0:
                time, count = now + self.read_at[block], 0
                for k in range(self.grid.first(block), self.grid.first(block + 1)):
                    i = self.grid.order[k]
                    begin = self.particles.updated[i]
                    if ti.static(self.particles.has_past):
                        begin = ti.min(begin, self.particles.past_updated[i])
                    if time > self.end(i) or time < begin:
                        count += 1
                self.extrapolated[None] += count
