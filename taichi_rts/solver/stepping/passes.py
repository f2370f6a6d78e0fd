"""The passes of asynchronous steps: which cells may step now, and how far."""

import math
from typing import Any

import numpy as np

from taichi_rts.device import backend
from taichi_rts.device.backend import ti
from taichi_rts.device.counters import Counters
from taichi_rts.device.fields import Declared, integers
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping import criteria
from taichi_rts.solver.stepping.cells import Cells
from taichi_rts.solver.stepping.limiter import NeighbourLimiter
from taichi_rts.solver.stepping.limits import BlockMaxima
from taichi_rts.solver.stepping.settled import SettledCells
from taichi_rts.solver.stepping.timeline import Timeline

LOG = 1 << 14  # passes whose width is kept on the device between two looks


@ti.data_oriented
class AsynchronousSchedule(Cells):
    """Passes: each collects the cells that may step, and after their evaluation gives them their next steps.

    Passes come in cycles. A cycle begins at tick `now`, when no particle's last evaluation lies after it and no step ends
    before it; then the grid is sorted, by positions at that one time. Cells hold at the cycle's end until all have arrived.
    Within a cycle a cell's particles stay the same, so a particle that crosses into a cell of another time does so between two
    cycles. It keeps its state and its own time until the cell steps, at the time of its youngest particle; then all of the
    cell move to one new time, and whose step would have lasted longer ends it there, corrected with the time that elapsed.
    """

    levels_double = True
    transient = frozenset({"reads_are_slow"})  # of the device

    def __init__(
        self, settled: SettledCells, scene: Scene, particles: FluidState, grid: BlockGrid, timeline: Timeline
    ) -> None:
        super().__init__(particles, grid, settled)
        self.scene = scene
        self.retime(settled, timeline)
        self.maxima = BlockMaxima(scene, particles, grid)
        self.powers_of_two = settled.powers_of_two
        self.staggered = settled.staggered
        self.seed = settled.seed
        self.limiter = NeighbourLimiter(aligned=self.powers_of_two)
        self.slow_speed = criteria.MACH * scene.least_wave_speed
        self.by_sound = scene.regional_sound is not None
        self.viscous_reach = criteria.viscous_step(scene.support, 1.0) * (1.0 + 1e-6)  # [m^2]
        self.drift_time = ti.field(float, ())
        self.passes = ti.field(ti.i32, ())
        self.passes_in_cycle = ti.field(ti.i32, ())
        self.wakes = Counters()
        self.clamped = Counters()
        self.target = 0
        self.cycle_end = 1  # of the evaluation at tick 0, before which no acceleration is known
        self.cycles = 1
        self.launched = 0
        self.blind = 0
        self.reads_are_slow = backend.current().arch != "cpu"
        self.seen_widths: list[np.ndarray] = []

    @classmethod
    def fields(cls, settled: Any, particles: int, blocks: int, *, serial: bool) -> list[Declared]:
        """Declare the fields for so many particles and blocks."""
        return super().fields(settled, particles, blocks, serial=serial) + integers(LOG, "widths")

    def retime(self, settled: SettledCells, timeline: Timeline) -> bool:
        """Take another courant; the number of ticks in the longest step is compiled in."""
        self.settled = settled
        self.tick = timeline.tick
        self.fast_reach = (1.0 + criteria.MACH) * settled.longest_courant * self.scene.support  # [m]
        return settled.levels == self.levels

    # -- what the host decides: cycles ------------------------------------------------------------------------------

    def begin(self, timeline: Timeline, target: int) -> bool:
        """Return True while some cell's time is not after tick `target`; starts a new cycle where one is over."""
        self.target = target
        if self.blind > 0 and not self.debug:
            self.blind -= 1
            return self.launch(False)
        youngest = int(self.youngest[None])
        if (
            youngest == self.EMPTY
        ):  # outlets have taken out all; what an inflow still brings comes when the grid is sorted
            youngest = self.cycle_end
        if youngest > target:
            self.steps = max(self.steps, target)
            return False
        if youngest < self.cycle_end:
            return self.launch(False)
        timeline.now = self.steps = youngest
        self.cycle_end = timeline.now + self.cycle_length(youngest)
        self.cycles += 1
        if self.reads_are_slow:
            self.blind = max(0, int(self.passes_in_cycle[None]) - 1)
        return self.launch(True)

    def restart(self, now: int) -> None:
        """Forget steps, and begin with a cycle of one evaluation."""
        self.particles.level.fill(0)
        self.target = self.steps = now
        self.cycle_end = now + 1
        self.blind = 0
        self.needs_sorting = self.needs_sound = True
        self.take_counts()
        self.seen_widths.clear()
        self.cycles = 1
        self.wakes.clear()
        self.clamped.clear()

    def launch(self, needs_sorting: bool) -> bool:
        """Note that a pass begins.

        On a GPU as many passes as the last cycle needed are launched without looking; idle ones change nothing.
        """
        self.needs_sorting = self.needs_sound = needs_sorting
        self.launched += 1
        if self.launched == LOG:
            self.collect_widths()
        return True

    def cycle_length(self, now: int) -> int:
        """Ticks that the cycle from tick `now` may take: as long as no particle drifts further than the grid allows.

        Judged by speeds and accelerations at its start, so an impact within the cycle may exceed it a little; a pair that is
        missed then lies at the very edge of the support radius.
        """
        if self.levels == 1:
            return 1
        self.find_drift_time(now, self.tick)
        ticks = self.drift_time[None] / self.tick
        # Readers are at most one tick short of the cycle's end.
        return min(self.levels, math.floor(ticks) + 1) if ticks > 0.0 else 1

    @ti.kernel
    def find_drift_time(self, now: ti.i32, tick: float):
        """The shortest time [s] from `now` in which |v| t + |a| t^2/2 of some particle is all the drift that the grid allows."""
        longest = self.levels * tick
        self.drift_time[None] = longest
        for i in range(self.particles.alive[None]):
            a = self.particles.a[i].norm()
            elapsed = ti.cast(now - self.particles.updated[i], float) * tick
            v = (self.particles.v[i] + self.particles.a[i] * elapsed).norm()
            drift = ti.static(self.grid.geometry.drift)
            reach = v + ti.sqrt(v * v + 2.0 * a * drift)
            if reach * longest > 2.0 * drift:
                ti.atomic_min(self.drift_time[None], 2.0 * drift / reach)

    def sorted(self, now: int, tick: float) -> None:
        """Find the occupied cells, their times and steps."""
        self.passes_in_cycle[None] = 0
        self.find_cells()

    # -- before the evaluation: which cells step --------------------------------------------------------------------

    def select(self, now: int, tick: float) -> None:
        """Find the cells that may step, the particles due in them, and when each cell near them is read."""
        self.choose(now, self.target, self.cycle_end)
        if self.debug:
            self.check(now)

    def check(self, now: int) -> None:
        """Debug runs: raise `AssertionError` for a pass in which no particle steps or any is extrapolated."""
        self.count_extrapolated(now)
        assert int(self.stepping[None]) > 0, f"no cell may step at tick {int(self.youngest[None])}"
        assert int(self.extrapolated[None]) == 0, f"particles extrapolated near tick {int(self.youngest[None])}"

    # -- after the evaluation: the next steps -----------------------------------------------------------------------

    def observe(self, now: int, tick: float) -> None:
        """Give the cells that stepped their next step, and wake neighbours whose step is too long beside it."""
        if self.by_sound:
            self.sound.update_some(self, tick)
        self.propose_steps(now, tick, self.fast_reach)
        self.assign_steps()
        self.wake_neighbours(now)
        self.read_changed_cells()
        self.log_pass()
        self.find_youngest()

    @ti.kernel
    def propose_steps(self, now: ti.i32, tick: float, fast_reach: float):
        """The longest step that the CFL condition and the force limit of a cell's particles allow, in ticks."""
        for m in range(self.occupied_count[None]):
            block = self.occupied[m]
            step = self.step[block]
            if self.block_due[block] > 0:
                time = self.time[block]
                speed2, acceleration2, viscosity, density = self.maxima.of(block, time, tick)
                sound = criteria.stiffening(density) * self.scene.wave_speed
                if ti.static(self.by_sound):
                    sound = self.sound.limit[block]
                wanted = self.longest_step(tick, fast_reach, ti.sqrt(speed2), ti.sqrt(acceleration2), viscosity, sound)
                if ti.static(self.staggered):
                    if step == 0:
                        wanted = 1 + ti.cast(self.noise(block) % ti.cast(wanted, ti.u32), ti.i32)
                wanted = self.rounded(wanted)
                if ti.static(self.settled.limiter):
                    if step > 0:  # the first step has none to grow from
                        wanted = self.rounded(self.limiter.settled(wanted, step, time))
                step = self.aligned(wanted, time)
            self.proposal[block] = step

    @ti.func
    def longest_step(self, tick, fast_reach, speed, acceleration, viscosity, sound):
        """Smallest of the CFL limit, the force and viscous limits and the longest step, rounded down to >= 1 tick.

        The CFL limit is `fast_reach` [m] over the sum of |v|, where it exceeds Mach 0.1, and the local sound speed [m/s].
        """
        step = ti.cast(self.levels, float)
        slow = criteria.MACH * sound if ti.static(self.by_sound) else self.slow_speed
        if speed > slow or sound > self.scene.least_wave_speed:
            step = ti.min(step, fast_reach / ((sound + ti.max(speed, slow)) * tick) * (1.0 + 1e-6))
        if acceleration > 0.0:
            step = ti.min(step, self.settled.lambda_f * ti.sqrt(self.scene.support / acceleration) / tick)
        if viscosity > 0.0:
            step = ti.min(step, self.viscous_reach / (viscosity * tick))
        if step < 1.0:
            self.clamped.add(0, 1)
        return ti.max(1, ti.cast(ti.floor(step), ti.i32))

    @ti.func
    def rounded(self, step):
        """Round down to a length that steps may have."""
        result = step
        if ti.static(self.powers_of_two):
            result = 1
            for _ in ti.static(range(self.levels.bit_length() - 1)):
                if 2 * result <= step:
                    result *= 2
        return result

    @ti.func
    def aligned(self, step, time):
        """With powers of two a step begins at a multiple of itself, so that cells of one step meet."""
        result = step
        if ti.static(self.powers_of_two):
            for _ in ti.static(range(self.levels.bit_length() - 1)):
                if time % result != 0:
                    result //= 2
        return result

    @ti.func
    def noise(self, block):
        """A random number from the stepper's seed and the cell's index."""
        x = ti.cast(self.grid.geometry.number(block), ti.u32) * ti.u32(2654435761) + ti.cast(self.seed, ti.u32)
        x = (x ^ (x >> 16)) * ti.u32(2246822519)
        return (x ^ (x >> 13)) & ti.u32(0xFFFF)

    @ti.kernel
    def assign_steps(self):
        """Begin the next step of the particles that were evaluated."""
        for m in range(self.occupied_count[None]):
            block = self.occupied[m]
            if self.block_due[block] > 0:
                step = self.proposal[block]
                if ti.static(self.settled.limiter):
                    shortest = self.shortest_beside(self.proposal, block)
                    step = self.rounded(self.limiter.limited(step, shortest))
                for n in range(self.due_start[block], self.due_start[block] + self.block_due[block]):
                    i = self.grid.order[self.due[n]]
                    self.particles.level[i] = step
                self.step[block] = step

    @ti.kernel
    def wake_neighbours(self, now: ti.i32):
        """Wake cells beside one that has just begun a much shorter step: theirs end early."""
        if ti.static(self.settled.limiter):
            for m in range(self.occupied_count[None]):
                block = self.occupied[m]
                if self.read_at[block] >= 0:
                    # A cell's own older particles, which did not step with the others, are woken as well.
                    shortest = self.step[block] if self.block_due[block] > 0 else self.EMPTY
                    for k in ti.static(range(len(self.grid.geometry.offsets))):
                        other = self.grid.geometry.beside(block, k)
                        if self.block_due[other] > 0:
                            shortest = ti.min(shortest, self.step[other])
                    if shortest != self.EMPTY:
                        self.wake(block, now + self.read_at[block], shortest)

    @ti.kernel
    def read_changed_cells(self):
        """Take the new times of the cells that stepped or may have been woken."""
        for m in range(self.occupied_count[None]):
            if self.read_at[self.occupied[m]] >= 0:
                self.read_cell(self.occupied[m])

    @ti.func
    def wake(self, block, now, shortest):
        """End the steps of a cell's particles where they are too long beside a step of `shortest` that begins at `now`."""
        woken = 0
        for k in range(self.grid.first(block), self.grid.first(block + 1)):
            i = self.grid.order[k]
            began, step = self.particles.updated[i], self.particles.level[i]
            end = self.limiter.woken_end(began, step, now, shortest)
            if end < began + step:
                self.particles.level[i] = end - began
                woken += ti.cast(began < now, ti.i32)
        self.wakes.add(0, woken)  # an atomic in the loop would end it on lavapipe

    @ti.kernel
    def log_pass(self):
        """Note how many cells stepped in this pass."""
        if self.stepping[None] > 0:
            self.widths[self.passes[None] % LOG] = self.stepping[None]
            self.passes[None] += 1
            self.passes_in_cycle[None] += 1

    # -- what the run has to say ------------------------------------------------------------------------------------

    def collect_widths(self) -> None:
        """Fetch the widths of the passes since the last call."""
        if self.launched:  # the evaluation at tick 0, before the run, is not part of it
            self.seen_widths.append(self.widths.to_numpy()[: int(self.passes[None])])
        self.passes[None] = self.launched = 0

    def take_counts(self) -> tuple[list[int], list[int]]:
        """Return base steps spent at each step length, and updates, since the last call."""
        updates = self.updates.take()[1:]
        self.collect_widths()
        return (updates * np.arange(1, self.levels + 1)).tolist(), updates.tolist()

    def statistics(self) -> dict[str, Any]:
        """Return passes, cells per pass, cycles (sorts of the grid), particles woken, cells for which a tick was too long."""
        widths = np.concatenate(self.seen_widths) if self.seen_widths else np.zeros(0, np.int32)
        some = widths if len(widths) else np.zeros(1, np.int32)
        return {
            "passes": len(widths),
            "cells_per_pass": {"min": int(some.min()), "median": float(np.median(some)), "max": int(some.max())},
            "cycles": self.cycles,
            "wakes": int(self.wakes),
            "clamped": int(self.clamped),
            "extrapolations": int(self.extrapolated[None]) if self.debug else None,
        }
