"""The times of a run's frames."""

from __future__ import annotations

import math

from taichi_rts.errors import OutputError

MOST_FRAMES = 1_000_000
"""Their names have six digits."""


def frame_times(end_time: float, fps: float) -> list[float]:
    """Times [s] of the frames: every 1/fps from 0, and `end_time` itself as the last."""
    if not 0.0 < fps <= 1e6:
        raise OutputError(f"export_fps {fps:g} is not above 0 and at most 1e6; 60 is usual")
    if end_time * fps > MOST_FRAMES:
        raise OutputError(
            f"end_time {end_time:g} s with export_fps {fps:g} makes {end_time * fps:.3g} frames, more than {MOST_FRAMES}; "
            f"use an export_fps of at most {MOST_FRAMES / end_time:.3g}, or end earlier"
        )
    count = math.floor(end_time * fps * (1 + 1e-9))
    times = [k / fps for k in range(count + 1)]
    if times[-1] < end_time * (1 - 1e-9):
        times.append(end_time)
    return times
