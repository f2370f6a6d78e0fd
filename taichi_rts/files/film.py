"""Films beside the frames: an mp4 through imageio-ffmpeg (extra `video`), and a gif through Pillow."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from taichi_rts.errors import OutputError

GIF_FPS = 25.0
GIF_WIDTH = 640
"""A gif has at most as many frames a second and pixels across: twice of either, and it is too large for a web page."""
GIF_COLOURS = 128


def require_video() -> None:
    """Raise `OutputError` if the extra is not installed, before any work is done."""
    if importlib.util.find_spec("imageio_ffmpeg") is None:
        raise OutputError("--video needs the package imageio-ffmpeg; run: pip install 'taichi_rts[video]'")


def opaque(image: np.ndarray) -> np.ndarray:
    """Return a frame, (H, W, 3 or 4) uint8, without its alpha channel, laid over white: films have none."""
    if image.shape[2] == 3:
        return image
    alpha = image[..., 3:].astype(np.float32) / 255
    return np.rint(image[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)


class Video:
    """Collects frames, (H, W, 3 or 4) uint8, in a temporary file that `close` renames to `path`."""

    def __init__(self, path: Path, fps: float) -> None:
        require_video()
        self.path = path
        self.temporary = path.with_name(f".{path.stem}.part.mp4")
        import imageio.v2 as imageio  # only here: it imports what talks to the network

        options: dict[str, Any] = {"fps": fps, "codec": "libx264", "quality": 8, "macro_block_size": 2}
        self.writer = imageio.get_writer(self.temporary, format="FFMPEG", mode="I", **options)  # type: ignore[arg-type]

    def append(self, image: np.ndarray) -> None:
        """Add one frame; odd sides are cropped by a pixel, as the codec needs even ones."""
        try:
            self.writer.append_data(opaque(image)[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])
        except (OSError, ValueError) as error:
            reason = str(error).splitlines()[0]
            raise OutputError(
                f"{self.path} cannot be written: {reason}; free some space, or leave out --video"
            ) from None

    def close(self) -> None:
        """Finish the file and give it its name."""
        self.writer.close()
        try:
            self.temporary.replace(self.path)
        except FileNotFoundError:
            warnings.warn(f"{self.path} is lost: {self.temporary} was deleted; the frames are whole", stacklevel=2)

    def drop(self) -> None:
        """Leave it unfinished."""
        with contextlib.suppress(OSError):
            self.writer.close()
        self.temporary.unlink(missing_ok=True)


class Gif:
    """The same as a gif that repeats for ever, at the same speed with every n-th frame, smaller and with fewer colours."""

    def __init__(self, path: Path, fps: float) -> None:
        self.path = path
        self.every = max(1, math.ceil(fps / GIF_FPS))
        self.duration = 1e3 * self.every / fps
        """Time [ms] for which a frame is shown; the file holds it to 10 ms."""
        self.seen = 0
        self.frames: list[Image.Image] = []

    def append(self, image: np.ndarray) -> None:
        """Add one frame, if it is its turn."""
        if self.seen % self.every == 0:
            picture = Image.fromarray(opaque(image))
            if picture.width > GIF_WIDTH:
                picture = picture.resize((GIF_WIDTH, round(picture.height * GIF_WIDTH / picture.width)))
            self.frames.append(picture.quantize(GIF_COLOURS, dither=Image.Dither.NONE))
        self.seen += 1

    def close(self) -> None:
        """Write the file to a temporary name, then give it its own."""
        temporary = self.path.with_name(f".{self.path.stem}.part.gif")
        first, *rest = self.frames
        first.save(temporary, save_all=True, append_images=rest, duration=self.duration, loop=0, optimize=False)
        temporary.replace(self.path)

    def drop(self) -> None:
        """Leave it unfinished."""
        self.frames.clear()
