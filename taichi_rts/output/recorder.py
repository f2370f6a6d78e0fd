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
from taichi_rts.output.files import prepare_folder, write_bytes, write_json
from taichi_rts.output.video import Video, require_video
from taichi_rts.panels import Panel
from taichi_rts.rendering import legend
from taichi_rts.rendering.painter import Painter, PictureOptions, make_renderer
from taichi_rts.scene import Scene
from taichi_rts.simulation import Simulation

PNG_COMPRESSION = 3  # of 9: 40 instead of 120 ms a frame for 10 % more bytes


@dataclasses.dataclass(frozen=True)
class Recording:
    """Where a run is recorded to, and how often; `fps` is frames per physical second."""

    folder: Path
    fps: float = 60.0
    video: bool = False
    overwrite: bool = False


class Recorder:
    """Records one or more simulations of one scene, each shown in one or more panels, side by side in each frame."""

    def __init__(
        self, scene: Scene, panels: list[Panel], options: PictureOptions, recording: Recording, *, debug: bool = False
    ) -> None:
        if recording.video:
            require_video()
        prepare_folder(recording.folder, recording.overwrite)
        self.scene = scene
        self.panels = panels
        self.recording = recording
        steppers = dict.fromkeys(panel.stepper for panel in panels)  # one run for all panels that show it
        self.runs = {stepper: Simulation(scene, stepper, debug=debug) for stepper in steppers}
        self.initial_energy = {stepper: sim.energy() for stepper, sim in self.runs.items()}
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
        frames = self.recording.folder / "frames"
        video = Video(self.recording.folder / "video.mp4", self.recording.fps) if self.recording.video else None
        for number, time in enumerate(frame_times(end_time, self.recording.fps)):
            for sim in self.runs.values():
                sim.advance_to(time)
            image = self.paint()
            data = imageio.imwrite("<bytes>", image, extension=".png", compress_level=PNG_COMPRESSION)
            write_bytes(frames / f"{number:06d}.png", data)
            if video:
                video.append(image)
            on_frame(time)
        if video:
            video.close()
        summary = self.summary()
        write_json(self.recording.folder / "run.json", summary)
        return summary

    def summary(self) -> dict[str, Any]:
        """Describe the run: the first simulation in full, the others under `panels`."""
        runs = [describe_run(sim, self.initial_energy[stepper]) for stepper, sim in self.runs.items()]
        return runs[0] | ({"panels": runs} if len(runs) > 1 else {})


def frame_times(end_time: float, fps: float) -> list[float]:
    """Times [s] of the frames: every 1/fps from 0, and `end_time` itself as the last."""
    if not 0.0 < fps <= 1e6:
        raise OutputError(f"export_fps {fps:g} is not above 0 and at most 1e6; 60 is usual")
    count = int(np.floor(end_time * fps * (1 + 1e-9)))
    times = [k / fps for k in range(count + 1)]
    if times[-1] < end_time * (1 - 1e-9):
        times.append(end_time)
    return times


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
