"""Runs a simulation and records it: frames at exact physical times, a video, and `run.json`."""

from __future__ import annotations

import contextlib
import dataclasses
import heapq
import itertools
import math
import platform
import warnings
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from taichi_rts.assembly.frame_times import frame_times
from taichi_rts.assembly.resources import require
from taichi_rts.device import backend, forks
from taichi_rts.errors import CheckpointError, Interrupted, OutputError, SimulationDivergedError
from taichi_rts.files.film import Gif, Video, require_video
from taichi_rts.files.lock import FolderLock
from taichi_rts.files.writing import prepare_folder, read_png, require_free, write_json, write_png
from taichi_rts.medium.energy import Energy
from taichi_rts.output.blow_up import BlowUpGuard
from taichi_rts.output.checkpoint import Checkpoint, write
from taichi_rts.output.export import DEFAULT_ATTRIBUTES, Exporter
from taichi_rts.output.panels import Panel
from taichi_rts.output.resume import checkpoint_name, newest, output_folder
from taichi_rts.output.series import Series
from taichi_rts.output.turning import UpAxis, rotation_to
from taichi_rts.readings.reading import Reading
from taichi_rts.rendering import legend
from taichi_rts.rendering.painter import Painter, PictureOptions, make_renderer
from taichi_rts.sampling.filling import filling
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation
from taichi_rts.solver.stepping.steppers import stepper_data

MOST_CHECKPOINTS = 100_000
PIXEL_BYTES = 90  # that a renderer with four samples a pixel takes, and its picture


@dataclasses.dataclass(frozen=True)
class Recording:
    """Where a run is recorded to, what of it, and how often; `fps` is frames per physical second.

    Every `checkpoint_every` physical seconds [s], and at the end, it writes a checkpoint; `command` is what checkpoints say of
    the command that made the run.
    """

    folder: Path
    fps: float = 60.0
    video: bool = False
    overwrite: bool = False
    pictures: bool = True
    gif: bool = False
    export: tuple[str, ...] = ()
    attributes: tuple[str, ...] = DEFAULT_ATTRIBUTES
    up: UpAxis | None = None
    checkpoint_every: float | None = None
    command: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.checkpoint_every is not None and not 0.0 < self.checkpoint_every < math.inf:
            raise OutputError(
                f"--checkpoint-every {self.checkpoint_every:g} is no time above 0; give physical seconds, e.g. 0.1"
            )

    def exporter(self, dim: int) -> Exporter:
        """Return what writes particles in `dim` dimensions; raises `OutputError` for what contradicts itself or is missing."""
        if (self.video or self.gif) and not self.pictures:
            raise OutputError("--no-frames draws no pictures, of which --video and --gif are made; leave out one")
        if self.attributes != DEFAULT_ATTRIBUTES and not self.export:
            raise OutputError("--attributes chooses what --export writes, and nothing is exported; give --export too")
        if self.up is not None and not self.export:
            raise OutputError(f"--up {self.up} turns what --export writes, and nothing is exported; give --export too")
        if self.video:
            require_video()
        return Exporter(self.folder, self.export, self.attributes, dim=dim, up=self.up)


class Recorder:
    """Records one or more simulations of one scene, each shown in one or more panels, side by side in each frame.

    With a `checkpoint` it goes on from there. While it is open (`with`), it has its folder for itself.
    """

    def __init__(
        self,
        scene: Scene,
        panels: list[Panel],
        options: PictureOptions,
        recording: Recording,
        *,
        debug: bool = False,
        checkpoint: Checkpoint | None = None,
    ) -> None:
        steppers = dict.fromkeys(panel.stepper for panel in panels)  # one run for all panels that show it
        if recording.export and len(steppers) > 1:
            raise OutputError("--export writes the particles of one run, and there are several; leave out --panels")
        self.exporter = recording.exporter(scene.dim)
        if checkpoint is None:
            require_free(recording.folder, recording.overwrite)  # not even a lock is made in another run's folder
        frame_times(scene.end_time, recording.fps)
        require_checkpoint_times(scene.end_time, recording.checkpoint_every)
        pixels = PIXEL_BYTES * options.width * options.height if recording.pictures else 0
        require(scene, steppers, backend.current(), debug=debug, pictures=pixels)  # before anything is made or removed
        self.scene = scene
        self.panels = panels
        self.recording = recording
        self.frames_done = 0
        self.notes: dict[str, Callable[[], Any]] = {}
        """What else checkpoints keep as plain data, by name."""
        self.lock = FolderLock(recording.folder)
        try:
            prepare_folder(recording.folder, recording.overwrite, checkpoint.archive.path if checkpoint else None)
            if checkpoint is None:
                self.runs = {stepper: Simulation(scene, stepper, debug=debug) for stepper in steppers}
                self.initial_energy = {stepper: sim.energy() for stepper, sim in self.runs.items()}
            else:
                with checkpoint.archive.trusted_by_nobody():
                    self._take_up(checkpoint)
            self.guard = BlowUpGuard(self.runs, recording.folder)
            self.times = frame_times(scene.end_time, recording.fps)[: self.frames_done]
            self.exporter.take_up(self.times)
            self.series = [
                Series(recording.folder / series_name(number), sim, self.times)
                for number, sim in enumerate(self.runs.values())
            ]
            self.painters = self._make_painters(options) if recording.pictures else []
        except BaseException:
            self.lock.release()
            with contextlib.suppress(OSError):  # if there is something in it
                recording.folder.rmdir()
            raise

    def _make_painters(self, options: PictureOptions) -> list[Painter]:
        if len(self.panels) > 1:
            options = dataclasses.replace(options, height=options.height // 2 // 2 * 2)
        renderer = make_renderer(options)
        return [
            Painter(self.scene, dataclasses.replace(options, **panel.options), renderer=renderer)
            for panel in self.panels
        ]

    def _take_up(self, checkpoint: Checkpoint) -> None:
        frames = checkpoint.time * self.recording.fps
        if "frames" in checkpoint.extra:
            # If the run had ended between two frames, the last is that of another time now.
            self.frames_done = min(checkpoint.extra["frames"], math.floor(frames * (1 + 1e-9)) + 1)
        else:  # it was saved by a script
            self.frames_done = math.ceil(frames * (1 - 1e-9))
        scenes = [scene.replace(end_time=self.scene.end_time) for scene in checkpoint.scenes]
        self.runs = {
            stepper: checkpoint.simulation(number, scene)
            for number, (stepper, scene) in enumerate(zip(checkpoint.steppers, scenes, strict=True))
        }
        kept = checkpoint.extra.get("initial_energy")
        energies = [Energy(*each) for each in kept] if kept else [sim.energy() for sim in self.runs.values()]
        self.initial_energy = dict(zip(self.runs, energies, strict=True))
        here = output_folder(checkpoint.archive.path) or Path()
        if here.resolve() == self.recording.folder.resolve():
            missing = [n for n in range(self.frames_done) if not self.frame_path(n).exists()]
            if missing and self.recording.pictures:
                warnings.warn(f"{len(missing)} earlier frames are missing, the first is {missing[0]:06d}", stacklevel=2)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.lock.release()

    def frame_path(self, number: int) -> Path:
        """Return the path of a frame."""
        return self.recording.folder / "frames" / f"{number:06d}.png"

    def paint(self, frame: Mapping[Any, Reading]) -> np.ndarray:
        """Return the picture of all panels, of the states by stepper."""
        images = [
            painter.paint(frame[panel.stepper]) for panel, painter in zip(self.panels, self.painters, strict=True)
        ]
        if len(images) == 1:
            return images[0]
        return legend.vstack_panels(images, [panel.caption for panel in self.panels])

    def record(
        self,
        end_time: float,
        on_frame: Callable[[float], None] = lambda time: None,
        stop_asked: Callable[[], bool] = lambda: False,
    ) -> dict[str, Any]:
        """Run to `end_time` [s], write all frames and checkpoints, and return what `run.json` holds.

        Once `stop_asked()` it writes a checkpoint and raises `Interrupted`. Raises `OutputError` where something cannot be
        written, with what is whole and how to go on, and `SimulationDivergedError` once no run is whole (`BlowUpGuard`).
        """
        for sim in self.runs.values():
            sim.stop_asked = stop_asked
        films = self._begin_films()
        try:
            for time, number in self.moments(end_time):
                for sim in self.runs.values():
                    with contextlib.suppress(SimulationDivergedError):  # which the guard says in full
                        sim.advance_to(max(time, sim.time))
                self._take(time, number, films, on_frame)
            for film in films:
                film.close()
            summary = self.summary()
            self._check_folder()
            write_json(self.recording.folder / "run.json", summary)
        except Interrupted:
            raise Interrupted(f"interrupted; {self.rescue()}") from None
        except OutputError as error:
            raise OutputError(f"{error}; {self.rescue()}") from None
        finally:
            for film in films:
                film.drop()
        return summary

    def _take(self, time: float, number: int | None, films: list[Any], on_frame: Callable[[float], None]) -> None:
        """Write what is due at `time` [s]: frame `number`, or for None a checkpoint."""
        frame = {
            stepper: sim.read() for stepper, sim in self.runs.items()
        }  # all that look at it share it while it is held
        self.guard.look()
        if number is None:
            self.save_checkpoint()
        else:
            self._write_frame(frame, number, films)
            on_frame(time)

    def moments(self, end_time: float) -> Iterator[tuple[float, int | None]]:
        """Yield what is still to be done until `end_time`: times [s] with the number of a frame, None for a checkpoint."""
        times = enumerate(frame_times(end_time, self.recording.fps))
        frames = ((time, number) for number, time in times if number >= self.frames_done)
        present = min(sim.time for sim in self.runs.values())
        saves = (time for time in checkpoint_times(end_time, self.recording.checkpoint_every) if time > present)
        return heapq.merge(frames, ((time, None) for time in saves), key=lambda moment: (moment[0], moment[1] is None))

    def _write_frame(self, frame: Mapping[Any, Reading], number: int, films: list[Any]) -> None:
        image = self.paint(frame) if self.recording.pictures else None
        self._check_folder()
        for state, series in zip(frame.values(), self.series, strict=True):
            self.exporter(state)
            series(state)
        if image is not None:
            write_png(self.frame_path(number), image)
            for film in films:
                film.append(image)
        self.frames_done = number + 1
        self.times.append(min(state.time for state in frame.values()))

    def _check_folder(self) -> None:
        if not self.lock.check():
            warnings.warn(
                f"{self.recording.folder} has gone and was made again; frames before {self.frames_done:06d} and "
                "earlier checkpoints are lost",
                stacklevel=2,
            )

    def _begin_films(self) -> list[Any]:
        """Begin the films, with the frames that are there already."""
        folder, fps = self.recording.folder, self.recording.fps
        films: list[Any] = [Video(folder / "video.mp4", fps)] if self.recording.video else []
        films += [Gif(folder / "video.gif", fps)] if self.recording.gif else []
        for number in range(self.frames_done if films else 0):
            if self.frame_path(number).exists():
                image = read_png(self.frame_path(number))
                for film in films:
                    film.append(image)
        return films

    def save_checkpoint(self) -> Path:
        """Write a checkpoint of all runs, and return its path; raises `OutputError`."""
        sims, folder = list(self.runs.values()), self.recording.folder
        time = max(max(sim.time, sim.timeline.time) for sim in sims)
        extra = {
            "scene": self.scene.to_dict(),
            "frames": self.frames_done,
            "initial_energy": list(self.initial_energy.values()),
            "command": dict(self.recording.command),
            **{name: note() for name, note in self.notes.items()},
        }
        path = folder / "checkpoints" / checkpoint_name(time)
        self._check_folder()
        write(path, sims, extra, temporary=folder / ".checkpoint.part")
        return path

    def rescue(self) -> str:
        """Try to write a checkpoint, and say what there is to go on from."""
        frames = f"{self.frames_done} frames are whole"
        folder = self.recording.folder
        try:
            self.save_checkpoint()
        except OutputError as error:
            try:
                last = newest(folder)
            except CheckpointError:
                return f"{frames}; there is no checkpoint, and none can be written now ({error})"
            return f"{frames}, and the checkpoint {last}; to go on: taichi-rts run --resume {folder}"
        time = min(sim.time for sim in self.runs.values())
        return f"{frames}, until t = {time:g} s; to go on: taichi-rts run --resume {folder}"

    def summary(self) -> dict[str, Any]:
        """Describe the run: the first simulation in full, the others under `panels`, and what was written under `files`."""
        runs = [describe_run(sim, self.initial_energy[stepper]) for stepper, sim in self.runs.items()]
        return runs[0] | ({"panels": runs} if len(runs) > 1 else {}) | {"files": self.files()}

    def files(self) -> dict[str, Any]:
        """Say what is in the folder: paths by kind, where NNNNNN is a frame's number, and the frames' times [s]."""
        wanted = self.recording
        found: dict[str, Any] = {"frames": "frames/NNNNNN.png"} if wanted.pictures else {}
        found |= {name: path for name, path in (("video", "video.mp4"), ("gif", "video.gif")) if getattr(wanted, name)}
        series = [each.path.name for each in self.series]
        if wanted.up is not None:  # position in the files = rotation @ position in the scene
            found |= {"up": {"axis": wanted.up, "rotation": rotation_to(self.scene.up, wanted.up).tolist()}}
        return {**found, **self.exporter.files, "series": series, "times": self.times}


def series_name(number: int) -> str:
    """Name of the time series of run `number`, counted from 0."""
    return "series.csv" if number == 0 else f"series_{number + 1}.csv"


def checkpoint_times(end_time: float, every: float | None) -> Iterator[float]:
    """Times [s] of checkpoints: each multiple of `every`, and the end; none if that is None."""
    if every is None:
        return
    for number in itertools.count(1):
        time = number * every
        if time >= end_time * (1 - 1e-9):
            break
        yield time
    yield end_time


def require_checkpoint_times(end_time: float, every: float | None) -> None:
    """Raise `OutputError` if there would be more than `MOST_CHECKPOINTS`."""
    if every is not None and end_time / every > MOST_CHECKPOINTS:
        raise OutputError(
            f"--checkpoint-every {every:g} s makes {end_time / every:.3g} checkpoints until {end_time:g} s, more than "
            f"{MOST_CHECKPOINTS}; use at least {end_time / MOST_CHECKPOINTS:.3g}"
        )


def describe_run(sim: Simulation, initial_energy: Any) -> dict[str, Any]:
    """Return plain data about a run; only `wall_seconds` differs between two runs of the same command."""
    energy = sim.energy()
    statistics = {key: value for key, value in sim.statistics.items() if key != "overhead_fraction"}
    return {
        "scene": sim.scene.to_dict(),
        "stepper": stepper_data(sim.stepper),
        "arch": sim.backend.arch,
        "precision": sim.backend.precision,
        "device": platform.processor() or platform.machine(),
        "particles": sim.count,
        "filling": filling(sim.scene).to_dict(),
        "end_time": sim.time,
        "base_step": sim.base_step,
        "sound_speed": sim.medium.sound_speed,
        **statistics,
        "energy": {
            "initial": initial_energy._asdict() | {"total": initial_energy.total},
            "final": energy._asdict() | {"total": energy.total},
            "work": sim.work() if sim.keeps_work else None,
        },
        "version": version("taichi_rts"),
        "versions": forks.versions() | {"numpy": version("numpy"), "python": platform.python_version()},
    }
