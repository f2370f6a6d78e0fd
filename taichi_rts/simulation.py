"""Read this first: one run, wired from its parts. `Simulation.step` is Algorithm 1 of Goswami & Batty 2014."""

from __future__ import annotations

import contextlib
import time as clock
from collections.abc import Callable, Iterator, Sequence
from typing import Any, cast

import numpy as np
from PIL import Image

from taichi_rts.assembly.build import assemble
from taichi_rts.assembly.frame_times import frame_times
from taichi_rts.assembly.obstacle_forces import ForceMeter, ObstacleForces
from taichi_rts.assembly.resources import require
from taichi_rts.assembly.work import Overhead, Tally
from taichi_rts.device import backend as backends
from taichi_rts.device.backend import ti
from taichi_rts.device.ownership import guarded
from taichi_rts.errors import Error, Interrupted, SimulationDivergedError, TimeError
from taichi_rts.medium.energy import Energy, measure_energy
from taichi_rts.sampling.sampling import sample
from taichi_rts.scene.placing import at_origin, origin_of
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.stepping.base import Stepper
from taichi_rts.solver.stepping.regional import Regional

OnFrame = Callable[["Simulation"], object]


def _part(name: str) -> Any:
    return property(lambda sim: getattr(sim.solver, name))


@guarded("time", "count", "removed_count", "keeps_work", "keeps_momentum_budget")
class Simulation:
    """A scene, a stepper, and the state in between.

    Call `taichi_rts.init` first, in the same thread; it may run in any. Another `init` ends it: what is then asked of it raises
    `BackendError`. Building one compiles its kernels and evaluates the first forces. With `debug` the stepper
    checks at every step what is true by construction, and raises `AssertionError` where it is not; and the walls' impulse is
    added up.

    Attributes:
        scene: what is simulated, with "auto" decided.
        local: the same with its coordinates counted from `origin`, as the device has them.
    """

    transient = frozenset({"_fluids", "taichi_start"})

    def __init__(
        self, scene: Scene, stepper: Stepper | None = None, *, debug: bool = False, started: bool = True
    ) -> None:
        self.backend = backends.current()
        self.taichi_start = backends.start_for_fields()
        self.stepper = stepper if stepper is not None else cast(Stepper, Regional())
        self.scene = scene.with_sound_for(self.stepper)
        require(self.scene, [self.stepper], self.backend, debug=debug)
        self.local = at_origin(self.scene)
        sampled = sample(self.local)
        self.solver = assemble(self.local, self.stepper, sampled, self.backend, debug=debug)
        self._fluids, self._obstacle_layers, self.start_viscosities = (
            sampled.fluids,
            sampled.obstacles,
            sampled.viscosities,
        )
        self._meter: ForceMeter | None = None
        self.overhead = Overhead(self.particles)
        self._tally = Tally(self.schedule.levels)
        self._time = 0.0
        self.stop_asked: Callable[[], bool] = lambda: False
        """Asked after every step; once it is true `advance_to` raises `Interrupted`, and may be called again."""
        self._gravity_work = 0.0
        self._initial_momentum = self.momentum()
        began = clock.perf_counter()
        # So that the first step puts them in this order.
        self.motion.sort_particles(self.timeline.now, self.timeline.tick)
        if started:
            self.start()
        self.setup_seconds = clock.perf_counter() - began

    particles, near, grid, walls = (_part(name) for name in ("particles", "near", "grid", "walls"))
    medium, density, motion, timeline = (_part(name) for name in ("medium", "density", "motion", "timeline"))
    schedule, inflows, outlets, sound = (_part(name) for name in ("schedule", "inflows", "outlets", "sound"))

    def start(self) -> None:
        """Evaluate the first forces (lines 1-2: validity 0, so that all are due).

        A new simulation has done so, unless it was made with `started=False`.
        """
        self.step()
        self.schedule.take_counts()
        self.schedule.begin(self.timeline, self.timeline.now)  # so that `wall_seconds` holds no compilation
        ti.sync()

    def step(self) -> None:
        """Do what is due at the present tick: lines 4-29 of Algorithm 1."""
        solver, schedule, motion = self.solver, self.solver.schedule, self.solver.motion
        now, tick = solver.timeline.now, solver.timeline.tick
        solver.count_in(tick)
        with self.overhead.shared:
            if schedule.needs_sorting:
                solver.sort(now, tick, self._collect_counts)  # line 4
            solver.find_sound(now, tick)
            schedule.select(now, tick)  # lines 5-16
            motion.predict_neighbourhood(schedule.read_at, now, tick)  # lines 25-26, where a due particle reads
        with self.overhead.due:
            solver.observe_walls(now, tick)
            solver.density.update(schedule, now, tick)  # lines 18-21
            motion.advance_due(schedule, now, tick)  # lines 22-29
        schedule.observe(now, tick)

    def advance_to(self, time: float) -> None:
        """Run all steps up to physical `time` [s]; readers then predict to exactly that time.

        The sequence of steps does not depend on the times asked for. Raises `TimeError` for a time in the past and
        `SimulationDivergedError` when the state is no longer finite.
        A run that `stop_asked` interrupts keeps its `time`; the steps that it has done ahead of it are not done again.
        """
        if time < self._time:
            raise TimeError(f"time {time:g} s lies before the present {self._time:g} s; runs only go forward")
        for change in self.scene.gravity_changes:
            if self._time < change.time <= time:  # the potential energy jumps there
                self._advance(change.time)
                self._gravity_work += self._potential(change.time) - self._potential(np.nextafter(change.time, 0.0))
        self._advance(time)
        self._check_finite()

    def run(
        self, until: float, on_frame: OnFrame | Sequence[OnFrame] | None = None, *, fps: float = 60.0
    ) -> Simulation:
        """Run to physical time `until` [s] and call `on_frame`, one or several, with the simulation at each frame; return it.

        Frames are those of a recording with `fps` frames a second: at the start, at all multiples of 1/fps after the present
        time, and at `until`. Raises as `advance_to` does, as `check` at every frame, and `OutputError` for an impossible `fps`.
        """
        looks = [on_frame] if callable(on_frame) else on_frame or []
        for time in frame_times(until, fps):
            if time > self._time or time == 0.0 == self._time:
                with contextlib.suppress(SimulationDivergedError):  # `check` says more
                    self.advance_to(time)
                self.check()
                for look in looks:
                    look(self)
        return self

    def check(self) -> None:
        """Raise `SimulationDivergedError` with a diagnosis if the run has blown up, as a recording does at every frame.

        That is: a state is not finite, speeds or accelerations had to be limited, or a density is not between 0.02 and 2 of
        rest. It reads the state, so it is for once in a while; `advance_to` itself notices only what is not finite.
        """
        from taichi_rts.readings.diagnosis import diagnose  # only here, as it reads simulations

        if (found := diagnose(self)) is not None:
            raise SimulationDivergedError(f"blown up: {found}")

    def show(self, **options: Any) -> Image.Image:
        """Return a picture of the present state, which a notebook shows; `options` are those of `PictureOptions`."""
        from taichi_rts.rendering.painter import Painter, PictureOptions  # only here: nothing else below needs pictures

        return Image.fromarray(Painter(self.scene, PictureOptions(**options)).paint(self))

    def __repr__(self) -> str:
        stepper = type(self.stepper).__name__
        return f"Simulation({self.scene.name!r}, {stepper}, {self.count} particles, t = {self._time:g} s)"

    def __rich_repr__(self) -> Iterator[Any]:
        yield self.scene.name
        yield "stepper", type(self.stepper).__name__
        yield "particles", self.count
        yield "time", self._time

    def _potential(self, time: float) -> float:
        """Potential energy [J] that the present positions have in the gravity of `time` [s]."""
        return measure_energy(self.local, self.medium, *self.local_state()[:3], time).potential

    def _advance(self, time: float) -> None:
        target = self.timeline.ticks_until(time)
        ti.sync()
        began = clock.perf_counter()
        stopped = False
        while not stopped and self.schedule.begin(self.timeline, target):
            with self.overhead.sampled_step(self.schedule.due_count):
                self.step()
            stopped = self.stop_asked()
        ti.sync()
        self._tally.wall_seconds += clock.perf_counter() - began
        self._collect_counts()
        if stopped:
            raise Interrupted
        self._time = float(time)

    def _collect_counts(self) -> None:
        if steps := self.schedule.steps - self._tally.base_steps:
            self._tally.add(steps, self.particles.count, *self.schedule.take_counts())

    def _check_finite(self) -> None:
        broken = int(self.motion.not_finite)
        if broken:
            raise SimulationDivergedError(
                f"{broken} particle states are no longer finite at t = {self._time:g} s; "
                f"use a smaller courant (now {self.stepper}) or a larger sound_speed (now {self.medium.sound_speed:g} m/s)"
            )

    @property
    def time(self) -> float:
        """Physical time [s], exactly as last asked for."""
        return self._time

    @property
    def count(self) -> int:
        """Number of fluid particles N."""
        return self.particles.count

    def ids(self) -> np.ndarray:
        """Stable ids, (N,), of the particles that all readers speak of, ascending; an outlet takes some out for good."""
        return self.particles.ids()

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

    def placed(self, x: np.ndarray) -> np.ndarray:
        """Positions `x` [m], (..., dim), counted from `origin`, as the scene counts: in double precision unless that is 0."""
        if not any(self.origin):
            return x
        return np.clip(x + np.asarray(self.origin), self.scene.domain.lower, self.scene.domain.upper)

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s], (N, dim), densities [kg/m^3] and levels, (N,), at `time`, by particle id.

        Reals have the run's precision, positions in a domain far from 0 double precision.
        """
        x, v, rho, level = self.local_state()
        return self.placed(x), v, rho, level

    def local_state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """As `state`, with positions [m], (N, dim), counted from `origin`: all reals have the run's precision."""
        dtype, born = self.backend.numpy_dtype, self.particles.born
        x, v = np.empty((born, self.scene.dim), dtype), np.empty((born, self.scene.dim), dtype)
        rho, level = np.empty(born, dtype), np.empty(born, np.int32)
        now, tick = self.timeline.now, self.timeline.tick
        self.motion.export(now, tick, self._time - self.timeline.time, x, v, rho, level)
        if self.count == born:
            return x, v, rho, level
        ids = self.ids()
        return x[ids], v[ids], rho[ids], level[ids]

    def positions(self) -> np.ndarray:
        """Positions [m], (N, dim), predicted to `time`, in order of particle id; far from 0 in double precision (`state`)."""
        return self.state()[0]

    def velocities(self) -> np.ndarray:
        """Velocities [m/s], (N, dim), predicted to `time`, in order of particle id."""
        return self.state()[1]

    def densities(self) -> np.ndarray:
        """Densities [kg/m^3], (N,), by particle id: of each particle's last evaluation, with `Asynchronous` at `time`."""
        return self.state()[2]

    def pressures(self) -> np.ndarray:
        """Pressures [Pa], (N,), by particle id, that belong to `densities`."""
        return self.medium.equation_of_state.pressure_numpy(self.densities())

    def sound_speeds(self) -> np.ndarray:
        """Sound speeds [m/s], (N,), at each particle's last evaluation, by particle id."""
        if self.sound is None:
            return np.full(self.count, self.medium.sound_speed)
        return self.particles.to_numpy(self.particles.sound)

    def levels(self) -> np.ndarray:
        """Levels n, (N,): each particle's step is n base steps. In order of particle id."""
        return self.state()[3]

    def fluids(self) -> np.ndarray:
        """Place of each particle's fluid in the scene, (N,), len(fluids) for what has flowed in. In order of particle id."""
        unborn = self.particles.born - len(self._fluids)
        return np.pad(self._fluids, (0, unborn), constant_values=len(self.scene.fluids))[self.ids()]

    def steps(self) -> np.ndarray:
        """Steps [s], (N,): level times base step (`Uniform(adaptive=True)`: at most). In order of particle id."""
        return self.particles.to_numpy(self.particles.level) * self.base_step

    def cell_times(self) -> np.ndarray:
        """Time [s] of each particle's last force evaluation, (N,), by particle id: asynchronous cells run ahead of `time`."""
        return self.particles.to_numpy(self.particles.updated) * self.timeline.tick

    def leads(self) -> np.ndarray:
        """How far [s] the end of each particle's step lies ahead of the earliest end, (N,). In order of particle id."""
        p = self.particles
        ends = p.to_numpy(p.updated) + p.to_numpy(p.level) * self.schedule.base_ticks
        return (ends - ends.min(initial=np.iinfo(ends.dtype).max)) * self.timeline.tick

    @property
    def statistics(self) -> dict[str, Any]:
        """Work so far: base_steps, particle_updates, wall_seconds, active_fraction, level_fractions and more.

        `overhead_fraction` is the share of a step in which all are due that everybody pays (grid, regions, prediction),
        measured on a sample of the steps. `stopped_by_domain` and `stopped_by_obstacles` count centres that a face of the
        domain or an obstacle had to stop, `removed_by_outlets` particles that each outlet has taken out, `runaways` speeds
        and accelerations that had to be limited because the run has blown up.
        """
        return {
            **self._tally.statistics(),
            "overhead_fraction": self.overhead.fraction,
            "stopped_by_domain": int(self.motion.stopped),
            "stopped_by_obstacles": int(self.motion.stopped_by_obstacles),
            **({"removed_by_outlets": list(self.outlets.removed)} if self.outlets else {}),
            "runaways": int(self.motion.runaways),
            **self.schedule.statistics(),
        }

    def energy(self) -> Energy:
        """Kinetic, potential and internal energy [J] at `time`."""
        return measure_energy(self.local, self.medium, *self.local_state()[:3], self._time)

    @property
    def keeps_work(self) -> bool:
        """Whether `work` is known."""
        return self.particles.has_budget or not (self.motion.moving_walls or self.inflows)

    def work(self) -> float:
        """Energy [J] that changes of gravity, moving walls, moving obstacles and inflows have put in until `time`.

        What flows in brings its kinetic and potential energy, what flows out takes its own along. Moving things and inflows
        need a debug run, else raises `Error`.
        """
        total = self._gravity_work
        p = self.particles
        if self.motion.moving_walls or self.inflows:
            if not self.keeps_work:
                raise Error("the work of moving walls, moving obstacles and inflows needs Simulation(..., debug=True)")
            elapsed = self._time - p.to_numpy(p.updated) * self.timeline.tick
            done = p.to_numpy(p.work).astype(float) + elapsed * p.to_numpy(p.power)
            total += self.medium.mass * float(done.sum()) + (self.inflows.energy if self.inflows else 0.0)
        if self.outlets:
            total += self.outlets.work - self.outlets.energy
        return total

    def sound_work(self) -> float:
        """Energy [J] that changes of the regional sound speed and of reference densities have put in; negative if taken out.

        A particle that becomes stiffer under the same pressure holds less energy. Needs a debug run, else raises `Error`.
        """
        if self.sound is None:
            return 0.0
        if not self.particles.has_budget:
            raise Error("the work of changes of the sound speed needs Simulation(..., debug=True)")
        return self.medium.mass * float(self.particles.to_numpy(self.particles.sound_work).astype(float).sum())

    def momentum(self) -> np.ndarray:
        """Total momentum [kg m/s], (dim,), at `time`."""
        return self.medium.mass * self.velocities().astype(np.float64).sum(axis=0)

    def obstacle_forces(self) -> ObstacleForces:
        """Forces [N] and torques [N m] of the fluid on each obstacle, in the scene's order, at the last step up to `time`.

        The first call compiles; asking changes nothing in the run. Raises `Error` for a scene without obstacles.
        """
        if not self.scene.obstacles:
            raise Error(f"scene {self.scene.name!r} has 0 obstacles, so no force acts on one; give it at least 1")
        if self._meter is None:
            self.taichi_start.require_thread()
            self._meter = ForceMeter(self.local, self.motion, self._obstacle_layers, self.walls, self.backend)
        found = self._meter.measure(self.medium.mass, self.timeline.now, self.timeline.tick)
        return found._replace(pivots=found.pivots + np.asarray(self.origin))

    @property
    def keeps_momentum_budget(self) -> bool:
        """Whether `momentum_drift` can say anything."""
        scene = self.scene
        return self.particles.has_budget and not (
            scene.body_force or scene.gravity_changes or scene.inflows or scene.outlets
        )

    def momentum_drift(self) -> np.ndarray:
        """Momentum [kg m/s], (dim,), that no outer force accounts for: the change less gravity's and the walls' share.

        Zero to rounding with uniform steps, where partners push each other equally at the same time. Needs a debug run and a
        scene without body force, changes of gravity, inflows and outlets, else raises `Error`.
        """
        if not self.keeps_momentum_budget:
            raise Error(
                "the momentum budget needs Simulation(..., debug=True), "
                "and a scene without body_force, gravity_changes, inflows and outlets"
            )
        p = self.particles
        elapsed = self._time - p.updated.to_numpy() * self.timeline.tick
        walls = p.wall_push.to_numpy().astype(float) + elapsed[:, None] * p.a_walls.to_numpy()
        if p.has_past and (ahead := elapsed < 0.0).any():  # whose velocity is interpolated between two evaluations
            step = (p.updated.to_numpy() - p.past_updated.to_numpy())[ahead] * self.timeline.tick
            share = (-elapsed[ahead] / step)[:, None]
            now, before = (field.to_numpy()[ahead].astype(float) for field in (p.wall_push, p.past_wall_push))
            walls[ahead] = now + share * (before - now)
        gravity = self.count * self._time * np.asarray(self.scene.acceleration)
        return self.momentum() - self._initial_momentum - self.medium.mass * (walls.sum(axis=0) + gravity)
