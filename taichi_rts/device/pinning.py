"""Whether Taichi's threads have a core each: only while no other process uses the cores.

Taichi's threads sleep between loops, and Linux wakes them on the core that they were woken from: two of them then share one core
for milliseconds, longer than most kernels take. With a core each they do not. But a thread that may not move waits for whatever
else runs on its core, and all wait for it (docs/evidence/speed.md). So what others use is measured, again and again.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

VARIABLE = "TAICHI_RTS_PIN"
"""In the environment: 0 never pins, 1 always does."""
QUIET = 0.25
"""Cores' worth of other processes from which on threads stay free; one busy process uses 1."""
SHORTEST = 0.2
"""Time [s] over which what others use is measured, at least: Linux counts it in hundredths of a second."""
_IDLE = (3, 4)  # columns of /proc/stat: idle, and waiting for disks
_COUNTED = 8  # columns that are not parts of others


@dataclass(frozen=True)
class Usage:
    """What has been used until a moment `at` [s]: processor time [s] of the cores by all, `busy`, and by this process, `own`."""

    at: float
    busy: float
    own: float


def pays(threads: int, cores: int, others: float | None) -> bool:
    """Whether `threads` should have one of `cores` each, while other processes use `others` of the cores (None: unknown).

    Only if there is a thread for every core that it may use: fewer are for sharing the machine, and must be free to move.
    """
    return 1 < cores == threads and others is not None and others < QUIET


def used_by_others(before: Usage, after: Usage) -> float | None:
    """How many cores other processes have kept busy between two moments; None if those are too near to each other."""
    elapsed = after.at - before.at
    if elapsed < SHORTEST:
        return None
    return max(0.0, (after.busy - before.busy) - (after.own - before.own)) / elapsed


def busy_seconds(stat: str, cores: Collection[int], ticks: float) -> float:
    """Processor time [s] that `cores` have been busy since the start, from the text of /proc/stat, in 1/`ticks` s."""
    found = 0.0
    for line in stat.splitlines():
        name, *counts = line.split()
        if name.startswith("cpu") and name[3:].isdigit() and int(name[3:]) in cores:
            found += sum(int(n) for k, n in enumerate(counts[:_COUNTED]) if k not in _IDLE) / ticks
    return found


def usage() -> Usage | None:
    """What has been used until now; None where only Linux could say."""
    try:
        cores, ticks = os.sched_getaffinity(0), os.sysconf("SC_CLK_TCK")
        busy = busy_seconds(Path("/proc/stat").read_text(encoding="ascii"), cores, ticks)
    except (AttributeError, OSError, ValueError):
        return None
    return Usage(time.monotonic(), busy, time.process_time())


class Pinning:
    """The threads of Taichi's pool, and whether each has a core of its own."""

    def __init__(self, started: Sequence[int], threads: int, before: Usage | None) -> None:
        """Take the threads of the pool, the last `threads` of those that `ti.init` has `started` since `before`, and look."""
        self.cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_setaffinity") else []
        self.pool = list(started[-threads:]) if len(started) >= threads else []
        self.before = before
        self.is_pinned = False
        self.look()

    def look(self) -> None:
        """Pin the threads or let them go, by what other processes have used since the last look; at most every `SHORTEST`."""
        wish = os.environ.get(VARIABLE)
        if len(self.pool) != len(self.cores) or wish == "0":
            return
        if wish == "1":
            self._set(pays(len(self.pool), len(self.cores), 0.0))
            return
        now = usage()
        if now is None or self.before is None:
            return
        others = used_by_others(self.before, now)
        if others is not None:
            self.before = now
            self._set(pays(len(self.pool), len(self.cores), others))

    def _set(self, pinned: bool) -> None:
        if pinned != self.is_pinned:
            self.is_pinned = pinned
            for thread, core in zip(self.pool, self.cores, strict=True):
                with contextlib.suppress(OSError):  # a thread that has ended, or a sandbox that forbids it
                    os.sched_setaffinity(thread, {core} if pinned else set(self.cores))
