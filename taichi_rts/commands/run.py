"""`taichi-rts run`: its options, and what they set going."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any, Literal

import tyro

import taichi_rts as rts
from taichi_rts.commands import report
from taichi_rts.commands.interrupts import Interrupts
from taichi_rts.errors import CheckpointError, OutputError
from taichi_rts.output.checkpoint import Checkpoint
from taichi_rts.output.export import DEFAULT_ATTRIBUTES
from taichi_rts.output.panels import DEFAULT_LAYOUT, LAYOUTS, Panel
from taichi_rts.output.resume import (
    command_data,
    continued,
    finished_until,
    has_checkpoints,
    open_checkpoint,
    output_folder,
)
from taichi_rts.output.turning import UpAxis
from taichi_rts.readings.extremes import Extremes
from taichi_rts.rendering.painter import Mode, PictureOptions, ViewName, make_cameras
from taichi_rts.scene.checks.size import warn_of_size
from taichi_rts.solver.stepping.steppers import STEPPERS, StepperName


@dataclasses.dataclass(frozen=True)
class Run:
    """Run a scene and save its frames.

    Writes OUTPUT_DIR/frames/000000.png ... at exact physical times, and OUTPUT_DIR/run.json. Exit codes: 0 done, 2 wrong
    input or nothing to run on, 3 with --strict if the table marks a run red, 130 or 143 interrupted by Ctrl-C or SIGTERM:
    then `--resume OUTPUT_DIR` goes on.
    """

    scene: tyro.conf.Positional[str | None] = None
    """Name of a built-in scene (see `taichi-rts scenes`) or path of a TOML or SPlisHSPlasH file; by default double_dam_break."""
    arch: Literal["auto", "cuda", "vulkan", "cpu"] = "auto"
    """Where kernels run; auto takes the first of cuda, vulkan, cpu that is there. A named one never falls back."""
    precision: Literal["f32", "f64"] | None = None
    """Floating-point precision; by default f32."""
    stepper: StepperName | None = None
    """One step for all, a step for each block, or a time for each block; by default regional."""
    preset: Literal["paper"] | None = None
    """Regional: the paper's setting (courant 0.4, 3 levels, Eq. 1 not enforced beyond level 1)."""
    courant: float | None = None
    """Courant number dt c_s / r of the base step; asynchronous: of the longest step."""
    levels: int | None = None
    """Regional, asynchronous: largest number of base steps in a step."""
    alpha: float | None = None
    """Regional: alpha of Eq. 3."""
    lambda_f: float | None = None
    """Regional, asynchronous, adaptive uniform: factor of the force limit, Eq. 2."""
    strict_cfl: bool | None = None
    """Regional: divide the base step by the number of levels, so that the longest step respects Eq. 1."""
    grading: bool | None = None
    """Regional: let levels of neighbouring blocks differ by at most one."""
    corrector: bool | None = None
    """Regional: Serna's corrector. Without it the method blows up."""
    inactive_density: Literal["stale", "extrapolated"] | None = None
    """Regional, asynchronous: density of particles that are not due."""
    steps: Literal["powers_of_two", "half_octaves", "integers"] | None = None
    """Regional, asynchronous: lengths that steps may have, in base steps; half_octaves (1, 2, 3, 4, 6 ...) only regional."""
    limiter: bool | None = None
    """Regional, asynchronous: bound a block's step by its neighbours' and by its last, and wake neighbours."""
    stagger: int | None = None
    """Asynchronous: seed of random first steps, so that all blocks have different ages."""
    integrator: Literal["serna", "symplectic_euler"] | None = None
    """Uniform: how to integrate."""
    adaptive: bool | None = None
    """Uniform: follow the largest speed and acceleration."""
    spacing: float | None = None
    """Initial particle spacing [m]."""
    particles: str | None = None
    """Number of fluid particles instead of a spacing, e.g. 30k or 1.5M."""
    sound_speed: float | Literal["regional", "auto"] | None = None
    """Sound speed [m/s], or regional, or auto; by default ten times the largest speed the scene suggests."""
    end_time: float | None = None
    """Physical time to run to [s]; by default the scene's own."""
    export_fps: float = 60.0
    """Frames per second of physical time."""
    output_dir: Path | None = None
    """Folder for the results; by default out/SCENE."""
    overwrite: bool = False
    """Replace an earlier run's frames, video and run.json in the output folder."""
    checkpoint_every: float | None = None
    """Write a checkpoint to OUTPUT_DIR/checkpoints every so many physical seconds [s], and at the end (docs/restart.md)."""
    resume: Path | None = None
    """Go on from this checkpoint, or from the newest one of this output folder; scene, stepper and options are its own."""
    renderer: Literal["splatter", "ggui"] = "splatter"
    """splatter needs no Vulkan and no display; ggui is Taichi's own."""
    width: int = 1280
    """Width of a frame [pixels]."""
    height: int = 720
    """Height of a frame [pixels]."""
    colour_by: Mode = "level"
    """What colours show."""
    palette: Literal["default", "paper"] = "default"
    """Colours of levels: safe for colour-blind readers, or the paper's red, green, blue."""
    azimuth: float | None = None
    """Camera angle around the vertical [degrees]."""
    elevation: float | None = None
    """Camera angle above the ground [degrees]."""
    quality: Literal["draft", "good", "best"] = "good"
    """Splatter: draft has no shadows, best four times the samples of good (docs/rendering.md)."""
    transparent: bool = False
    """Splatter: frames with an alpha channel instead of a white background; shadows stay."""
    views: tuple[ViewName, ...] = ()
    """Views side by side in each frame: any of scene, front, side and top; by default the scene's alone."""
    panels: Literal["figure3", "ablation", "steppers"] | None = None
    """Several panels in a frame: the paper's Figure 3 or 2, or one for each stepper. They have their own steppers."""
    video: bool = False
    """Also write video.mp4 (needs the extra `video`)."""
    gif: bool = False
    """Also write video.gif, of at most 640 pixels across and 25 frames a second."""
    frames: bool = True
    """Write pictures; --no-frames for a run that only writes files."""
    export: tuple[str, ...] = ()
    """Also write particles at each frame, in any of vtu, ply, npz, bgeo, vtkhdf, and the water's surface (docs/files.md)."""
    attributes: tuple[str, ...] = DEFAULT_ATTRIBUTES
    """What files say of each particle: any of id, velocity, density, pressure, level, step, cell_time, sound_speed, fluid."""
    up: UpAxis | None = None
    """Turn what --export writes so that this axis is up, against gravity: z for Blender, y for Houdini."""
    strict: bool = False
    """Exit with 3 if a run has blown up or was not weakly compressible: what the table marks red."""
    debug: bool = False
    """Check at run time what steppers promise (nothing is extrapolated, some particle steps in every pass); adds up momentum."""
    gui: bool = False
    """Watch in a window instead of saving frames (needs Vulkan and a display)."""

    def __call__(self) -> None:
        """Run it."""
        if self.gui and (foreign := [key for key in NOT_IN_WINDOW if getattr(self, key) != getattr(Run, key)]):
            raise OutputError(
                "--gui shows one run from its start, checks nothing and saves only what its keys ask for; "
                f"leave out {flags(foreign)}, or --gui"
            )
        if self.resume is not None:
            self.go_on(self.resume)
            return
        scene = self.load()
        stepper = self.make_stepper()
        panels = self.make_panels(scene.name, stepper)
        if self.gui:
            from taichi_rts.window.live import watch  # only here, because it needs Vulkan and a display

            start = lambda: rts.init(self.arch, self.precision or "f32", restart=True)  # noqa: E731
            watch(scene, stepper, self.picture(), start, self.output_dir)
            return
        self.record(scene, panels)

    def load(self) -> rts.Scene:
        """Load the scene that the options describe."""
        changes = {key: getattr(self, key) for key in ("spacing", "sound_speed", "end_time")}
        changes = {key: value for key, value in changes.items() if value is not None}
        return rts.load_scene(self.scene or DEFAULT_SCENE, particles=self.particles, **changes)

    def picture(self) -> PictureOptions:
        """Return the options of pictures."""
        return PictureOptions(
            **{f.name: getattr(self, f.name) for f in dataclasses.fields(PictureOptions) if hasattr(self, f.name)}
        )

    def record(self, scene: rts.Scene, panels: list[Panel], checkpoint: Checkpoint | None = None) -> None:
        """Run `scene` and save its frames, from the start or from a checkpoint."""
        from taichi_rts.assembly.frame_times import frame_times
        from taichi_rts.output.recorder import Recorder, Recording

        folder = self.output_dir if self.output_dir is not None else Path("out") / scene.name
        recording = Recording(
            folder=folder,
            fps=self.export_fps,
            video=self.video,
            overwrite=self.overwrite,
            pictures=self.frames,
            gif=self.gif,
            export=self.export,
            attributes=self.attributes,
            up=self.up,
            checkpoint_every=self.checkpoint_every,
            command=command_data(self),
        )
        warn_of_size(scene)
        recording.exporter(scene.dim)  # here, so that what is wrong is said before anything starts
        frames = len(frame_times(scene.end_time, self.export_fps))
        check_size(self.width, self.height)
        check_angles(self.azimuth, self.elevation)
        for panel in panels:
            make_cameras(scene, dataclasses.replace(self.picture(), **panel.options))
        with Interrupts() as interrupts:
            device = rts.init(self.arch, self.precision or "f32", restart=True)
            report.announce(scene, len({panel.stepper for panel in panels}), device)
            with Recorder(
                scene, panels, self.picture(), recording, debug=self.debug, checkpoint=checkpoint
            ) as recorder:
                diagnoses, extremes = recorder.guard, Extremes(recorder.runs)
                recorder.notes["extremes"] = extremes.data
                if checkpoint and "extremes" in checkpoint.extra:
                    with checkpoint.archive.trusted_by_nobody():
                        extremes.take(checkpoint.extra["extremes"])
                interrupts.defer()
                with report.progress(recorder.runs, scene.end_time, extremes.look) as on_frame:
                    recorder.record(scene.end_time, on_frame, interrupts.asked)
        for stepper, sim in recorder.runs.items():
            report.print_table(
                sim, recorder.initial_energy[stepper], diagnoses.found.get(stepper), extremes.facts(stepper)
            )
        report.print_folder(folder, frames, recorder.files())
        bad = [
            stepper.name
            for stepper in recorder.runs
            if not extremes.is_weakly_compressible(stepper) or stepper in diagnoses.found
        ]
        if self.strict and bad:
            print(f"taichi-rts: --strict: the table marks {', '.join(bad)} steps red", file=sys.stderr)
            raise SystemExit(3)

    def go_on(self, path: Path) -> None:
        """Go on from a checkpoint; what this command says besides must not contradict it."""
        folder = output_folder(path)
        until = finished_until(folder) if folder is not None else -1.0
        try:
            with open_checkpoint(path) as checkpoint:
                with checkpoint.archive.trusted_by_nobody():
                    run, scene, panels = continued(self, path, checkpoint)
                done = until >= scene.end_time * (1 - 1e-9) and not self.overwrite and self.output_dir in (None, folder)
                if not done:
                    run.record(scene, panels, checkpoint)
        except CheckpointError:
            done = until >= 0.0 and path.is_dir() and not has_checkpoints(path)  # it made none, and needs none
            if not done:
                raise
        if done and folder is not None:
            report.print_finished(folder, until)

    def make_stepper(self) -> Any:
        """Build the stepper from the options that were given; raises `StepperError` if one does not belong to it."""
        name = self.stepper or rts.Regional.name
        kind = STEPPERS[name]
        given = self.stepper_options()
        if foreign := sorted(set(given) - {field.name for field in dataclasses.fields(kind)}):
            raise rts.StepperError(f"{flags(foreign)} does not belong to the {name} stepper; leave it out")
        return kind(**given)

    def make_panels(self, scene: str, stepper: Any) -> list[Panel]:
        """Return the panels of a layout, or one with `stepper`; raises `StepperError` if both were asked for."""
        given = [*(["stepper"] if self.stepper else []), *self.stepper_options()]
        if self.panels and given:
            raise rts.StepperError(f"--panels {self.panels} has steppers of its own; leave out {flags(given)}")
        layout = self.panels or (None if given else DEFAULT_LAYOUT.get(scene))
        return LAYOUTS[layout] if layout else [Panel("", stepper)]

    def stepper_options(self) -> dict[str, Any]:
        """Return the steppers' parameters that were given, in alphabetical order."""
        return {key: getattr(self, key) for key in STEPPER_OPTIONS if getattr(self, key) != getattr(Run, key)}

    def without_stepper(self) -> Run:
        """Return the same run without a choice of stepper and its parameters."""
        return dataclasses.replace(self, **{key: getattr(Run, key) for key in ("stepper", *STEPPER_OPTIONS)})


STEPPER_OPTIONS = sorted(
    {field.name for kind in STEPPERS.values() for field in dataclasses.fields(kind)} & set(vars(Run))
)
"""Options of `Run` that are some stepper's parameters."""
NOT_IN_WINDOW = (
    *("panels", "debug", "strict", "resume", "checkpoint_every", "frames", "video", "gif", "export", "attributes"),
    "up",
    *("views", "quality", "transparent"),
)
"""Options of `Run` that a window refuses. `export_fps` and `overwrite` have no effect there, but demos set the
first."""
DEFAULT_SCENE = "double_dam_break"


def flags(keys: list[str]) -> str:
    """Return options of `Run` as a user writes them; what is on by default is switched off."""
    return ", ".join(f"--{'no-' if getattr(Run, key) is True else ''}{key.replace('_', '-')}" for key in keys)


def check_size(width: int, height: int) -> None:
    """Raise `OutputError` for a picture that cannot be made or looked at."""
    if not (64 <= width <= 8192 and 64 <= height <= 8192):
        raise OutputError(f"picture of {width} x {height} pixels: both sides must be 64 to 8192; try 1280 and 720")


def check_angles(azimuth: float | None, elevation: float | None) -> None:
    """Raise `OutputError` for an impossible view."""
    if azimuth is not None and not -360.0 <= azimuth <= 360.0:
        raise OutputError(f"--azimuth {azimuth:g} is no angle from -360 to 360 degrees; try -35")
    if elevation is not None and not -90.0 <= elevation <= 90.0:
        raise OutputError(f"--elevation {elevation:g} is no angle from -90 to 90 degrees; try 20")
