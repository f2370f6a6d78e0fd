"""A recording of the live window: numbered pictures, and a film of them where the extra `video` is installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from taichi_rts.errors import OutputError
from taichi_rts.files.film import Video, require_video
from taichi_rts.files.writing import write_png
from taichi_rts.rendering import legend
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.splatter import Splatter
from taichi_rts.rendering.tints import ColourBar, Entry

FPS = 30.0


class Film:
    """Pictures in `folder`, of the software renderer: as the window shows them, without its panel."""

    def __init__(self, folder: Path, width: int, height: int) -> None:
        self.folder = folder
        self.count = 0
        self.time = -1.0
        """Physical time [s] of the last picture."""
        self.renderer = Splatter(width, height)
        self.video: Video | None = None
        self.missing = ""
        try:
            require_video()
            self.video = Video(folder / "video.mp4", FPS)
        except OutputError as error:
            self.missing = f"; no video: {error}"

    @classmethod
    def begin(cls, parent: Path, width: int, height: int) -> Film:
        """Begin in the first folder PARENT/recording-001, -002 ... that is not there; raises `OutputError`."""
        try:
            parent.mkdir(parents=True, exist_ok=True)
            number = 1 + max((int(path.name[10:]) for path in parent.glob("recording-[0-9][0-9][0-9]")), default=0)
            folder = parent / f"recording-{number:03d}"
            folder.mkdir()
        except OSError as error:
            raise OutputError(
                f"{parent} cannot be written: {error.strerror}; free some space or choose another --output-dir"
            ) from None
        return cls(folder, width, height)

    def add(
        self, view: Any, camera: Camera, outline: Any, entries: list[Entry], bar: ColourBar | None, lines: list[str]
    ) -> None:
        """Write the next picture, with the legend of its colours: `entries` or a `bar`; raises `OutputError`."""
        image = self.renderer.draw(view.positions, view.colours, view.radius, camera, outline)
        image = legend.draw_legend(image, "", entries, lines)
        if bar is not None:
            image = legend.draw_colour_bar(image, *bar)
        write_png(self.folder / f"{self.count:06d}.png", image)
        if self.video:
            self.video.append(image)
        self.count += 1

    def close(self) -> str:
        """Finish the film, and say what there is."""
        if self.video and self.count:
            self.video.close()
        elif self.video:
            self.video.drop()
        return f"{self.count} frames in {self.folder}{self.missing}"
