"""Peak memory of this process [bytes]."""

from __future__ import annotations

import contextlib
import resource
import sys
from pathlib import Path

CLEAR_PEAK = "5"  # proc(5), /proc/pid/clear_refs: reset the peak resident set size to the present one


def reset_peak_memory() -> None:
    """Forget the peak so far, where the system can (Linux)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text(CLEAR_PEAK, encoding="ascii")


def peak_memory() -> int:
    """Largest resident set [bytes] since `reset_peak_memory`; on systems without /proc since the process began.

    It holds everything in the process: Python, the compiler and the compiled kernels besides the particles.
    """
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    usage = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return usage if sys.platform == "darwin" else usage * 1024
