"""What runs on the device for one scene and stepper: the parts, and what comes before lines 5 and 18 of Algorithm 1."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from taichi_rts.medium.medium import Medium
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.motion.inflow import Inflows
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.motion.outlet import Outlets
from taichi_rts.solver.particles.extra import Extra
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.physics.density import Density
from taichi_rts.solver.sound.rule import SoundRule
from taichi_rts.solver.stepping.base import Schedule
from taichi_rts.solver.stepping.timeline import Timeline

REORDER_EVERY = 32  # sorts between moving the state itself into the grid's order, for locality only


@dataclass(eq=False)
class Solver:
    """The parts of a run, wired by `assembly.build.assemble`; `Simulation.step` has them do one step.

    Attributes:
        inflows, outlets, sound: what only some scenes have, else None.
        extras: these, and whatever else only some runs have, in the order in which their hooks are called.
        ticking: what is counted in ticks since each piece of its motion began.
    """

    particles: FluidState
    near: Neighbourhood
    grid: BlockGrid
    walls: list[Any]
    medium: Medium
    density: Density
    motion: Motion
    timeline: Timeline
    schedule: Schedule
    inflows: Inflows | None = None
    outlets: Outlets | None = None
    sound: SoundRule | None = None
    extras: list[Extra] = field(default_factory=list)
    ticking: list[Any] = field(default_factory=list)
    sorts: int = 0
    counted_in: float = 0.0

    def count_in(self, tick: float) -> None:
        """Let all that the scene moves be counted in ticks of this length [s]; another courant has another one."""
        if tick != self.counted_in:
            self.counted_in = tick
            for part in self.ticking:
                part.count_in(tick)

    def sort(self, now: int, tick: float, before_change: Callable[[], object]) -> None:
        """Sort the grid at tick `now` (line 4), with what has flowed in and without what has flowed out.

        `before_change()` is called before the number of particles changes.
        """
        for extra in self.extras:
            extra.before_sort(now, tick, before_change)
        if self.sorts % REORDER_EVERY == 0:
            self.particles.reorder(self.grid.order)
            if self.grid.tracks_arrivals:
                self.grid.arrived.fill(1)  # so that all blocks are looked at now and then
        self.sorts += 1
        self.motion.sort_particles(now, tick)
        self.schedule.sorted(now, tick)

    def before_regions(self, now: int, tick: float) -> None:
        """Let extras do what comes before lines 5-16 at tick `now`."""
        for extra in self.extras:
            extra.before_regions(self.schedule, now, tick)

    def before_forces(self, now: int, tick: float) -> None:
        """Let extras do what comes before lines 18-29 at tick `now`."""
        for extra in self.extras:
            extra.before_forces(self.schedule, now, tick)
