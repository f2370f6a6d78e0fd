"""What a simulation is made of, for what reads it, carries it on or draws up its budget."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from taichi_rts.assembly.work import Overhead, Tally
from taichi_rts.device.backend import Backend
from taichi_rts.device.ownership import guarded
from taichi_rts.medium.medium import Medium
from taichi_rts.scene.placing import origin_of
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.motion.inflow import Inflows
from taichi_rts.solver.motion.motion import Motion
from taichi_rts.solver.motion.outlet import Outlets
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.physics.density import Density
from taichi_rts.solver.solver import Solver
from taichi_rts.solver.sound.rule import SoundRule
from taichi_rts.solver.stepping.base import Schedule, Stepper
from taichi_rts.solver.stepping.timeline import Timeline


def _part(name: str) -> Any:
    def part(run: Run) -> Any:
        return getattr(run.solver, name)

    part.__doc__ = f"The `{name}` of the run's solver."
    return property(part)


class Parts:
    """A solver's parts, as its own; they can be named also once another `init` has ended the run."""

    solver: Solver
    particles: FluidState = _part("particles")
    near: Neighbourhood = _part("near")
    grid: BlockGrid = _part("grid")
    walls: list[Any] = _part("walls")
    medium: Medium = _part("medium")
    density: Density = _part("density")
    motion: Motion = _part("motion")
    timeline: Timeline = _part("timeline")
    schedule: Schedule = _part("schedule")
    inflows: Inflows | None = _part("inflows")
    outlets: Outlets | None = _part("outlets")
    sound: SoundRule | None = _part("sound")


@guarded("time", "count", "removed_count")
class Run(Parts):
    """The base of `Simulation`: scene, stepper and solver, the time and the work done.

    Attributes:
        scene: what is simulated, with "auto" decided.
        local: the same with its coordinates counted from `origin`, as the device has them.
        start_fluids, start_viscosities: place of the fluid in the scene, and viscosity [m^2/s], (N at the start,).
        gravity_work: energy [J] that changes of gravity have put in.
    """

    scene: Scene
    local: Scene
    stepper: Stepper
    backend: Backend
    start_fluids: np.ndarray
    start_viscosities: np.ndarray
    overhead: Overhead
    tally: Tally
    gravity_work: float
    _time: float

    @property
    def time(self) -> float:
        """Physical time [s], exactly as last asked for."""
        return self._time

    @property
    def count(self) -> int:
        """Number of fluid particles N."""
        return self.particles.count

    @property
    def removed_count(self) -> int:
        """Number of particles that outlets have taken out so far."""
        return sum(self.outlets.removed) if self.outlets else 0

    @property
    def base_step(self) -> float:
        """The base step dt_b [s]; levels step at whole multiples of it."""
        return self.timeline.tick * self.schedule.base_ticks

    @property
    def origin(self) -> tuple[float, ...]:
        """Point [m], (dim,), from which the run counts its positions: 0 unless the domain lies far from it (`placing`)."""
        return origin_of(self.scene)

    @property
    def statistics(self) -> dict[str, Any]:
        """Work so far: base_steps, particle_updates, wall_seconds, active_fraction, level_fractions and more.

        `overhead_fraction` is the share of a full step that is spent for all particles (grid, regions, prediction),
        measured on a sample of the steps. `stopped_by_domain` and `stopped_by_obstacles` count centres that a face of the
        domain or an obstacle had to stop, `removed_by_outlets` particles that each outlet has taken out, `runaways` speeds
        and accelerations that had to be limited because the run has blown up. Where the grid follows the particles,
        `grid_changes` counts how often it changed, and of `blocks_at_most` it keeps `blocks_kept` now.
        """
        said = {
            **self.tally.statistics(),
            "overhead_fraction": self.overhead.fraction,
            "stopped_by_domain": int(self.motion.stopped),
            "stopped_by_obstacles": int(self.motion.stopped_by_obstacles),
        }
        for extra in self.solver.extras:
            said |= extra.statistics()
        return said | {"runaways": int(self.motion.runaways), **self.schedule.statistics()}

    def __repr__(self) -> str:
        stepper = type(self.stepper).__name__
        return f"{type(self).__name__}({self.scene.name!r}, {stepper}, {self.count} particles, t = {self._time:g} s)"

    def __rich_repr__(self) -> Iterator[Any]:
        yield self.scene.name
        yield "stepper", type(self.stepper).__name__
        yield "particles", self.count
        yield "time", self._time
