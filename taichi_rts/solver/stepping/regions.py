"""Regions and compute flags in regional time stepping: lines 5-17 of Algorithm 1 of Goswami & Batty 2014.

What all schemes share. When a block or a particle is due is the schemes' own: `validity.py` (the paper's, by particle),
`aligned.py` (blocks whose steps end at multiples of themselves) and `by_sound.py` (the same by the regional sound speed).
"""

import math
from typing import Any

from taichi_rts.device.backend import threads, ti
from taichi_rts.device.counters import Counters
from taichi_rts.device.fields import Declared, integers, within
from taichi_rts.device.scan import ExclusiveScan
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.surroundings import Surroundings
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping import criteria
from taichi_rts.solver.stepping.base import Schedule
from taichi_rts.solver.stepping.limiter import EMPTY, GrowingSweep, Ladder, NeighbourLimiter, Sweep
from taichi_rts.solver.stepping.limits import BlockMaxima
from taichi_rts.solver.stepping.settled import SettledRegions
from taichi_rts.solver.stepping.timeline import Timeline


@ti.data_oriented
class RegionalSchedule(Schedule):
    """Region determination and compute flags: lines 5-17 of Algorithm 1.

    Level n of a block means steps of n base steps; all levels are members of `lengths`, after every rule: a level whose step
    never ends would never be due. `raw_level` is what a block allows itself, `block_level` its region (`EMPTY` where there is
    no particle), `last_level` that of the step before.

    A scheme adds `update_validity`, which finds what is due in a block.
    """

    transient = frozenset({"scan", "occupancy", "updates", "rows", "present", "passed"})
    reach_of_regions = 1
    """How much longer than a neighbour's a block's step may be at once: 1 is the paper's R_min."""

    def __init__(self, settled: SettledRegions, scene: Scene, particles: FluidState, grid: BlockGrid) -> None:
        super().__init__(particles, grid, settled)
        self.scene = scene
        self.levels = settled.levels
        self.lambda_f = settled.lambda_f
        self.support = scene.support
        self.sound_speed = scene.wave_speed
        self.local_sound = settled.local_sound
        self.retime(settled)
        self.fractions = list(settled.fractions)
        self.lengths = list(settled.lengths)
        self.ladder = Ladder(self.lengths)
        self.limits = settled.limiter
        self.blocks = grid.geometry.blocks
        self.level_fields = [self.raw_level, self.block_level]
        self.keeps_last = self.aligned or self.limits
        if self.keeps_last:
            self.level_fields.append(self.last_level)
        self.maxima = BlockMaxima(scene, particles, grid)
        self.present, self.passed = (ti.field(ti.i32, ()) for _ in range(2))
        """Tick, and ticks since the last call."""
        self.now = 0
        self.sweeps = self.make_sweeps(settled) if self.levels > 1 else []
        self.around = Surroundings(grid)
        for field in self.level_fields:
            field.fill(EMPTY)
        self.read_at.fill(-1)
        grid.track_vacated()
        if not grid.serial:
            self.scan = ExclusiveScan(self.block_due, self.due_start)
            self.due_count = self.scan.total
        self.rows, self.width = self.counts_shape(self.levels, serial=grid.serial)
        self.occupancy, self.updates = (Counters(self.rows * self.width, alone=grid.serial) for _ in range(2))
        """Particles and updates by level, of each thread of a CPU for itself: in one place they would wait for each other."""

    @classmethod
    def fields(cls, settled: Any, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields for so many particles and blocks."""
        counts = Counters.fields(math.prod(cls.counts_shape(settled.levels, serial=serial)))
        return [
            *super().fields(settled, particles, blocks, serial=serial),
            *integers(blocks, "raw_level", "block_level"),
            *(integers(blocks, "last_level") if cls.aligned or settled.limiter else []),
            *(integers(blocks, "swept") if sum(cls.more_sweeps(settled)) else []),
            *within("grid", BlockGrid.vacated_fields(blocks)),
            *integers(blocks, "block_due"),
            *integers(blocks + 1, "due_start"),
            *([] if serial else within("scan", ExclusiveScan.fields(blocks))),
            *within("occupancy", counts),
            *within("updates", counts),
        ]

    @staticmethod
    def counts_shape(levels: int, *, serial: bool) -> tuple[int, int]:
        """Return rows and columns of what is counted by level: a row a thread, in whole lines of the cache."""
        return threads() if serial else 1, -(-(levels + 1) // 16) * 16

    # -- which rules there are ----------------------------------------------------------------------------------------

    @classmethod
    def more_sweeps(cls, settled: SettledRegions) -> tuple[int, int]:
        """Return how many sweeps follow the first: of the limiter, and of grading."""
        if settled.levels == 1:
            return 0, 0
        grading = max(0, len(settled.lengths) - 2) if settled.grading else 0
        return cls.ratio_sweeps(settled.levels) if settled.limiter else 0, grading

    def make_sweeps(self, settled: SettledRegions) -> list[Sweep]:
        """Return the sweeps from `raw_level` to `block_level`: R_min and growth, the limiter's, and those of grading.

        Each spreads by a block; the last goes on with lines 10-16 for each block that it is done with.
        """
        limiting, grading = self.more_sweeps(settled)
        rules = limiting * [self.twice] + grading * [self.ladder.above]
        to_and_fro = [self.block_level]
        if rules:
            self.level_fields.append(self.swept)
            to_and_fro = [self.block_level, self.swept]
        left = len(rules)
        target, then = to_and_fro[left % len(to_and_fro)], self.settle if left == 0 else None
        most = self.same if self.reach_of_regions == 1 else self.twice
        sweeps: list[Sweep] = [Sweep(self.raw_level, target, most, then)]
        if self.limits:
            growth = self.ladder.above if settled.grading else self.twice
            growing = (self.ladder, most, growth, self.present, then)
            sweeps = [GrowingSweep(self.raw_level, self.last_level, target, *growing)]
        for rule in rules:
            left -= 1
            source, target = target, to_and_fro[left % 2]
            sweeps.append(Sweep(source, target, rule, self.settle if left == 0 else None))
        return sweeps

    @classmethod
    def ratio_sweeps(cls, levels: int) -> int:
        """How many sweeps it takes until no block steps more than `NeighbourLimiter.RATIO` times as long as a neighbour."""
        return max(0, math.ceil(math.log2(levels)) - 1)

    @ti.func
    def same(self, level):
        """R_min: the outer layer of the slower side takes the faster side's step."""
        return level

    @ti.func
    def twice(self, level):
        """The neighbour limiter."""
        return NeighbourLimiter.RATIO * level

    # -- the clock ----------------------------------------------------------------------------------------------------

    def retime(self, settled: SettledRegions, timeline: Timeline | None = None) -> bool:
        """Take another courant."""
        self.reach = settled.longest_courant * self.support
        return True

    def restart(self, now: int) -> None:
        """Forget steps and levels."""
        self.now = self.steps = now
        self.particles.level.fill(0)
        for field in self.level_fields:
            field.fill(EMPTY)
        self.take_counts()

    def select(self, now: int, tick: float) -> None:
        """Algorithm 1, lines 5-17: the list of due particles."""
        if self.debug and (late := self.count_late(now)):
            raise AssertionError(f"{late} particles are late at tick {now}: their step of {self.lengths} ticks is over")
        self.decide(now, now - self.now, tick, self.reach)
        self.now = now

    @ti.kernel
    def count_late(self, now: ti.i32) -> ti.i32:
        late = 0
        for i in range(self.particles.alive[None]):
            if self.particles.level[i] > 0 and now - self.particles.updated[i] > self.particles.level[i]:
                late += 1
        return late

    @ti.kernel
    def decide(self, now: ti.i32, passed: ti.i32, tick: float, reach: float):
        """All of it; `passed` ticks have gone by since the last call. One kernel, for launches cost more than its loops."""
        self.note_time(now, passed)
        self.forget_vacated()
        self.determine_regions(now, tick, reach)
        self.apply_minimum_region()
        self.find_due_starts(now)
        self.list_due()

    @ti.func
    def note_time(self, now, passed):
        """Keep what `settle` has to know."""
        self.present[None], self.passed[None] = now, passed

    @ti.func
    def forget_vacated(self):
        """Blocks that hold no particle any more have no region, nothing due, and are not read."""
        ti.loop_config(serialize=self.grid.serial)  # they are few
        for m in range(self.grid.vacated_count[None]):
            block = self.grid.vacated[m]
            self.leave(block)
            for field in ti.static(self.level_fields):
                field[block] = EMPTY
            self.block_due[block] = 0
            self.read_at[block] = -1

    @ti.func
    def leave(self, block):
        """Take note that `block` has become empty."""

    # -- regions ------------------------------------------------------------------------------------------------------

    @ti.func
    def determine_regions(self, now, tick, reach):
        """Lines 6-9: maxima of |v| and F/m over each block, and the largest n that Eq. 2 and 3 allow.

        Where no sweep follows, lines 10-16 as well.
        """
        for m in range(self.grid.occupied_count[None]):
            block = self.grid.occupied[m]
            if ti.static(self.keeps_last):
                self.last_level[block] = self.block_level[block]
            if ti.static(self.levels == 1):
                self.raw_level[block] = self.block_level[block] = 1
                self.settle(block)
            else:
                if self.is_stale(block):
                    self.raw_level[block] = self.region_of(block, now, tick, reach)

    @ti.func
    def is_stale(self, block):
        """Whether what `block` allows itself has to be worked out anew."""
        return True

    @ti.func
    def region_of(self, block, now, tick, reach):
        """The largest level that the particles of `block` allow."""
        speed2, acceleration2, viscosity, density = self.maxima.of(block, now, tick)
        return self.region(tick, reach, speed2, acceleration2, viscosity, density)

    @ti.func
    def region(self, base_step, reach, speed2, acceleration2, viscosity, density):
        """Section 2: the largest level whose step satisfies Eq. 2, Eq. 3, the viscous limit and Eq. 1.

        Eq. 1 with the local sound speed: with c_s it is the same for all blocks, and sets the base step.
        """
        level = 1
        for n in ti.static(self.lengths[1:]):
            step = base_step * n
            if criteria.allows_force(step, self.lambda_f, self.support, acceleration2):
                if criteria.allows_velocity(step, ti.static(self.fractions[n - 2]), self.support, speed2):
                    if criteria.allows_viscosity(step, self.support, viscosity):
                        if ti.static(not self.local_sound) or criteria.allows_sound(
                            step, reach, self.sound_speed, density
                        ):
                            level = n
        return level

    @ti.func
    def apply_minimum_region(self):
        """R_min of Section 3, growth, and the sweeps of the limiter and of grading.

        The last goes on with lines 10-16 for each block that it is done with.
        """
        for sweep in ti.static(self.sweeps):
            if ti.static(sweep.sees_last):
                self.around.visit(sweep, True, ti.Vector([EMPTY, EMPTY]))
            else:
                self.around.visit(sweep, True, EMPTY)

    # -- what is due --------------------------------------------------------------------------------------------------

    @ti.func
    def settle(self, block):
        """Lines 10-16 for the particles of `block`, whose level is found."""
        self.update_validity(block, self.present[None], self.passed[None])

    @ti.func
    def add(self, counts: ti.template(), level, count):
        """Add `count` to what is counted of `level`."""
        row = 0
        if ti.static(self.grid.serial):  # a statement: of an expression both sides would be compiled
            row = ti.global_thread_idx()
        counts.add(row * self.width + level, count)

    @ti.func
    def find_due_starts(self, now):
        """Find for every block where its due particles will be in the list, and how many there are in all."""
        if ti.static(self.grid.serial):
            ti.loop_config(serialize=True)
            for _ in range(1):
                count, present = 0, 0
                for m in range(self.grid.occupied_count[None]):
                    block = self.grid.occupied[m]
                    self.due_start[block] = count
                    count += self.block_due[block]
                    present |= 1 << (self.block_level[block] - 1)
                self.due_count[None] = count
                self.note_present(present, now)
        else:
            self.scan.scan()

    @ti.func
    def note_present(self, present, now):
        """Take note of the levels that blocks have at tick `now`, level n in bit n - 1."""

    @ti.func
    def list_due(self):
        """Line 17: list the places of due particles in the grid's order, so that memory access stays contiguous.

        And have the blocks read now that hold a due particle or lie beside one that does; the others are left alone.
        """
        if ti.static(self.levels == 1):  # where all are due
            for m in range(self.grid.occupied_count[None]):
                self.finish(self.grid.occupied[m], 0)
        else:
            self.around.visit(self, False, 0)

    @ti.func
    def read(self, block):
        """How many particles are due in `block`."""
        return self.block_due[block]

    @ti.func
    def finish(self, block, due_beside):
        """List what is due in `block`, and have it read if anything is, or, `due_beside`, anything beside it."""
        if self.block_due[block] > 0:
            n = self.due_start[block]
            for k in range(self.grid.first(block), self.grid.first(block + 1)):
                if self.is_due(block, k):
                    self.due[n] = k
                    n += 1
        self.read_at[block] = 0 if self.block_due[block] > 0 or due_beside > 0 else -1

    # -- statistics ---------------------------------------------------------------------------------------------------

    def take_counts(self) -> tuple[list[int], list[int]]:
        """Return particles and updates per level since the last call."""
        taken = (counters.take().reshape(self.rows, self.width) for counters in (self.occupancy, self.updates))
        occupancy, updates = (counts.sum(axis=0)[1 : self.levels + 1].tolist() for counts in taken)
        return occupancy, updates
