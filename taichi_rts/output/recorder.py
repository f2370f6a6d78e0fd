"""Runs a simulation and records it: frames at exact physical times, a video, and `run.json`."""

from __future__ import annotations

import dataclasses
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np

from taichi_rts.errors import OutputError
from taichi_rts.frames import frame_times
from taichi_rts.output.export import DEFAULT_ATTRIBUTES, Exporter
from taichi_rts.output.files import prepare_folder, write_bytes, write_json
from taichi_rts.output.series import Series
from taichi_rts.output.video import Gif, Video, require_video
from taichi_rts.panels import Panel
from taichi_rts.rendering import legend
from taichi_rts.rendering.painter import Painter, PictureOptions, make_renderer
from taichi_rts.scene import Scene
from taichi_rts.simulation import Simulation

PNG_COMPRESSION = 3  # of 9: 40 instead of 120 ms a frame for 10 % more bytes


@dataclasses.dataclass(frozen=True)
class Recording:
    """Where a run is recorded to, what of it, and how often; `fps` is frames per physical second."""

    folder: Path
    fps: float = 60.0
    video: bool = False
    overwrite: bool = False
    pictures: bool = True
    gif: bool = False
    export: tuple[str, ...] = ()
    attributes: tuple[str, ...] = DEFAULT_ATTRIBUTES

    def exporter(self, dim: int) -> Exporter:
        """Return what writes particles in `dim` dimensions; raises `OutputError` for what contradicts itself or is missing."""
        if (self.video or self.gif) and not self.pictures:
            raise OutputError("--no-frames draws no pictures, of which --video and --gif are made; leave out one")
        if self.attributes != DEFAULT_ATTRIBUTES and not self.export:
            raise OutputError("--attributes chooses what --export writes, and nothing is exported; give --export too")
        if self.video:
            require_video()
        return Exporter(self.folder, self.export, self.attributes, dim=dim)


class Recorder:
    """Records one or more simulations of one scene, each shown in one or more panels, side by side in each frame."""

    def __init__(
        self, scene: Scene, panels: list[Panel], options: PictureOptions, recording: Recording, *, debug: bool = False
    ) -> None:
        steppers = dict.fromkeys(panel.stepper for panel in panels)  # one run for all panels that show it
        if recording.export and len(steppers) > 1:
            raise OutputError("--export writes the particles of one run, and there are several; leave out --panels")
        self.exporter = recording.exporter(scene.dim)
        prepare_folder(recording.folder, recording.overwrite)
        self.scene = scene
        self.panels = panels
        self.recording = recording
        self.runs = {stepper: Simulation(scene, stepper, debug=debug) for stepper in steppers}
        self.initial_energy = {stepper: sim.energy() for stepper, sim in self.runs.items()}
        self.series = [
            Series(recording.folder / series_name(number), sim) for number, sim in enumerate(self.runs.values())
        ]
        self.painters: list[Painter] = []
        if recording.pictures:
            if len(panels) > 1:
                options = dataclasses.replace(options, height=options.height // 2 // 2 * 2)
            renderer = make_renderer(options)
            self.painters = [
                Painter(scene, dataclasses.replace(options, **panel.options), renderer=renderer) for panel in panels
            ]

    def paint(self) -> np.ndarray:
        """Return the picture of all panels at the present time."""
        images = [
            painter.paint(self.runs[panel.stepper]) for panel, painter in zip(self.panels, self.painters, strict=True)
        ]
        if len(images) == 1:
            return images[0]
        return legend.vstack_panels(images, [panel.caption for panel in self.panels])

    def record(self, end_time: float, on_frame: Callable[[float], None] = lambda time: None) -> dict[str, Any]:
        """Run to `end_time` [s], write all frames, and return what `run.json` holds."""
        folder, fps = self.recording.folder, self.recording.fps
        films: list[Any] = [Video(folder / "video.mp4", fps)] if self.recording.video else []
        films += [Gif(folder / "video.gif", fps)] if self.recording.gif else []
        for number, time in enumerate(frame_times(end_time, fps)):
            for sim in self.runs.values():
                sim.advance_to(time)
                self.exporter(sim)
            for series in self.series:
                series()
            if self.recording.pictures:
                image = self.paint()
                data = imageio.imwrite("<bytes>", image, extension=".png", compress_level=PNG_COMPRESSION)
                write_bytes(folder / "frames" / f"{number:06d}.png", data)
                for film in films:
                    film.append(image)
            on_frame(time)
        for film in films:
            film.close()
        summary = self.summary()
        write_json(self.recording.folder / "run.json", summary)
        return summary

    def summary(self) -> dict[str, Any]:
        """Describe the run: the first simulation in full, the others under `panels`, and what was written under `files`."""
        runs = [describe_run(sim, self.initial_energy[stepper]) for stepper, sim in self.runs.items()]
        return runs[0] | ({"panels": runs} if len(runs) > 1 else {}) | {"files": self.files()}

    def files(self) -> dict[str, Any]:
        """Say what is in the folder: paths by kind, where NNNNNN is a frame's number, and the frames' times [s]."""
        wanted = self.recording
        found = {"frames": "frames/NNNNNN.png"} if wanted.pictures else {}
        found |= {name: path for name, path in (("video", "video.mp4"), ("gif", "video.gif")) if getattr(wanted, name)}
        series = [each.path.name for each in self.series]
        return {**found, **self.exporter.files, "series": series, "times": self.series[0].times}


def series_name(number: int) -> str:
    """Name of the time series of run `number`, counted from 0."""
    return "series.csv" if number == 0 else f"series_{number + 1}.csv"


def describe_run(sim: Simulation, initial_energy: Any) -> dict[str, Any]:
    """Return plain data about a run; only `wall_seconds` differs between two runs of the same command."""
    energy = sim.energy()
    statistics = {key: value for key, value in sim.statistics.items() if key != "overhead_fraction"}
    return {
        "scene": sim.scene.to_dict(),
        "stepper": {"name": sim.stepper.name, **dataclasses.asdict(sim.stepper)},  # type: ignore[call-overload]
        "arch": sim.backend.arch,
        "precision": sim.backend.precision,
        "device": platform.processor() or platform.machine(),
        "particles": sim.count,
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
        "versions": {name: version(name) for name in ("taichi", "numpy")} | {"python": platform.python_version()},
    }
