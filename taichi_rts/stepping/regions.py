"""Who is due in regional time stepping: lines 5-16 of Algorithm 1 of Goswami & Batty 2014."""

import math
from typing import TYPE_CHECKING

import taichi as ti

from taichi_rts.backend import threads
from taichi_rts.counters import Counters
from taichi_rts.grid import BlockGrid
from taichi_rts.particles import Particles
from taichi_rts.scan import ExclusiveScan
from taichi_rts.scene import Scene
from taichi_rts.stepping import criteria
from taichi_rts.stepping.base import Schedule
from taichi_rts.stepping.limiter import BlockLimiter, NeighbourLimiter, Sweep
from taichi_rts.stepping.limits import BlockMaxima
from taichi_rts.stepping.timeline import Timeline
from taichi_rts.surroundings import Surroundings

if TYPE_CHECKING:
    from taichi_rts.stepping.regional import Regional

MOST_HELD = 1 << 30
"""Particles times steps at which a block hands over what it has counted by itself; a pass adds less than that again."""


def lengths(steps: str, most: int) -> list[int]:
    """Levels up to `most` that blocks may have."""
    keep = {
        "integers": lambda n: True,
        "powers_of_two": lambda n: n & (n - 1) == 0,
        "half_octaves": lambda n: n & (n - 1) == 0 or (n % 3 == 0 and (n // 3) & (n // 3 - 1) == 0),
    }[steps]
    return [n for n in range(1, most + 1) if keep(n)]


@ti.data_oriented
class RegionalSchedule(Schedule):
    """Region determination and compute flags: lines 5-16 of Algorithm 1.

    `block_level` is the region of each block (`BlockLimiter.EMPTY` where there is no particle).
    """

    transient = frozenset({"scan", "occupancy", "updates", "rows", "present", "passed", "ends"})

    def __init__(self, stepper: "Regional", scene: Scene, particles: Particles, grid: BlockGrid) -> None:
        super().__init__(particles, grid)
        self.scene = scene
        self.levels = stepper.resolved("levels")
        self.lambda_f = stepper.resolved("lambda_f")
        self.support = scene.support
        self.sound_speed = scene.wave_speed
        self.local_sound = stepper.local_sound
        self.retime(stepper)
        self.fractions = [
            criteria.velocity_fraction(n, stepper.alpha, stepper.beta, stepper.resolved("beta_decay"))
            for n in range(2, self.levels + 1)
        ]
        blocks = grid.geometry.blocks
        self.blocks = blocks
        self.raw_level = ti.field(ti.i32, blocks)
        self.block_level = ti.field(ti.i32, blocks)
        self.maxima = BlockMaxima(scene, particles, grid)
        self.beside = BlockLimiter(grid.geometry)
        self.limits = stepper.resolved("limiter")
        self.by_sound = scene.regional_sound is not None
        self.lengths = lengths(stepper.resolved("steps"), self.levels)
        self.aligned = self.by_sound or stepper.resolved("steps") != "integers"
        self.levels_double = self.aligned
        self.limiter = NeighbourLimiter(doubling=False)
        self.until_next = ti.field(ti.i32, ())
        self.present, self.passed, self.ends = (ti.field(ti.i32, ()) for _ in range(3))
        """Tick, ticks since the last call, and whether aligned steps of n ticks end now, in bit n - 1."""
        self.now = 0
        reach = NeighbourLimiter.RATIO if self.by_sound else 1  # the sound speed has spread by a block already
        ratio_sweeps = max(0, math.ceil(math.log2(self.levels)) - 1) if self.limits else 0
        if self.by_sound:  # whose sound speeds are graded already; forces are not, but reach no further
            ratio_sweeps = min(1, ratio_sweeps)
        grading_sweeps = max(0, self.levels - 2) if stepper.grading else 0
        ratio, grading = ratio_sweeps * [(NeighbourLimiter.RATIO, 0)], grading_sweeps * [(1, 1)]
        rules = [(reach, 0), *ratio, *grading] if self.levels > 1 else []
        to_and_fro = (self.block_level, self.raw_level)  # the last sweep writes `block_level`
        self.own_level = to_and_fro[len(rules) % 2]
        """What each block allows itself, where the first sweep reads it."""
        self.sweeps = [
            Sweep(
                self.beside, to_and_fro[left % 2], to_and_fro[(left - 1) % 2], *rule, self.settle if left == 1 else None
            )
            for left, rule in zip(range(len(rules), 0, -1), rules, strict=True)
        ]
        self.around = Surroundings(grid)
        self.raw_level.fill(BlockLimiter.EMPTY)
        self.block_level.fill(BlockLimiter.EMPTY)
        self.read_at.fill(-1)
        grid.track_vacated()
        if self.aligned:
            grid.track_arrivals()
            self.last_level = ti.field(ti.i32, blocks)
            self.last_level.fill(BlockLimiter.EMPTY)
            self.held = ti.field(ti.i32, blocks)
            """Particles times base steps that are not in `occupancy` yet: one by one is quicker than all in one place."""
        else:
            self.flag = ti.field(ti.i32, particles.capacity)
        self.remembers = self.aligned and not self.by_sound and self.levels > 1 and not self.maxima.moving
        if self.remembers:
            self.wanted = ti.field(ti.i32, blocks)
            """What each block allowed when it was last looked at.

            Until somebody in it steps again speeds grow by constant accelerations, and the left side of Eq. 3 by no more than
            lambda_f^2 (Eq. 2), 0.01 of 0.16.
            """
        self.block_due = ti.field(ti.i32, blocks)
        self.due_start = ti.field(ti.i32, blocks + 1)
        if not grid.serial:
            self.scan = ExclusiveScan(self.block_due, self.due_start)
            self.due_count = self.scan.total
        self.rows = threads() if grid.serial else 1
        self.width = -(-(self.levels + 1) // 16) * 16
        self.occupancy, self.updates = (Counters(self.rows * self.width, alone=grid.serial) for _ in range(2))
        """Particles and updates by level, of each thread of a CPU for itself: in one place they would wait for each other."""

    def retime(self, stepper: "Regional", timeline: Timeline | None = None) -> bool:
        """Take another courant."""
        self.reach = stepper.longest_courant * self.support
        if self.scene.regional_sound is not None:
            self.reach = stepper.in_scene(self.scene).resolved("courant") * self.support
        return True

    def restart(self, now: int) -> None:
        """Forget steps and levels."""
        self.now = self.steps = now
        self.particles.level.fill(0)
        self.block_level.fill(BlockLimiter.EMPTY)
        if self.aligned:
            self.last_level.fill(BlockLimiter.EMPTY)
            self.held.fill(0)
        self.take_counts()

    def begin(self, timeline: Timeline, target: int) -> bool:
        """Set the clock to the next step at which somebody may be due."""
        begun = super().begin(timeline, target)
        # Those in which nobody is due have passed as well.
        self.steps = timeline.now if begun else max(self.steps, target)
        return begun

    def next_ticks(self) -> int:
        """Ticks to the end of the first step that ends: before it nobody is due."""
        return max(1, int(self.until_next[None])) if self.aligned else 1

    def select(self, now: int, tick: float) -> None:
        """Algorithm 1, lines 5-16, and the list of due particles."""
        self.decide(now, now - self.now, tick, self.reach)
        self.now = now

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
        """Keep what `settle` has to know, and find which aligned steps end now."""
        self.present[None], self.passed[None] = now, passed
        if ti.static(self.aligned):
            self.until_next[None] = self.levels
            ends = 0
            for n in ti.static(self.lengths):
                ends |= ti.cast(now % n == 0, ti.i32) << (n - 1)
            self.ends[None] = ends

    @ti.func
    def forget_vacated(self):
        """Blocks that hold nobody any more have no region, nobody due, and are not read."""
        ti.loop_config(serialize=self.grid.serial)  # they are few
        for m in range(self.grid.vacated_count[None]):
            block = self.grid.vacated[m]
            if ti.static(self.aligned):
                if self.held[block] > 0:
                    self.add(self.occupancy, self.last_level[block], self.held[block])
                    self.held[block] = 0
                self.last_level[block] = BlockLimiter.EMPTY
            self.raw_level[block] = self.block_level[block] = BlockLimiter.EMPTY
            self.block_due[block] = 0
            self.read_at[block] = -1

    @ti.func
    def determine_regions(self, now, tick, reach):
        """Lines 6-9: maxima of |v| and F/m over each block, and the largest n that Eq. 2 and 3 allow.

        Where no sweep follows, lines 10-16 as well.
        """
        for m in range(self.grid.occupied_count[None]):
            block = self.grid.occupied[m]
            level = 1
            before = self.block_level[block]  # of the last step; who was empty has nothing to grow from
            if ti.static(self.levels == 1):
                level = 1
            elif ti.static(self.by_sound):  # whose rule has reduced the block already
                level = self.region_by_sound(block, tick, reach)
            elif ti.static(self.remembers):
                if before == BlockLimiter.EMPTY or self.has_stepped(block) or self.grid.arrived[block] == 1:
                    self.wanted[block] = self.region_of(block, now, tick, reach)
                level = self.wanted[block]
            else:
                level = self.region_of(block, now, tick, reach)
            if ti.static(self.limits):
                if before != BlockLimiter.EMPTY:
                    if ti.static(self.aligned):
                        level = self.grown(level, before, now)
                    else:
                        level = self.limiter.settled(level, before, now)
            self.own_level[block] = level
            if ti.static(len(self.sweeps) == 0):
                self.settle(block)

    @ti.func
    def has_stepped(self, block):
        """Whether somebody in `block` was due in the last step."""
        return self.block_due[block] > 0

    @ti.func
    def region_of(self, block, now, tick, reach):
        """The largest n that the particles of `block` allow."""
        speed2, acceleration2, viscosity, density = self.maxima.of(block, now, tick)
        return self.region(tick, reach, speed2, acceleration2, viscosity, density)

    @ti.func
    def region(self, base_step, reach, speed2, acceleration2, viscosity, density):
        """Section 2: the largest n whose step satisfies Eq. 2, Eq. 3, the viscous limit and Eq. 1 with the local sound speed.

        (With c_s Eq. 1 is the same for all blocks: it sets the base step.)
        """
        level = 1
        for n in ti.static(range(2, self.levels + 1)):
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
    def grown(self, wanted, before, now):
        """Level of a block that had another: less at once, more only by one of `lengths`, at a multiple of it."""
        level = wanted
        if wanted > before:
            level = before
            for k in ti.static(range(len(self.lengths) - 1)):
                if before == self.lengths[k] and now % self.lengths[k + 1] == 0:
                    level = self.lengths[k + 1]
        return level

    @ti.func
    def region_by_sound(self, block, base_step, reach):
        """The largest level for which Eq. 1 holds with the block's own sound speed [m/s], Eq. 2 and the viscous limit."""
        acceleration2, viscosity = self.sound.acceleration2[block], self.sound.viscosity[block]
        sound = self.sound.limit[block]
        level = 1
        for n in ti.static(range(2, self.levels + 1)):
            if ti.static(n in self.lengths):
                step = base_step * n
                if criteria.allows_force(step, self.lambda_f, self.support, acceleration2):
                    if criteria.allows_viscosity(step, self.support, viscosity):
                        if step * sound <= reach * (1.0 + 1e-6):
                            level = n
        return level

    @ti.func
    def apply_minimum_region(self):
        """R_min of Section 3, then the sweeps of the limiter and of grading, which spread by a block each.

        The last goes on with lines 10-16 for each block that it is done with.
        """
        for sweep in ti.static(self.sweeps):
            self.around.visit(sweep, True, BlockLimiter.EMPTY)

    @ti.func
    def settle(self, block):
        """Lines 10-16 for the particles of `block`, whose level is found."""
        if ti.static(self.aligned):
            self.update_aligned_validity(block, self.present[None], self.passed[None])
        else:
            self.update_validity(block, self.present[None], self.passed[None])

    @ti.func
    def update_validity(self, block, now, passed):
        """Lines 10-16: find who in `block` is due, because its validity has run out or its block has another step.

        All take the step of their block.
        """
        first, end = self.grid.first(block), self.grid.first(block + 1)
        level = self.block_level[block]
        count = 0
        for k in range(first, end):
            i = self.grid.order[k]
            own = self.particles.level[i]
            flag = ti.cast(own - (now - self.particles.updated[i]) <= 0 or own != level, ti.i32)
            if own != level:
                self.particles.level[i] = level
            self.flag[k] = flag
            count += flag
        self.block_due[block] = count
        self.add(self.occupancy, level, (end - first) * passed)
        self.add(self.updates, level, count)

    @ti.func
    def add(self, counts: ti.template(), level, count):
        """Add `count` to what is counted of `level`."""
        row = 0
        if ti.static(self.grid.serial):  # a statement: of an expression both sides would be compiled
            row = ti.global_thread_idx()
        counts.add(row * self.width + level, count)

    @ti.func
    def update_aligned_validity(self, block, now, passed):
        """The same where steps end at multiples of themselves: a block is due as a whole, or nobody in it.

        It is due at a multiple of its step, when that has become shorter, or when somebody comes into it with a longer one.
        Who comes with a shorter one steps with the block. Particles of other blocks need not be looked at.
        """
        first, end = self.grid.first(block), self.grid.first(block + 1)
        level, before = self.block_level[block], self.last_level[block]
        count = 0
        if self.held[block] > 0 and (level != before or self.held[block] >= MOST_HELD):
            self.add(self.occupancy, before, self.held[block])
            self.held[block] = 0
        due = (self.ends[None] >> (level - 1)) & 1 == 1 or level < before
        arrived = self.grid.arrived[block]
        if arrived == 1:
            self.grid.arrived[block] = 2  # until all have the block's level
            for k in range(first, end):
                due = due or self.particles.level[self.grid.order[k]] > level
        self.held[block] = self.held[block] + (end - first) * passed  # `+=` would be atomic
        if due:
            count = end - first
            if level != before or arrived > 0:
                self.grid.arrived[block] = 0
                for k in range(first, end):
                    self.particles.level[self.grid.order[k]] = level
            self.add(self.updates, level, count)
        if ti.static(not self.grid.serial):
            ti.atomic_min(self.until_next[None], level - now % level)
        self.block_due[block] = count
        self.last_level[block] = level

    @ti.func
    def find_due_starts(self, now):
        """Find for every block where its due particles will be in the list, and how many there are in all.

        On a CPU also when the next step ends: an atomic minimum over all blocks would take longer.
        """
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
                if ti.static(self.aligned):
                    until_next = self.levels
                    for n in ti.static(self.lengths):
                        if (present >> (n - 1)) & 1 == 1:
                            until_next = ti.min(until_next, n - now % n)
                    self.until_next[None] = until_next
        else:
            self.scan.scan()

    @ti.func
    def list_due(self):
        """List the places of due particles in the grid's order, so that memory access stays contiguous.

        And have the blocks read now that hold a due particle or lie beside one that does; the others are left alone.
        """
        if ti.static(self.levels == 1):  # where all are due
            for m in range(self.grid.occupied_count[None]):
                self.finish(self.grid.occupied[m], 0)
        else:
            self.around.visit(self, False, 0)

    @ti.func
    def read(self, block):
        """How many are due in `block`."""
        return self.block_due[block]

    @ti.func
    def finish(self, block, due_beside):
        """List who is due in `block`, and have it read if somebody is there or, `due_beside`, beside it."""
        if self.block_due[block] > 0:
            n = self.due_start[block]
            for k in range(self.grid.first(block), self.grid.first(block + 1)):
                if ti.static(self.aligned):
                    self.due[n] = k
                    n += 1
                else:
                    if self.flag[k] == 1:
                        self.due[n] = k
                        n += 1
        self.read_at[block] = 0 if self.block_due[block] > 0 or due_beside > 0 else -1

    @ti.kernel
    def count_held(self):
        for block in range(self.blocks):
            if self.held[block] > 0:
                self.add(self.occupancy, self.last_level[block], self.held[block])
                self.held[block] = 0

    def take_counts(self) -> tuple[list[int], list[int]]:
        """Return particles and updates per level since the last call."""
        if self.aligned:
            self.count_held()
        taken = (counters.take().reshape(self.rows, self.width) for counters in (self.occupancy, self.updates))
        occupancy, updates = (counts.sum(axis=0)[1 : self.levels + 1].tolist() for counts in taken)
        return occupancy, updates
