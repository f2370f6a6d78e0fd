"""Limits between neighbouring blocks: how much longer than its neighbours' a block's step may be, and how it may grow."""

from typing import Any

import taichi as ti

from taichi_rts.grid import Geometry


@ti.data_oriented
class BlockLimiter:
    """What blocks allow each other. Neighbours are the 8 (26) blocks around; empty ones (`EMPTY`) limit nobody."""

    EMPTY = 1 << 30

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry

    @ti.func
    def shortest_beside(self, steps, block):
        """Shortest step of the blocks around `block`; `EMPTY` if they are."""
        shortest = self.EMPTY
        for k in ti.static(range(len(self.geometry.offsets))):
            shortest = ti.min(shortest, steps[self.geometry.beside(block, k)])
        return shortest

    @ti.func
    def limited(self, step, shortest, factor, jump):
        """Lower `step` to `factor` times the `shortest` of the neighbours plus `jump`.

        `factor = 1, jump = 0` is the paper's R_min: the outer layer of the slower side takes the faster side's step. `jump = 1`
        is one sweep of grading.
        """
        return step if shortest == self.EMPTY else ti.min(step, factor * shortest + jump)


@ti.data_oriented
class Sweep:
    """Writes the limited steps of `source` to `target`, (blocks,) [base steps], for `Surroundings.visit`.

    `then(block)`, a ti.func, is called for each block that is done.
    """

    transient = frozenset({"then", "goes_on"})

    def __init__(
        self, limiter: BlockLimiter, source: ti.Field, target: ti.Field, factor: int, jump: int, then: Any = None
    ) -> None:
        self.limiter = limiter
        self.source, self.target = source, target
        self.factor, self.jump = factor, jump
        self.then, self.goes_on = then, then is not None

    @ti.func
    def read(self, block):
        """The step [base steps] that neighbours see."""
        return self.source[block]

    @ti.func
    def finish(self, block, shortest):
        """Limit the step of `block` beside others, the shortest of which is given."""
        self.target[block] = self.limiter.limited(self.source[block], shortest, self.factor, self.jump)
        if ti.static(self.goes_on):
            self.then(block)


@ti.data_oriented
class NeighbourLimiter:
    """The neighbour limiter of `Regional` and `Asynchronous` (Saitoh & Makino 2009; Durier & Dalla Vecchia 2012).

    Between neighbours: no step exceeds `RATIO` times a neighbour's, and whoever is in the middle of a longer one is woken:
    its step ends at the present time and is corrected with the time that really elapsed (`woken_end`).
    In time: a step shrinks at once; it grows by one level, and only when synchronised, i.e. at a tick that is a whole number
    of the longer steps (`settled`). `doubling` says what one level is: twice the step, or one base step more.
    """

    RATIO = 2

    def __init__(self, doubling: bool, aligned: bool = True) -> None:
        self.doubling = doubling
        self.aligned = aligned

    @ti.func
    def settled(self, wanted, current, now):
        """Step [ticks] that a block at tick `now` may take after a step of `current`, if it wants `wanted`."""
        step = wanted
        if wanted > current:
            step = ti.min(wanted, self.next_level(current))
            if ti.static(self.aligned):
                if now % step != 0:
                    step = current
        return step

    @ti.func
    def next_level(self, step):
        """The step one level above."""
        return 2 * step if ti.static(self.doubling) else step + 1

    @ti.func
    def woken_end(self, began, step, now, shortest):
        """Tick at which a step from `began` over `step` ends, beside a neighbour that stepped by `shortest` at tick `now`.

        It ends where a step of `RATIO * shortest` would have ended, or now if that is past; never later than planned.
        """
        return ti.min(began + step, ti.max(now, began + self.RATIO * shortest))
