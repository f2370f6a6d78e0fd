"""Ctrl-C while the package is imported as a program, `taichi-rts` or `python -m taichi_rts`: one line and exit code 130.

Nothing of this happens where a script imports the package.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType
from typing import Any

PROGRAM = "taichi-rts"


def runs_as_program(arguments: list[str], started_as: list[str]) -> bool:
    """Whether the process with `sys.argv` `arguments`, and `sys.orig_argv` `started_as`, is the command line."""
    if "--multiprocessing-fork" in started_as:  # a process that the program has spawned
        return False
    name = os.path.basename(arguments[0]) if arguments else ""
    if name == "-m":  # so it is until `python -m` has found the module
        place = started_as.index("-m") + 1 if "-m" in started_as else len(started_as)
        return place < len(started_as) and started_as[place].split(".")[0] == __package__
    return name.removesuffix(".exe").removesuffix("-script.py") == PROGRAM


def _end(number: int, frame: FrameType | None) -> None:
    # No exception: what is being imported might catch it, or show it. Nothing has been written that would be lost.
    os.write(2, f"{PROGRAM}: interrupted while starting; nothing was written\n".encode())
    os._exit(128 + number)


def watch() -> Any:
    """End the process at the first Ctrl-C from here on; return what happened before, None if that stays as it is."""
    default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not (default and threading.current_thread() is threading.main_thread()):
        return None  # e.g. ignored by a shell that started it in the background
    if not runs_as_program(sys.argv, sys.orig_argv):
        return None
    return signal.signal(signal.SIGINT, _end)


def done() -> None:
    """Let the program itself handle Ctrl-C."""
    if _before is not None and signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, _before)


_before = watch()
