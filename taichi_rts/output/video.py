"""An mp4 beside the frames, through imageio-ffmpeg (extra `video`)."""

from __future__ import annotations

import contextlib
import importlib.util
import warnings
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np

from taichi_rts.errors import OutputError


def require_video() -> None:
    """Raise `OutputError` if the extra is not installed, before any work is done."""
    if importlib.util.find_spec("imageio_ffmpeg") is None:
        raise OutputError("--video needs the package imageio-ffmpeg; run: pip install 'taichi_rts[video]'")


class Video:
    """Collects frames, (H, W, 3) uint8, in a temporary file that `close` renames to `path`."""

    def __init__(self, path: Path, fps: float) -> None:
        require_video()
        self.path = path
        self.temporary = path.with_name(f".{path.stem}.part.mp4")
        options: dict[str, Any] = {"fps": fps, "codec": "libx264", "quality": 8, "macro_block_size": 2}
        self.writer = imageio.get_writer(self.temporary, format="FFMPEG", mode="I", **options)  # type: ignore[arg-type]

    def append(self, image: np.ndarray) -> None:
        """Add one frame; odd sides are cropped by a pixel, as the codec needs even ones."""
        try:
            self.writer.append_data(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])
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
