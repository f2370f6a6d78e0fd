"""Limits between neighbouring blocks: how much longer than its neighbours' a block's step may be, and how it may grow."""

from collections.abc import Sequence
from typing import Any

from taichi_rts.device.backend import ti

EMPTY = 1 << 30
"""Level of a block without particles: it limits no other."""


@ti.data_oriented
class Ladder:
    """The levels that blocks may have, ascending: what lies one above another."""

    def __init__(self, levels: Sequence[int]) -> None:
        self.levels = list(levels)

    @ti.func
    def above(self, level):
        """The next of the levels above `level`; the last if there is none."""
        found = self.levels[-1]
        for k in ti.static(range(len(self.levels) - 1, -1, -1)):
            if self.levels[k] > level:
                found = self.levels[k]
        return found

    @ti.func
    def grown(self, wanted, before, beside, now, most: ti.template()):
        """Level at tick `now` of a block that had `before` and wants `wanted`, where the least level `beside` it was that.

        Less at once, more only by one level at a time, at a multiple of the new one, and only if the blocks beside it allowed
        the new one already: `most(beside)`. A block that were to grow on and be cut back by its neighbours would flicker.
        """
        level = wanted
        if wanted > before:
            level = before
            next_level = self.above(before)
            if now % next_level == 0 and (beside == EMPTY or next_level <= most(beside)):
                level = next_level
        return level


@ti.data_oriented
class Sweep:
    """Writes the limited levels of `source` to `target`, (blocks,), for `Surroundings.visit`.

    A block's level becomes at most `most(shortest)`, a ti.func of the least level of the 8 (26) blocks around it.
    `then(block)`, a ti.func, is called for each block that is done.
    """

    transient = frozenset({"most", "then", "goes_on"})
    sees_last = False

    def __init__(self, source: ti.Field, target: ti.Field, most: Any, then: Any = None) -> None:
        self.source, self.target, self.most = source, target, most
        self.then, self.goes_on = then, then is not None

    @ti.func
    def read(self, block):
        """The level that neighbours see."""
        return self.source[block]

    @ti.func
    def finish(self, block, around):
        """Limit the level of `block` beside others; `around` is the least of what is read of those."""
        self.target[block] = self.limited(block, around)
        if ti.static(self.goes_on):
            self.then(block)

    @ti.func
    def limited(self, block, around):
        """Level of `block`."""
        return self.beside(block, around)

    @ti.func
    def beside(self, block, shortest):
        """Level of `block` beside others, the `shortest` of which is given."""
        level = self.source[block]
        if shortest != EMPTY:
            level = ti.min(level, self.most(shortest))
        return level


@ti.data_oriented
class GrowingSweep(Sweep):
    """The first `Sweep` where levels grow slowly: R_min on what blocks allow themselves, and only then growth.

    The other way round R_min would be contagious: it would act on levels that growth has cut to those of the last step, which
    R_min had lowered then, and the border would walk outwards by a block a step.

    `source` is what blocks allow themselves, `last` their level of the last step, `present` holds the tick; `growth` is the
    limit on a level beside the last ones of its neighbours.
    """

    transient = frozenset({"growth"})
    sees_last = True

    def __init__(
        self,
        source: ti.Field,
        last: ti.Field,
        target: ti.Field,
        ladder: Ladder,
        most: Any,
        growth: Any,
        present: ti.Field,
        then: Any = None,
    ) -> None:
        super().__init__(source, target, most, then)
        self.last, self.ladder, self.growth, self.present = last, ladder, growth, present

    @ti.func
    def read(self, block):
        """What a block allows itself, and its last level."""
        return ti.Vector([self.source[block], self.last[block]])

    @ti.func
    def limited(self, block, around):
        """Level of `block`; `around` holds the least of what neighbours allow themselves and of their last levels."""
        level, before = self.beside(block, around[0]), self.last[block]
        if before != EMPTY:
            level = self.ladder.grown(level, before, around[1], self.present[None], self.growth)
        return level


@ti.data_oriented
class NeighbourLimiter:
    """The neighbour limiter of `Regional` and `Asynchronous` (Saitoh & Makino 2009; Durier & Dalla Vecchia 2012).

    Between neighbours: no step exceeds `RATIO` times a neighbour's, and a particle in the middle of a longer one is woken:
    its step ends at the present time and is corrected with the time that really elapsed (`woken_end`).
    In time: a step shrinks at once; it grows by doubling, and with `aligned` only when synchronised, i.e. at a tick that is a
    whole number of the longer steps (`settled`). `Regional` has levels that need not be powers of two: `Ladder.grown`.
    """

    RATIO = 2

    def __init__(self, aligned: bool = True) -> None:
        self.aligned = aligned

    @ti.func
    def settled(self, wanted, current, now):
        """Step [ticks] that a block at tick `now` may take after a step of `current`, if it wants `wanted`."""
        step = wanted
        if wanted > current:
            step = ti.min(wanted, 2 * current)
            if ti.static(self.aligned):
                if now % step != 0:
                    step = current
        return step

    @ti.func
    def limited(self, step, shortest):
        """Lower `step` to `RATIO` times the `shortest` of the neighbours."""
        return step if shortest == EMPTY else ti.min(step, self.RATIO * shortest)

    @ti.func
    def woken_end(self, began, step, now, shortest):
        """Tick at which a step from `began` over `step` ends, beside a neighbour that stepped by `shortest` at tick `now`.

        It ends where a step of `RATIO * shortest` would have ended, or now if that is past; never later than planned.
        """
        return ti.min(began + step, ti.max(now, began + self.RATIO * shortest))
