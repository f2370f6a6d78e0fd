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
from taichi_rts.commands.options import FileOptions, SceneOptions, StepperOptions, flags
from taichi_rts.errors import CheckpointError, OutputError
from taichi_rts.output.checkpoint import Checkpoint
from taichi_rts.output.options import given
from taichi_rts.output.panels import DEFAULT_LAYOUT, LAYOUTS, Panel
from taichi_rts.output.resume import (
    command_data,
    continued,
    finished_until,
    has_checkpoints,
    open_checkpoint,
    output_folder,
)
from taichi_rts.readings.extremes import Extremes
from taichi_rts.rendering.painter import PictureOptions, make_cameras
from taichi_rts.scene.checks.size import warn_of_size


@dataclasses.dataclass(frozen=True)
class Run:
    """Run a scene and save its frames.

    Writes OUTPUT_DIR/frames/000000.png ... at exact physical times, and OUTPUT_DIR/run.json. Exit codes: 0 done, 2 wrong
    input or nothing to run on, 3 with --strict if the table marks a run red, 130 or 143 interrupted by Ctrl-C or SIGTERM:
    then `--resume OUTPUT_DIR` goes on.
    """

    scene: tyro.conf.OmitArgPrefixes[SceneOptions] = dataclasses.field(default_factory=SceneOptions)
    stepping: tyro.conf.OmitArgPrefixes[StepperOptions] = dataclasses.field(default_factory=StepperOptions)
    pictures: tyro.conf.OmitArgPrefixes[PictureOptions] = dataclasses.field(default_factory=PictureOptions)
    files: tyro.conf.OmitArgPrefixes[FileOptions] = dataclasses.field(default_factory=FileOptions)
    arch: Literal["auto", "cuda", "vulkan", "cpu"] = "auto"
    """Where kernels run; auto takes the first of cuda, vulkan, cpu that is there. A named one never falls back."""
    precision: Literal["f32", "f64"] | None = None
    """Floating-point precision; by default f32."""
    panels: Literal["figure3", "ablation", "steppers"] | None = None
    """Several panels in a frame: the paper's Figure 3 or 2, or one for each stepper. They have their own steppers."""
    resume: Path | None = None
    """Go on from this checkpoint, or from the newest one of this output folder; scene, stepper and options are its own."""
    strict: bool = False
    """Exit with 3 if a run has blown up or was not weakly compressible: what the table marks red."""
    debug: bool = False
    """Check at run time what steppers promise (nothing is extrapolated, some particle steps in every pass); adds up momentum."""
    gui: bool = False
    """Watch in a window instead of saving frames (needs Vulkan and a display)."""

    def __call__(self) -> None:
        """Run it."""
        if self.gui and (foreign := [name for name in NOT_IN_WINDOW if name in given(self)]):
            raise OutputError(
                "--gui shows one run from its start, checks nothing and saves only what its keys ask for; "
                f"leave out {flags(foreign)}, or --gui"
            )
        if self.resume is not None:
            self.go_on(self.resume)
            return
        scene = self.scene.load()
        stepper = self.stepping.make()
        panels = self.make_panels(scene.name, stepper)
        if self.gui:
            from taichi_rts.window.live import watch  # only here, because it needs Vulkan and a display

            start = lambda: rts.init(self.arch, self.precision or "f32", restart=True)  # noqa: E731
            watch(scene, stepper, self.pictures, start, self.files.output_dir)
            return
        self.record(scene, panels)

    def record(self, scene: rts.Scene, panels: list[Panel], checkpoint: Checkpoint | None = None) -> None:
        """Run `scene` and save its frames, from the start or from a checkpoint."""
        from taichi_rts.assembly.frame_times import frame_times
        from taichi_rts.output.recorder import Recorder, Recording

        files = self.files
        folder = files.output_dir if files.output_dir is not None else Path("out") / scene.name
        recording = Recording(
            folder=folder,
            fps=files.export_fps,
            video=files.video,
            overwrite=files.overwrite,
            pictures=files.frames,
            gif=files.gif,
            export=files.export,
            attributes=files.attributes,
            up=files.up,
            checkpoint_every=files.checkpoint_every,
            command=command_data(self),
        )
        warn_of_size(scene)
        recording.exporter(scene.dim)  # here, so that what is wrong is said before anything starts
        frames = len(frame_times(scene.end_time, files.export_fps))
        check_size(self.pictures.width, self.pictures.height)
        check_angles(self.pictures.azimuth, self.pictures.elevation)
        for panel in panels:
            make_cameras(scene, dataclasses.replace(self.pictures, **panel.options))
        with Interrupts() as interrupts:
            device = rts.init(self.arch, self.precision or "f32", restart=True)
            report.announce(scene, len({panel.stepper for panel in panels}), device)
            with Recorder(scene, panels, self.pictures, recording, debug=self.debug, checkpoint=checkpoint) as recorder:
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
                elsewhere = self.files.output_dir not in (None, folder)
                done = until >= scene.end_time * (1 - 1e-9) and not self.files.overwrite and not elsewhere
                if not done:
                    run.record(scene, panels, checkpoint)
        except CheckpointError:
            done = until >= 0.0 and path.is_dir() and not has_checkpoints(path)  # it made none, and needs none
            if not done:
                raise
        if done and folder is not None:
            report.print_finished(folder, until)

    def make_panels(self, scene: str, stepper: Any) -> list[Panel]:
        """Return the panels of a layout, or one with `stepper`; raises `StepperError` if both were asked for."""
        chosen = [*(["stepper"] if self.stepping.stepper else []), *self.stepping.parameters()]
        if self.panels and chosen:
            raise rts.StepperError(f"--panels {self.panels} has steppers of its own; leave out {flags(chosen)}")
        layout = self.panels or (None if chosen else DEFAULT_LAYOUT.get(scene))
        return LAYOUTS[layout] if layout else [Panel("", stepper)]


NOT_IN_WINDOW = (
    *("panels", "debug", "strict", "resume", "checkpoint_every", "frames", "video", "gif", "export", "attributes"),
    "up",
    *("views", "quality", "transparent"),
)
"""Options of `Run` that a window refuses. `export_fps` and `overwrite` have no effect there, but demos set the
first."""


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
