"""What the live window does, without a window: a run that keys and sliders steer."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from taichi_rts.errors import CheckpointError, Error
from taichi_rts.files.archive import open_archive
from taichi_rts.output.change_stepper import hand_over
from taichi_rts.output.checkpoint import Checkpoint, differences, save_checkpoint
from taichi_rts.output.resume import checkpoint_name
from taichi_rts.readings.levels import level_classes, milliseconds
from taichi_rts.rendering import colours
from taichi_rts.rendering.obstacles import ObstaclePoints
from taichi_rts.rendering.painter import PictureOptions, make_cameras
from taichi_rts.rendering.tints import ColourBar, Entry, Tints
from taichi_rts.scene.parts.conditions import AXES
from taichi_rts.scene.placing import at_origin
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation
from taichi_rts.solver.stepping.steppers import STEPPERS
from taichi_rts.terminal import rate
from taichi_rts.window.film import Film

STEPS_PER_FRAME = 4  # base steps between two pictures, or as many as the longest step has
HISTORY = 96  # frames that the plot of level shares shows
CLIP_STEP = 0.05  # of the domain's length, by which one key press moves the clip plane


@dataclasses.dataclass(frozen=True)
class Settings:
    """The sliders' values: they take effect when `LiveSession.apply` is called, because kernels are compiled then."""

    stepper: str
    levels: int
    courant: float
    viscosity: float


class Spheres(NamedTuple):
    """What is drawn: positions [m], (M, dim), their colours, (M, 3), and the radius of all [m]."""

    positions: np.ndarray
    colours: np.ndarray
    radius: float


class LiveSession:
    """A simulation of `scene` that keys steer. Files go to FOLDER/window. Errors become `message`; the run goes on.

    Attributes:
        sim: the present simulation. Each stepper and setting that was ever chosen keeps its own, compiled and allocated.
        message: what there is to say about the last key.
        history: shares of the classes of levels at the last frames.
    """

    def __init__(self, scene: Scene, stepper: Any, options: PictureOptions, folder: Path) -> None:
        self.scene = scene
        self.folder = folder / "window"
        self.stepper = stepper
        make_cameras(scene, options)  # which refuses what the scene does not have
        self.options = options
        local = at_origin(scene)
        self.tints = Tints(local)
        self.obstacles = ObstaclePoints(local, 0.5 * scene.spacing)
        self.paused = self.helps = self.over = False
        self.clip_axis, self.clip_share = -1, 0.5
        self.scale = 1.0
        self.message = "h lists the keys"
        self.history: deque[np.ndarray] = deque(maxlen=HISTORY)
        self.film: Film | None = None
        self._asked: Callable[[], object] | None = None  # what takes long, and
        self._due: Callable[[], object] | None = None  # the same a frame later, when the message has been seen
        self.last_state: Path | None = None
        self._runs: dict[Any, Simulation] = {}
        self.sim = self._run(stepper, scene.kinematic_viscosity)
        self.start = self.sim.snapshot()
        self.initial_energy = self.sim.energy().total
        self.wanted = self.settings
        self._last_work = self._work()
        self.active, self.rate = 1.0, "-"
        self.note()

    # -- running ----------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Do the steps of one frame, unless paused or at the scene's end."""
        if self._due is not None:
            self._guard(self._due)
            self.wanted = self.settings
        self._due, self._asked = self._asked, None
        if self._due is None and not self.paused and self.sim.time < self.scene.end_time:
            self._steps(max(STEPS_PER_FRAME, self.sim.schedule.levels))
            self.note()

    def _steps(self, number: int) -> None:
        step = self.sim.base_step
        time = (round(self.sim.time / step) + number) * step
        try:
            self.sim.advance_to(min(time, self.scene.end_time))
        except Error as error:
            self.paused, self.message = True, str(error)

    def note(self) -> None:
        """Take down what the plot and the panel show of the present state."""
        self.now = self.sim.read()  # held, so that all that show this frame share it
        self.history.append(np.array([each.share for each in self.classes()]))
        work = self._work()
        updates, seconds, steps = (now - before for now, before in zip(work, self._last_work, strict=True))
        if steps > 0:
            self.active, self.rate = updates / (steps * max(1, self.sim.count)), rate(updates, seconds)
        self._last_work = work

    def _work(self) -> tuple[int, float, int]:
        statistics = self.sim.statistics
        return statistics["particle_updates"], statistics["wall_seconds"], statistics["base_steps"]

    def classes(self) -> list[Any]:
        """Return the classes of levels with their present shares of particles."""
        now = self.sim.read()
        return level_classes(now.level_shares, now.levels_double)

    # -- settings ---------------------------------------------------------------------------------------------------

    @property
    def settings(self) -> Settings:
        """The settings of the present run."""
        stepper: Any = self.sim.stepper
        return Settings(
            stepper.name, self.sim.schedule.levels, stepper.longest_courant, self.sim.scene.kinematic_viscosity
        )

    @property
    def thickest(self) -> float:
        """Largest viscosity [m^2/s] that the slider offers: a third of what shortens the steps."""
        return 0.1 * self.scene.support * self.scene.wave_speed

    def apply(self) -> None:
        """Go on with the settings that the sliders have, from the next frame but one on."""
        stepper, viscosity = self.stepper_for(self.wanted, self.settings), self.wanted.viscosity
        self._ask(lambda: self._switch(stepper, viscosity), f"compiling {stepper.name} steps ...")

    def _ask(self, action: Callable[[], object], message: str) -> None:
        self._asked, self.message = action, message

    def stepper_for(self, wanted: Settings, present: Settings) -> Any:
        """Return the stepper of the `wanted` settings: the run's own where it has that name, with what differs changed."""
        base: Any = self.sim.stepper if wanted.stepper == present.stepper else self._by_name(wanted.stepper)
        changes: dict[str, Any] = {}
        levels = wanted.levels
        if wanted.levels != present.levels and "levels" in vars(base):
            if getattr(base, "steps", None) == "powers_of_two":
                levels = 1 << (levels.bit_length() - 1)
            changes["levels"] = levels
        changed = dataclasses.replace(base, **changes)
        if abs(wanted.courant - present.courant) > 1e-6:
            changed = changed.with_longest(wanted.courant)
            changed = dataclasses.replace(changed, courant=round(changed.courant, 6))
        return changed

    def _by_name(self, name: str) -> Any:
        return self.stepper if self.stepper.name == name else STEPPERS[name]()

    def _switch(self, stepper: Any, viscosity: float) -> None:
        """Go on from the present state with another stepper or viscosity."""
        other = self._run(stepper, viscosity)
        if other is not self.sim:
            hand_over(self.sim, other)
            self._change_to(other)

    def _run(self, stepper: Any, viscosity: float) -> Simulation:
        """Return the simulation with these, built if there is none yet; its state is whatever it was last."""
        key = (stepper, viscosity)
        if key not in self._runs:
            self._runs[key] = Simulation(self.scene.replace(kinematic_viscosity=viscosity), stepper)
        return self._runs[key]

    def _change_to(self, sim: Simulation) -> None:
        self.sim = sim
        self.history.clear()
        self.wanted = self.settings
        self._last_work = self._work()
        self.note()
        self.message = f"{sim.stepper.name} steps from t = {sim.time:.4g} s"

    def _guard(self, action: Callable[[], object]) -> None:
        """Do it, and say what is wrong where it cannot be done."""
        try:
            action()
        except Error as error:
            self.message = str(error)

    # -- keys -------------------------------------------------------------------------------------------------------

    def press(self, key: str) -> None:
        """Do what the key says, by its name in `KEYS`; others do nothing."""
        if key in self.KEYS:
            self.message = ""
            action = self.KEYS[key]
            self._guard(lambda: action(self))

    def pause(self) -> None:
        """Pause, or go on."""
        self.paused = not self.paused

    def single_step(self) -> None:
        """Do one base step, and pause."""
        self.paused = True
        if self.sim.time >= self.scene.end_time:
            self.message = "this is the scene's end; r starts again"
            return
        self._steps(1)
        self.note()

    def reset(self) -> None:
        """Go back to the scene's start, with the present stepper."""
        self.sim.continue_from(self.start)
        self._change_to(self.sim)

    def next_colour(self) -> None:
        """Colour by the next of the modes."""
        place = colours.MODES.index(self.mode)
        self._paint(colour_by=colours.MODES[(place + 1) % len(colours.MODES)])
        self.message = f"colour shows {self.mode}"

    def next_palette(self) -> None:
        """Take the other colours of levels."""
        names = list(colours.PALETTES)
        self._paint(palette=names[(names.index(self.options.palette) + 1) % len(names)])

    def _paint(self, **changes: Any) -> None:
        self.options = dataclasses.replace(self.options, **changes)

    @property
    def mode(self) -> str:
        """What colours show."""
        return self.options.colour_by

    def next_clip(self) -> None:
        """Cut the picture open across the next axis, or not at all."""
        self.clip_axis = self.clip_axis + 1 if self.clip_axis + 1 < self.scene.dim else -1
        self.message = (
            f"clip plane across {AXES[self.clip_axis]}; [ and ] move it" if self.clip_axis >= 0 else "no clip plane"
        )

    def move_clip(self, share: float) -> None:
        """Move the clip plane by a share of the domain's length."""
        self.clip_share = min(1.0, max(0.0, self.clip_share + share))

    def choose_stepper(self, name: str) -> None:
        """Go on with another stepper and the present viscosity, from the next frame but one on."""
        if name != self.sim.stepper.name:
            stepper, viscosity = self._by_name(name), self.sim.scene.kinematic_viscosity
            self._ask(lambda: self._switch(stepper, viscosity), f"compiling {name} steps ...")

    def save(self) -> None:
        """Save the state as a checkpoint, which `taichi-rts run --resume` takes too."""
        path = self.folder / "states" / checkpoint_name(self.sim.time)
        save_checkpoint(self.sim, path)
        self.last_state, self.message = path, f"saved {path}"

    def load(self) -> None:
        """Go on from the state saved last, in this window or an earlier one."""
        found = sorted((self.folder / "states").glob("*.npz"), key=lambda path: path.stat().st_mtime)
        path = self.last_state if self.last_state in found else (found[-1] if found else None)
        if path is None:
            raise CheckpointError(f"{self.folder / 'states'} holds no saved state; s saves one")
        with open_archive(path) as archive:
            checkpoint = Checkpoint(archive)
            viscosity = checkpoint.scenes[0].kinematic_viscosity
            here = self.scene.replace(kinematic_viscosity=viscosity).with_sound_for(checkpoint.steppers[0])
            if found_differences := differences(checkpoint.scenes[0].to_dict(), here.to_dict()):
                raise CheckpointError(f"{path} is of another scene: {found_differences}")
            sim = self._run(checkpoint.steppers[0], viscosity)
            checkpoint.restore(sim)
        self._change_to(sim)
        self.message = f"loaded {path}"

    def record(self) -> None:
        """Begin a recording, or end it."""
        if self.film is None:
            self.film = Film.begin(self.folder, self.options.width, self.options.height)
            self.message = f"recording into {self.film.folder}"
        else:
            self.message, self.film = self.film.close(), None

    def capture(self, camera: Any, outline: Any, lines: list[str]) -> None:
        """Add the present picture to the recording, if there is one and time has passed since its last."""
        if self.film is not None and self.sim.time != self.film.time:
            film = self.film
            film.time = self.sim.time
            entries = self.entries() if self.mode == "level" else self.fluid_entries()
            self._guard(lambda: film.add(self.view(), camera, outline, entries, self.bar(), lines))

    def help(self) -> None:
        """Show or hide the list of keys."""
        self.helps = not self.helps

    def quit(self) -> None:
        """End."""
        self.over = True

    KEYS: ClassVar[dict[str, Callable[[LiveSession], object]]] = {
        " ": pause,
        ".": single_step,
        "n": single_step,
        "r": reset,
        "c": next_colour,
        "p": next_palette,
        "x": next_clip,
        "[": lambda self: self.move_clip(-CLIP_STEP),
        "]": lambda self: self.move_clip(CLIP_STEP),
        "s": save,
        "l": load,
        "v": record,
        **{
            key: lambda self, name=name: self.choose_stepper(name)
            for number, (name, kind) in enumerate(STEPPERS.items(), 1)
            for key in (str(number), *kind.key)
        },
        "Return": apply,
        "h": help,
        "/": help,
        "?": help,
        "Escape": quit,
    }

    def close(self) -> None:
        """Finish a recording that is under way."""
        if self.film is not None:
            self._guard(self.record)

    # -- what is seen -----------------------------------------------------------------------------------------------

    def view(self) -> Spheres:
        """Return the fluid and the obstacles as they are now, cut open at the clip plane."""
        now, radius = self.sim.read(), 0.5 * self.scene.spacing * self.scale
        tints = self.tints.of(now, self.options.colour_by, self.options.palette)
        x, tints = self.obstacles.add(now.local_positions, tints, now.time)
        if self.clip_axis >= 0:
            box = now.local.domain
            low, high = box.lower[self.clip_axis], box.upper[self.clip_axis]
            kept = x[:, self.clip_axis] <= low + self.clip_share * (high - low)
            x, tints = x[kept], tints[kept]
        return Spheres(x, tints, radius)

    def entries(self) -> list[Entry]:
        """Return text, colour and share of each class of levels, as legends have them."""
        doubling, classes = self.sim.schedule.levels_double, self.classes()
        tints = colours.level_colours([each.first for each in classes], self.options.palette, doubling=doubling)
        return [(f"level {each}", tuple(tint), each.share) for each, tint in zip(classes, tints, strict=True)]

    def fluid_entries(self) -> list[Entry]:
        """Return the same of each fluid, if colours show that."""
        if self.mode != "fluid":
            return []
        return self.tints.entries(self.sim.read(), self.mode, self.options.palette)

    def bar(self) -> ColourBar | None:
        """Return the bar of the colours that are shown, if they have one."""
        return self.tints.bar(self.sim.read(), self.mode, self.options.palette)

    def lines(self) -> list[str]:
        """Return the live numbers."""
        sim, energy = self.sim, self.sim.energy().total
        drift = (energy / self.initial_energy - 1.0) if self.initial_energy else 0.0
        state = "paused" if self.paused else ("end" if sim.time >= self.scene.end_time else "running")
        return [
            f"t = {sim.time:.4f} of {self.scene.end_time:g} s, {state}",
            f"{sim.stepper.name}, dt_b = {milliseconds(sim.base_step)} ms",
            f"active {self.active:.1%}, {self.rate}",
            f"energy {energy:.4g} J ({drift:+.2%})",
            f"{sim.count:,} particles, colour: {self.mode}",
        ]
