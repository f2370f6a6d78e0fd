"""Two runs in one picture: `taichi-rts side-by-side RUN_A RUN_B -o DIR`, from frames that are there already."""

from __future__ import annotations

import csv
import dataclasses
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from PIL import Image

from taichi_rts.errors import OutputError
from taichi_rts.files.film import Gif, Video, require_video
from taichi_rts.files.lock import FolderLock
from taichi_rts.files.writing import prepare_folder, read_png, write_png
from taichi_rts.rendering import legend

SAME_TIME = 1e-6  # share of the time; series.csv has nine digits


@dataclasses.dataclass(frozen=True)
class Frames:
    """The frames of a run, finished or not, that are whole: their paths and times [s]."""

    folder: Path
    paths: list[Path]
    times: list[float]

    @classmethod
    def of(cls, folder: Path) -> Frames:
        """Find the frames in an output folder; raises `OutputError` if there are none."""
        paths = sorted((folder / "frames").glob("[0-9]*.png"))
        try:
            with (folder / "series.csv").open(newline="") as file:
                times = [float(row["time"]) for row in csv.DictReader(file)]
        except (OSError, KeyError, ValueError, TypeError):
            raise OutputError(
                f"{folder} holds no series.csv with the times of its frames; give the output folder of a run"
            ) from None
        numbers = [path for n, path in enumerate(paths) if path.stem == f"{n:06d}"]
        count = min(len(numbers), len(times))  # a run under way writes a frame's row before its picture
        if not count:
            raise OutputError(f"{folder} has no frames; give the output folder of a run without --no-frames")
        return cls(folder, numbers[:count], times[:count])

    def size(self) -> tuple[int, ...]:
        """Return height and width [pixels] of the first frame."""
        with Image.open(self.paths[0]) as picture:
            return picture.size[::-1]


def common_frames(runs: list[Frames]) -> int:
    """Return how many frames all runs have; raises `OutputError` if their times or heights differ."""
    first = runs[0]
    count = min(len(run.paths) for run in runs)
    for run in runs[1:]:
        if run.size()[0] != first.size()[0]:
            raise OutputError(
                f"frames of {first.folder} and {run.folder} are {first.size()[0]} and {run.size()[0]} pixels high; "
                "run both with the same --height"
            )
        for number, (one, other) in enumerate(zip(first.times[:count], run.times[:count], strict=True)):
            if abs(one - other) > SAME_TIME * max(abs(one), abs(other)):
                raise OutputError(
                    f"frame {number} shows t = {one:g} s in {first.folder} and t = {other:g} s in {run.folder}; "
                    "run both with the same --export-fps"
                )
    if any(len(run.paths) > count for run in runs):
        counts = ", ".join(f"{len(run.paths)} in {run.folder}" for run in runs)
        warnings.warn(f"frames: {counts}; the first {count} are shown", stacklevel=2)
    return count


@dataclasses.dataclass(frozen=True)
class SideBySide:
    """Put the frames of two runs side by side, at the same physical times.

    The runs may be finished or under way. Writes OUTPUT_DIR/frames/000000.png ... and films if asked for.
    """

    run_a: tyro.conf.Positional[Path]
    """Output folder of the run to the left."""
    run_b: tyro.conf.Positional[Path]
    """Output folder of the run to the right."""
    output_dir: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the results."""
    captions: tuple[str, str] | None = None
    """What to write above each; by default the folders' names."""
    video: bool = False
    """Also write video.mp4 (needs the extra `video`)."""
    gif: bool = False
    """Also write video.gif."""
    overwrite: bool = False
    """Replace an earlier run's files in the output folder."""

    def __call__(self) -> None:
        """Write the frames."""
        runs = [Frames.of(folder) for folder in (self.run_a, self.run_b)]
        count = common_frames(runs)
        folder = self.output_dir
        for run in runs:
            if run.folder.resolve() in (folder.resolve(), *folder.resolve().parents):
                raise OutputError(f"{folder} lies in the run {run.folder}; choose another --output-dir")
        if self.video:
            require_video()
        lock = FolderLock(folder)
        try:
            prepare_folder(folder, self.overwrite)
            self._write(runs, count)
        finally:
            lock.release()
        print(f"{count} frames in {folder / 'frames'}, t = {runs[0].times[0]:g} to {runs[0].times[count - 1]:g} s")

    def _write(self, runs: list[Frames], count: int) -> None:
        films = self._films(runs[0].times[:count])
        try:
            for number, image in enumerate(self.pictures(runs, count)):
                write_png(self.output_dir / "frames" / f"{number:06d}.png", image)
                for film in films:
                    film.append(image)
            for film in films:
                film.close()
        finally:
            for film in films:
                film.drop()

    def pictures(self, runs: list[Frames], count: int) -> Iterator[np.ndarray]:
        """Yield the pictures, (H, W, 3) uint8, or 4 if a run's frames are transparent."""
        captions = self.captions or [run.folder.resolve().name for run in runs]
        for paths in zip(*(run.paths[:count] for run in runs), strict=True):
            images = [read_png(path) for path in paths]
            if len({image.shape[2] for image in images}) > 1:
                images = [_with_alpha(image) for image in images]
            yield legend.hstack_panels(images, captions)

    def _films(self, times: list[float]) -> list[Any]:
        fps = 1.0 / (times[1] - times[0]) if len(times) > 1 else 1.0
        films: list[Any] = [Video(self.output_dir / "video.mp4", fps)] if self.video else []
        return films + ([Gif(self.output_dir / "video.gif", fps)] if self.gif else [])


def _with_alpha(image: np.ndarray) -> np.ndarray:
    return image if image.shape[2] == 4 else np.pad(image, ((0, 0), (0, 0), (0, 1)), constant_values=255)
