"""Time as an integer number of ticks, so that "is it due?" is exact and rounding does not pile up."""

from __future__ import annotations

import math
from dataclasses import dataclass

from taichi_rts.errors import TimeError

MAX_TICKS = 2**30 - 2**10
"""Ticks are 32-bit integers on the device, and no step, of 1024 ticks at most, may end at `limiter.EMPTY`."""


@dataclass
class Timeline:
    """The clock of a run: `tick` is the length of one tick [s], `now` the number of ticks since the start."""

    tick: float
    now: int = 0

    @property
    def time(self) -> float:
        """Physical time of `now` [s]."""
        return self.now * self.tick

    def ticks_until(self, time: float) -> int:
        """Return the last tick at or before `time` [s]; raises `TimeError` where it is not a time this clock can hold."""
        if not math.isfinite(time) or time < 0.0:
            raise TimeError(f"time {time!r} s is not a finite time >= 0; give the physical time to advance to")
        ticks = math.floor(time / self.tick * (1.0 + 1e-12))
        if ticks > MAX_TICKS:
            limit = MAX_TICKS * self.tick
            raise TimeError(f"time {time:g} s is beyond the longest run of {limit:g} s; use a coarser spacing")
        return ticks
