"""Read this first: one run, wired from its parts. `Simulation.step` is Algorithm 1 of Goswami & Batty 2014."""

from __future__ import annotations

import contextlib
import time as clock
import weakref
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from taichi_rts.assembly import budget
from taichi_rts.assembly.build import assemble
from taichi_rts.assembly.frame_times import frame_times
from taichi_rts.assembly.obstacle_forces import ForceMeter, ObstacleForces
from taichi_rts.assembly.resources import require
from taichi_rts.assembly.snapshot import Snapshot
from taichi_rts.assembly.work import Overhead, Tally
from taichi_rts.device import backend as backends
from taichi_rts.device.backend import ti
from taichi_rts.device.ownership import guarded
from taichi_rts.errors import Error, Interrupted, SimulationDivergedError, TimeError
from taichi_rts.readings.diagnosis import diagnose
from taichi_rts.readings.readers import Readers
from taichi_rts.readings.reading import Moment, Reading
from taichi_rts.rendering.painter import Painter, PictureChoices, picture_options
from taichi_rts.sampling.sampling import sample
from taichi_rts.scene.placing import at_origin, origin_of
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.physics.own_forces import own_forces
from taichi_rts.solver.stepping.base import Stepper
from taichi_rts.solver.stepping.steppers import as_stepper

if TYPE_CHECKING:
    from typing_extensions import Unpack  # in `typing` from Python 3.11 on

OnFrame = Callable[["Simulation"], object]


def _part(name: str) -> Any:
    def part(sim: Any) -> Any:
        return getattr(sim.solver, name)

    part.__doc__ = f"The `{name}` of the run's solver."
    return property(part)


PARTS = (
    *("particles", "near", "grid", "walls", "medium", "density"),
    *("motion", "timeline", "schedule", "inflows", "outlets", "sound"),
)
"""Parts of the solver that `Simulation` shows as its own; they can be named also once another `init` has ended it."""


@guarded("time", "count", "removed_count", "keeps_work", "keeps_momentum_budget", *PARTS)
class Simulation(Readers):
    """A scene, a stepper, and the state in between.

    Call `taichi_rts.init` first, in the same thread; it may run in any. Another `init` ends it: what is then asked of it raises
    `BackendError`. Building one compiles its kernels and evaluates the first forces. `stepper` may be a stepper's name: it then
    has its defaults. With `debug` the stepper checks at every step what is true by construction, and raises `AssertionError`
    where it is not; and the walls' impulse is added up. `forces` are a user's own: body forces and pair forces
    (docs/extending.md); `energy` knows no potential of theirs.

    Attributes:
        scene: what is simulated, with "auto" decided.
        forces: a user's own.
        local: the same with its coordinates counted from `origin`, as the device has them.
    """

    transient = frozenset({"_fluids", "taichi_start", "_latest"})
    _latest: weakref.ref[Reading] | None = None

    def __init__(
        self,
        scene: Scene,
        stepper: Stepper | str | None = None,
        *,
        forces: Sequence[Any] = (),
        debug: bool = False,
        started: bool = True,
    ) -> None:
        self.backend = backends.current()
        self.taichi_start = backends.start_for_fields()
        self.stepper = as_stepper(stepper)
        own = own_forces(forces, origin_of(scene))
        self.forces = tuple(forces)
        self.scene = scene.with_sound_for(self.stepper)
        require(self.scene, [self.stepper], self.backend, debug=debug)
        self.local = at_origin(self.scene)
        sampled = sample(self.local)
        self.solver = assemble(self.local, self.stepper, sampled, self.backend, own, debug=debug)
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
                present = self.read()
                before = present.potential_energy(float(np.nextafter(change.time, 0.0)))
                self._gravity_work += present.potential_energy(change.time) - before
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
                present = self.read()  # held until all have looked at it
                _require_whole(present)
                for look in looks:
                    look(self)
        return self

    def check(self) -> None:
        """Raise `SimulationDivergedError` with a diagnosis if the run has blown up, as a recording does at every frame.

        That is: a state is not finite, speeds or accelerations had to be limited, or a density is not between 0.02 and 2 of
        rest. It reads the state, so it is for once in a while; `advance_to` itself notices only what is not finite.
        """
        _require_whole(self.read())

    def show(self, **options: Unpack[PictureChoices]) -> Image.Image:
        """Return a picture of the present state, which a notebook shows; `options` are those of `PictureOptions`.

        Raises `RenderError` for an option or a value that there is not.
        """
        return Image.fromarray(Painter(self.scene, picture_options(**options)).paint(self))

    def __repr__(self) -> str:
        stepper = type(self.stepper).__name__
        return f"Simulation({self.scene.name!r}, {stepper}, {self.count} particles, t = {self._time:g} s)"

    def __rich_repr__(self) -> Iterator[Any]:
        yield self.scene.name
        yield "stepper", type(self.stepper).__name__
        yield "particles", self.count
        yield "time", self._time

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

    def read(self) -> Reading:
        """Return the present state: one object for all that ask at one time, as long as any of them holds it."""
        found = self._latest() if self._latest else None
        if found is None or found.moment != Moment.of(self):
            found = Reading.of(self, self._fluids, self._tally.particle_updates)
            self._latest = weakref.ref(found)
        return found

    def restored(self) -> None:
        """Take note that fields and values have been put back to what they were at another time."""
        self.grid.restored()
        self._latest = None

    def snapshot(self) -> Snapshot:
        """Return what any stepper needs to go on from the present time (`continue_from`)."""
        now = self.read()
        state = now.local_positions, now.velocities, now.densities
        return Snapshot.of(self, state, now.ids, self._gravity_work)

    def continue_from(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot of a run of the same scene, taken at a tick of this clock; statistics and budgets begin anew."""
        snapshot.put_into(self)
        self._time, self._gravity_work, self._latest = snapshot.time, snapshot.gravity_work, None
        self.solver.sorts = 0
        self._tally = Tally(self.schedule.levels, base_steps=self.schedule.steps)
        self.start()

    @property
    def statistics(self) -> dict[str, Any]:
        """Work so far: base_steps, particle_updates, wall_seconds, active_fraction, level_fractions and more.

        `overhead_fraction` is the share of a full step that is spent for all particles (grid, regions, prediction),
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

    @property
    def keeps_work(self) -> bool:
        """Whether `work` is known."""
        return budget.keeps_work(self)

    def work(self) -> float:
        """Energy [J] that changes of gravity, moving walls, moving obstacles and inflows have put in until `time`.

        Moving things and inflows need a debug run, else raises `Error` (`budget.work`).
        """
        return budget.work(self, self._gravity_work)

    def sound_work(self) -> float:
        """Energy [J] that changes of the regional sound speed have put in (`budget.sound_work`); raises `Error` as `work`."""
        return budget.sound_work(self)

    @property
    def keeps_momentum_budget(self) -> bool:
        """Whether `momentum_drift` can say anything."""
        return budget.keeps_momentum_budget(self)

    def momentum_drift(self) -> np.ndarray:
        """Momentum [kg m/s], (dim,), that no outer force accounts for; raises `Error` as `budget.momentum_drift`."""
        return budget.momentum_drift(self, self.momentum() - self._initial_momentum)

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


def _require_whole(state: Reading) -> None:
    if (found := diagnose(state)) is not None:
        raise SimulationDivergedError(f"blown up: {found}")
