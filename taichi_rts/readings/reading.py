"""The state of a run at one time, on the host: read once, for all that look at the same frame."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from taichi_rts.assembly.run import Run
from taichi_rts.medium.energy import Energy, measure_energy
from taichi_rts.medium.medium import Medium
from taichi_rts.scene.placing import origin_of, placed
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.stepping.base import Stepper


class Moment(NamedTuple):
    """What tells two states of one run apart, without a look at the device.

    `now` and `tick` [s] are those of the clock, `steps` the base steps begun, `particles` their number. A run that stopped on its
    way has the `time` [s] of its last frame and is some steps ahead of it.
    """

    time: float
    now: int
    tick: float
    steps: int
    particles: int

    @classmethod
    def of(cls, run: Run) -> Moment:
        """Return the present one."""
        return cls(run.time, run.timeline.now, run.timeline.tick, run.schedule.steps, run.particles.count)


class Readable(Protocol):
    """What has a present state: a `Simulation`, or a `Reading` itself."""

    def read(self) -> Reading:
        """Return the present state."""


@dataclasses.dataclass(frozen=True, eq=False)
class Reading:
    """The particles of a run at `time` [s], and what follows from them. It stays what it is when the run goes on.

    Arrays are in order of the stable particle id, with N rows, and cannot be written to; reals have the run's precision. What
    costs something is worked out when first asked for, and kept.

    Attributes:
        moment: when it was read; `time` is that of the state.
        scene, local: what is simulated; `local` counts its coordinates from `origin`.
        medium: the fluid's constants, with the equation of state of this moment.
        stepper: its description.
        geometry: the grid's cells and blocks.
        base_ticks, level_count, levels_double: `Schedule.base_ticks`, `levels`, `levels_double`.
        ids: stable ids, (N,), ascending.
        local_positions, velocities, densities: (N, dim) [m], counted from `origin`, (N, dim) [m/s], (N,) [kg/m^3].
        accelerations: (N, dim) [m/s^2], of each particle's last evaluation.
        base_steps: each particle's step in base steps, (N,): 0 before its first evaluation.
        evaluated: ticks of the last evaluations, (N,).
        sound_speeds: (N,) [m/s], at each particle's last evaluation.
        particle_updates: so far.
        inflow: mass [kg] that has come in so far, None in a scene without inflows; `outflows` those that each outlet has taken.
        runaways, not_finite: values that had to be limited so far, and states that were not finite (`Motion`).
        born: ids given so far; `start_fluids` are the fluids' places in the scene of the first of them, (N at the start,).
    """

    moment: Moment
    scene: Scene
    local: Scene
    medium: Medium
    stepper: Stepper
    geometry: Geometry
    base_ticks: int
    level_count: int
    levels_double: bool
    ids: np.ndarray
    local_positions: np.ndarray
    velocities: np.ndarray
    densities: np.ndarray
    accelerations: np.ndarray
    base_steps: np.ndarray
    evaluated: np.ndarray
    sound_speeds: np.ndarray
    particle_updates: int
    inflow: float | None
    outflows: tuple[float, ...]
    runaways: int
    not_finite: int
    born: int
    start_fluids: np.ndarray

    @classmethod
    def of(cls, run: Run) -> Reading:
        """Read the present state of `run`: one kernel, and with a regional sound speed two fields more."""
        p, moment, medium = run.particles, Moment.of(run), run.medium
        dtype, born = run.backend.numpy_dtype, p.born
        x, v, a = (np.empty((born, run.scene.dim), dtype) for _ in range(3))
        rho, level, updated = np.empty(born, dtype), np.full(born, -1, np.int32), np.empty(born, np.int32)
        ahead = moment.time - run.timeline.time
        run.motion.export(moment.now, moment.tick, ahead, x, v, rho, level, updated, a)
        ids = np.flatnonzero(level >= 0).astype(np.int32)  # an outlet may have taken some out
        if moment.particles < born:
            x, v, rho, a, level, updated = (each[ids] for each in (x, v, rho, a, level, updated))
        state = medium.equation_of_state.on_host()
        sounds = np.full(moment.particles, medium.sound_speed) if state.sound is None else state.sound
        for each in (ids, x, v, rho, a, level, updated, sounds):
            each.setflags(write=False)
        inflows, outlets = run.inflows, run.outlets
        return cls(
            moment=moment,
            scene=run.scene,
            local=run.local,
            medium=dataclasses.replace(medium, equation_of_state=state),
            stepper=run.stepper,
            geometry=run.grid.geometry,
            base_ticks=run.schedule.base_ticks,
            level_count=run.schedule.levels,
            levels_double=run.schedule.levels_double,
            ids=ids,
            local_positions=x,
            velocities=v,
            densities=rho,
            accelerations=a,
            base_steps=level,
            evaluated=updated,
            sound_speeds=sounds,
            particle_updates=run.tally.particle_updates,
            inflow=medium.mass * inflows.entered if inflows else None,
            outflows=tuple(medium.mass * n for n in outlets.removed) if outlets else (),
            runaways=int(run.motion.runaways),
            not_finite=int(run.motion.not_finite),
            born=born,
            start_fluids=run.start_fluids,
        )

    def read(self) -> Reading:
        """Return itself, so that what reads a `Simulation` takes this as well."""
        return self

    # -- the clock --------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Physical time [s]."""
        return self.moment.time

    @property
    def base_step(self) -> float:
        """The base step dt_b [s]."""
        return self.moment.tick * self.base_ticks

    @property
    def longest_step(self) -> float:
        """The longest step [s] that the stepper can take."""
        return self.level_count * self.base_step

    @property
    def longest_lead(self) -> float:
        """Longest time [s] by which a cell can be ahead of the youngest: it begins its last step at most one step ahead."""
        return (2 if self.levels_double else 1) * self.longest_step

    # -- particles --------------------------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Number of particles N."""
        return self.moment.particles

    @property
    def origin(self) -> tuple[float, ...]:
        """Point [m], (dim,), from which `local_positions` count."""
        return origin_of(self.scene)

    @cached_property
    def positions(self) -> np.ndarray:
        """Positions [m], (N, dim), as the scene counts: in double precision unless `origin` is 0."""
        return _held(placed(self.scene, self.local_positions))

    @cached_property
    def speeds(self) -> np.ndarray:
        """Speeds [m/s], (N,)."""
        return _held(np.linalg.norm(self.velocities, axis=1))

    @cached_property
    def pressures(self) -> np.ndarray:
        """Pressures [Pa], (N,), that belong to `densities`."""
        return _held(self.medium.equation_of_state.pressure_numpy(self.densities))

    @cached_property
    def levels(self) -> np.ndarray:
        """Levels n, (N,), at least 1: each particle's step is n base steps."""
        return _held(np.maximum(self.base_steps, 1))

    @cached_property
    def level_shares(self) -> np.ndarray:
        """Share of the particles that each level has, from level 1 on."""
        return np.bincount(self.levels, minlength=self.level_count + 1)[1:] / max(1, self.count)

    @cached_property
    def steps(self) -> np.ndarray:
        """Steps [s], (N,): level times base step (`Uniform(adaptive=True)`: at most)."""
        return _held(self.base_steps * self.base_step)

    @cached_property
    def cell_times(self) -> np.ndarray:
        """Time [s] of each particle's last force evaluation, (N,): asynchronous cells run ahead of `time`."""
        return _held(self.evaluated * self.moment.tick)

    @cached_property
    def leads(self) -> np.ndarray:
        """How far [s] the end of each particle's step lies ahead of the earliest end, (N,)."""
        ends = self.evaluated + self.base_steps * self.base_ticks
        return _held((ends - ends.min(initial=np.iinfo(ends.dtype).max)) * self.moment.tick)

    @cached_property
    def fluids(self) -> np.ndarray:
        """Place of each particle's fluid in the scene, (N,), len(fluids) for what has flowed in."""
        unborn = self.born - len(self.start_fluids)
        return _held(np.pad(self.start_fluids, (0, unborn), constant_values=len(self.scene.fluids))[self.ids])

    # -- sums and extremes ------------------------------------------------------------------------------------------

    @cached_property
    def energy(self) -> Energy:
        """Kinetic, potential and internal energy [J]."""
        return measure_energy(self.local, self.medium, self.local_positions, self.velocities, self.densities, self.time)

    @cached_property
    def momentum(self) -> np.ndarray:
        """Total momentum [kg m/s], (dim,)."""
        return _held(self.medium.mass * self.velocities.astype(np.float64).sum(axis=0))

    @cached_property
    def first_moment(self) -> np.ndarray:
        """First moment of mass [kg m], (dim,), counted from `origin`."""
        return _held(self.medium.mass * self.local_positions.astype(np.float64).sum(axis=0))

    @cached_property
    def max_speed(self) -> float:
        """Largest speed [m/s], 0 without particles."""
        return float(self.speeds.max(initial=0.0))

    @cached_property
    def max_mach(self) -> float:
        """Largest local Mach number |v_i|/c_i, 0 without particles."""
        return float((self.speeds / self.sound_speeds).max(initial=0.0))

    @cached_property
    def density_ratios(self) -> np.ndarray:
        """Densities over rest, (N,)."""
        return _held(self.densities / self.medium.rest_density)


def _held(array: np.ndarray) -> np.ndarray:
    """Return the array, which from now on cannot be written to."""
    array.setflags(write=False)
    return array
