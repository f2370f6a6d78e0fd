"""Read this first: one run, wired from its parts. `Simulation.step` is Algorithm 1 of Goswami & Batty 2014."""

from __future__ import annotations

import contextlib
import time as clock
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from PIL import Image

from taichi_rts.assembly.budget import Budget
from taichi_rts.assembly.build import assemble
from taichi_rts.assembly.following import follows
from taichi_rts.assembly.frame_times import frame_times
from taichi_rts.assembly.obstacle_forces import Measured
from taichi_rts.assembly.resources import require
from taichi_rts.assembly.snapshot import Snapshot
from taichi_rts.assembly.work import Overhead, Tally
from taichi_rts.device import backend as backends
from taichi_rts.device.backend import ti
from taichi_rts.device.ownership import guarded
from taichi_rts.errors import Interrupted, SimulationDivergedError, TimeError
from taichi_rts.readings.diagnosis import require_whole
from taichi_rts.readings.gravity_work import MOST_STEPS, next_look, work_between
from taichi_rts.readings.readers import Readers
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


@guarded()
class Simulation(Readers, Budget, Measured):
    """A scene, a stepper, and the state in between; readers, budgets and parts are those of its base classes.

    Call `taichi_rts.init` first, in the same thread; it may run in any. Another `init` ends it: what is then asked of it raises
    `BackendError`. Building one compiles its kernels and evaluates the first forces. `stepper` may be a stepper's name: it then
    has its defaults. With `debug` the stepper checks at every step what is true by construction, and raises `AssertionError`
    where it is not; and the walls' impulse is added up. `forces` are a user's own: body forces and pair forces
    (docs/extending.md); `energy` knows no potential of theirs.

    Attributes:
        forces: a user's own.
        stop_asked: asked after every step; once it is true `advance_to` raises `Interrupted`, and may be called again.
    """

    transient = frozenset({"start_fluids", "taichi_start"})

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
        sampled = sample(self.local, walls=not follows(self.local))
        self.solver = assemble(self.local, self.stepper, sampled, self.backend, own, debug=debug)
        self.start_fluids, self.start_viscosities = sampled.fluids, sampled.viscosities
        self.obstacle_layers = sampled.obstacles
        self.stop_asked: Callable[[], bool] = lambda: False
        self.overhead, self.tally = Overhead(self.particles), Tally(self.schedule.levels)
        self._time = self.gravity_work = 0.0
        self.initial_momentum = self.momentum()
        began = clock.perf_counter()
        # So that the first step puts them in this order.
        self.motion.sort_particles(self.timeline.now, self.timeline.tick)
        if started:
            self.start()
        self.setup_seconds = clock.perf_counter() - began

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
            solver.before_regions(now, tick)
            schedule.select(now, tick)  # lines 5-16
            motion.predict_neighbourhood(schedule.read_at, now, tick)  # lines 25-26, where a due particle reads
        with self.overhead.due:
            solver.before_forces(now, tick)
            solver.density.update(schedule, now, tick)  # lines 18-21
            motion.advance_due(schedule, now, tick)  # lines 22-29
        schedule.observe(now, tick)

    def advance_to(self, time: float) -> None:
        """Run all steps up to physical `time` [s]; readers then predict to exactly that time.

        The sequence of steps does not depend on the times asked for. Raises `TimeError` for a time in the past, or later than
        the scene's `end_time` where fluid flows in that long, for which memory is reserved; and `SimulationDivergedError` when
        the state is no longer finite.
        A run that `stop_asked` interrupts keeps its `time`; the steps that it has done ahead of it are not done again.
        """
        if time < self._time:
            raise TimeError(f"time {time:g} s lies before the present {self._time:g} s; runs only go forward")
        self._require_room(time)
        if self.scene.gravity_changes:
            self._advance_under_changes(time)
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
        self._require_room(until)
        for time in frame_times(until, fps):
            if time > self._time or time == 0.0 == self._time:
                with contextlib.suppress(SimulationDivergedError):  # `check` says more
                    self.advance_to(time)
                present = self.read()  # held until all have looked at it
                require_whole(present)
                for look in looks:
                    look(self)
        return self

    def show(self, **options: Unpack[PictureChoices]) -> Image.Image:
        """Return a picture of the present state, which a notebook shows; `options` are those of `PictureOptions`.

        Raises `RenderError` for an option or a value that there is not.
        """
        return Image.fromarray(Painter(self.scene, picture_options(**options)).paint(self))

    def _require_room(self, time: float) -> None:
        if self.inflows is not None:
            self.inflows.require_room(time, slack=self.base_step * self.schedule.levels)

    def _advance_under_changes(self, time: float) -> None:
        """Run to the last reading before `time` [s] that the work of changes of gravity needs."""
        table, reach = self.scene.gravity_table, MOST_STEPS * self.base_step
        look = self.read() if table.linear else None
        while (at := next_look(table, self._time, time, look, reach)) is not None:
            self._advance(at)
            present = self.read()
            self.gravity_work += work_between(table, look or present, present)
            look = present

    def _advance(self, time: float) -> None:
        target = self.timeline.ticks_until(time)
        backends.settle_threads()
        ti.sync()
        began = clock.perf_counter()
        stopped = False
        while not stopped and self.schedule.begin(self.timeline, target):
            with self.overhead.sampled_step(self.schedule.due_count):
                self.step()
            stopped = self.stop_asked()
        ti.sync()
        self.tally.wall_seconds += clock.perf_counter() - began
        self._collect_counts()
        if stopped:
            raise Interrupted
        self._time = float(time)

    def _collect_counts(self) -> None:
        if steps := self.schedule.steps - self.tally.base_steps:
            self.tally.add(steps, self.particles.count, *self.schedule.take_counts())

    def _check_finite(self) -> None:
        broken = int(self.motion.not_finite)
        if broken:
            raise SimulationDivergedError(
                f"{broken} particle states are no longer finite at t = {self._time:g} s; "
                f"use a smaller courant (now {self.stepper}) or a larger sound_speed (now {self.medium.sound_speed:g} m/s)"
            )

    def snapshot(self) -> Snapshot:
        """Return what any stepper needs to go on from the present time (`continue_from`)."""
        now = self.read()
        state = now.local_positions, now.velocities, now.densities
        return Snapshot.of(self, state, now.ids)

    def continue_from(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot of a run of the same scene, taken at a tick of this clock; statistics and budgets begin anew."""
        snapshot.put_into(self)
        self._time, self.gravity_work, self.solver.sorts = snapshot.time, snapshot.gravity_work, 0
        self._latest = None
        self.tally = Tally(self.schedule.levels, base_steps=self.schedule.steps)
        self.start()
