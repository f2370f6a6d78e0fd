"""Aligned blocks: steps end at multiples of themselves, so that blocks of one level are due together, and as a whole."""

from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, integers, within
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping import criteria
from taichi_rts.solver.stepping.limiter import EMPTY
from taichi_rts.solver.stepping.regions import RegionalSchedule
from taichi_rts.solver.stepping.settled import SettledRegions
from taichi_rts.solver.stepping.timeline import Timeline

MOST_HELD = 1 << 30
"""Particles times steps at which a block hands over what it has counted by itself; a pass adds less than that again."""


@ti.data_oriented
class AlignedBlocks(RegionalSchedule):
    """A block of level n is due at multiples of n base steps; base steps in which nothing is due are passed over.

    What the paper looks for in every base step (lines 5-14) can therefore come too late. Two things shorten the time to the
    next step (`until_next`): a particle whose new acceleration does not allow its step (`evaluated`), and one that has come
    from another block and whose own step ends before that of its new block.
    """

    transient = frozenset({"ends"})
    aligned = True
    levels_double = True

    def __init__(self, settled: SettledRegions, scene: Scene, particles: FluidState, grid: BlockGrid) -> None:
        super().__init__(settled, scene, particles, grid)
        grid.track_arrivals()
        self.until_next, self.ends = (ti.field(ti.i32, ()) for _ in range(2))
        """Ticks to the next step, and whether aligned steps of n ticks end now, in bit n - 1."""

    @classmethod
    def fields(cls, settled: Any, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields for so many particles and blocks.

        `held` is particles times base steps that are not in `occupancy` yet: one by one is quicker than all in one place.
        """
        more = [*integers(blocks, "held"), *within("grid", BlockGrid.arrival_fields(blocks))]
        return super().fields(settled, particles, blocks, serial=serial) + more

    def restart(self, now: int) -> None:
        """Forget steps and levels."""
        self.held.fill(0)
        super().restart(now)

    def begin(self, timeline: Timeline, target: int) -> bool:
        """Set the clock to the next step at which anything may be due."""
        begun = super().begin(timeline, target)
        # Those in which nothing is due have passed as well.
        self.steps = timeline.now if begun else max(self.steps, target)
        return begun

    def next_ticks(self) -> int:
        """Ticks to the end of the first step that ends: before it nothing is due."""
        return max(1, int(self.until_next[None]))

    @ti.func
    def note_time(self, now, passed):
        """Keep what `settle` has to know, and find which aligned steps end now."""
        self.present[None], self.passed[None] = now, passed
        self.until_next[None] = self.levels
        ends = 0
        for n in ti.static(self.lengths):
            ends |= ti.cast(now % n == 0, ti.i32) << (n - 1)
        self.ends[None] = ends

    @ti.func
    def leave(self, block):
        """Hand over to `occupancy` what `block` has held."""
        if self.held[block] > 0:
            self.add(self.occupancy, self.block_level[block], self.held[block])
            self.held[block] = 0

    @ti.func
    def is_stale(self, block):
        """Whether what `block` allows itself may have changed.

        Until a particle in it steps again speeds grow by constant accelerations, and the left side of Eq. 3 by no more than
        lambda_f^2 (Eq. 2), 0.01 of 0.16.
        """
        stale = True
        if ti.static(not self.maxima.moving):
            stale = self.last_level[block] == EMPTY or self.block_due[block] > 0 or self.grid.arrived[block] == 1
        return stale

    @ti.func
    def update_validity(self, block, now, passed):
        """Lines 10-16 for a block: due as a whole at a multiple of its level, or when that has become lower.

        Else due are only those particles that have come into it with a longer step, or whose own step is over. Others with a
        shorter one, which have come into it or were there when its level rose, keep it until then. Particles of other blocks
        need not be looked at.
        """
        first, end = self.grid.first(block), self.grid.first(block + 1)
        level, before = self.block_level[block], self.last_level[block]
        if self.held[block] > 0 and (level != before or self.held[block] >= MOST_HELD):
            self.add(self.occupancy, before, self.held[block])
            self.held[block] = 0
        self.held[block] = self.held[block] + (end - first) * passed  # `+=` would be atomic
        count, arrived = 0, self.grid.arrived[block]
        if level > before:  # without the limiter at any tick, in the middle of the steps of its particles
            arrived = 1
        waiting, soonest = 0, self.levels
        if (self.ends[None] >> (level - 1)) & 1 == 1 or level < before:
            count = end - first
        elif arrived > 0:
            for k in range(first, end):
                i = self.grid.order[k]
                own = self.particles.level[i]
                left = own - (now - self.particles.updated[i])
                if own > level or left <= 0:
                    count += 1
                elif own < level:
                    waiting, soonest = 2, ti.min(soonest, left)
            if waiting > 0:
                ti.atomic_min(self.until_next[None], soonest)
        if arrived > 0:
            self.grid.arrived[block] = waiting
        if count == end - first and (level != before or arrived > 0):
            for k in range(first, end):
                self.particles.level[self.grid.order[k]] = level
        if count > 0:
            self.add(self.updates, level, count)
        if ti.static(not self.grid.serial):
            ti.atomic_min(self.until_next[None], level - now % level)
        self.block_due[block] = count

    @ti.func
    def is_due(self, block, k):
        """Whether the particle at place `k` is due, where some of `block` are; it then takes the block's level."""
        i, due = self.grid.order[k], True
        if self.block_due[block] < self.grid.first(block + 1) - self.grid.first(block):
            own, level = self.particles.level[i], self.block_level[block]
            due = own > level or own - (self.present[None] - self.particles.updated[i]) <= 0
            if due:
                self.particles.level[i] = level
        return due

    @ti.func
    def note_present(self, present, now):
        """Find when the next step ends; an atomic minimum over all blocks would take longer on a CPU."""
        until_next = self.until_next[None]
        for n in ti.static(self.lengths):
            if (present >> (n - 1)) & 1 == 1:
                until_next = ti.min(until_next, n - now % n)
        self.until_next[None] = until_next

    @ti.func
    def evaluated(self, i, acceleration, tick):
        """Lines 12-14 in time: if the new `acceleration` [m/s^2] of particle `i` breaks Eq. 2, its block is looked at sooner."""
        if ti.static(self.levels > 1):
            level = self.particles.level[i]
            acceleration2 = acceleration.norm_sqr()
            if level > 1 and not criteria.allows_force(tick * level, self.lambda_f, self.support, acceleration2):
                ti.atomic_min(self.until_next[None], 1)

    @ti.kernel
    def count_held(self):
        for block in range(self.blocks):
            self.leave(block)

    def take_counts(self) -> tuple[list[int], list[int]]:
        """Return particles and updates per level since the last call."""
        self.count_held()
        return super().take_counts()
