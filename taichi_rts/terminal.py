"""How commands end and speak: one line for an error and its exit code, one console, and how far they are."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
import warnings
from collections.abc import Callable
from datetime import timedelta
from types import TracebackType
from typing import Any

from rich import progress as bars
from rich.console import Console
from rich.text import Text

UNCUT = 200  # columns of a file, a pipe or a batch system's log: nothing there cuts lines
LINE_SHARE, LINE_SECONDS = 0.1, 30.0
"""Where there is no terminal: the share of the work, and the time [s] of silence, after which there is a new line."""
BESIDE = 28  # columns that bar, share and time need beside the text of a progress bar


def make_console() -> Console:
    """Return what commands write to; as wide as its terminal, or as the environment variable COLUMNS says."""
    found = Console()
    if not found.is_terminal and "COLUMNS" not in os.environ:
        found = Console(width=UNCUT)
    return found


console = make_console()


def rate(updates: float, seconds: float) -> str:
    """Updates per second as text."""
    return f"{updates / seconds / 1e6:.2f} M updates/s" if seconds > 0.0 else "- updates/s"


def execute(command: Any) -> None:
    """Call a command; an error becomes one line and exit code 2, an interruption its own exit code."""
    gc.set_threshold(50_000)  # building kernels makes much garbage of which none goes round in circles: 0.15 s of 4.3
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: print(f"taichi-rts: warning: {message}", file=sys.stderr)
        command()


class Progress:
    """How far a command is: in a terminal a bar in one line of any width, elsewhere a line now and then.

    Such a line comes for every `LINE_SHARE` of the work, and when there was none for `LINE_SECONDS`. `look`, if given, is asked
    for what is done just then; it is called from another thread.
    """

    def __init__(self, name: str, total: float | None = None, look: Callable[[], float] | None = None) -> None:
        self.name = name
        self.text = ""
        self.done = 0.0
        self.whole = total
        self.look = look
        self.began = self._said_at = time.monotonic()
        self._said = 0.0
        self._first: tuple[float, float] | None = None
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._bar: bars.Progress | None = None
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Progress:
        if console.is_terminal:
            columns = (
                bars.TextColumn("{task.description}", markup=False),
                bars.BarColumn(bar_width=None),
                bars.TaskProgressColumn(),
                bars.TimeRemainingColumn(compact=True, elapsed_when_finished=True),
            )
            self._bar = bars.Progress(*columns, console=console, expand=True)
            self._bar.start()
            self._task = self._bar.add_task(self._fitting(), total=self.whole)
        else:
            self._thread = threading.Thread(target=self._beat, daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        if self._bar is not None:
            self._bar.stop()
        elif self._thread is not None:
            self._thread.join()

    def total(self, amount: float) -> None:
        """Take note of how much work there is."""
        self.whole = amount
        self._show()

    def begin(self, text: str) -> None:
        """Say what runs now."""
        self.text = text
        self._show()

    def advance(self, amount: float) -> None:
        """Take note that so much more work is done."""
        self.reach(self.done + amount, self.text)

    def reach(self, done: float, text: str) -> None:
        """Take note of how much work is done, and say what there is to say of it."""
        self.done, self.text = done, text
        self._first = self._first or (time.monotonic(), self._share())  # what was before is compiling
        self._show()

    def _show(self) -> None:
        if self._bar is not None:
            self._bar.update(self._task, completed=self.done, total=self.whole, description=self._fitting())
        else:
            self._say_if_due()

    def _fitting(self) -> str:
        text = Text(self.text)
        text.truncate(max(console.width - BESIDE, 12), overflow="ellipsis")
        return text.plain

    def _share(self) -> float:
        return min(1.0, self.done / self.whole) if self.whole else 0.0

    def _say_if_due(self) -> None:
        with self._lock:
            now = time.monotonic()
            further = int(self._share() / LINE_SHARE + 1e-9) > int(self._said / LINE_SHARE + 1e-9)
            if further or now - self._said_at >= LINE_SECONDS:
                self._said, self._said_at = self._share(), now
                console.print(self.line(now), soft_wrap=True, markup=False, highlight=False)

    def line(self, now: float) -> str:
        """Return the line of a log at the time `now` [s] of the monotonic clock."""
        share = self._share()
        began, done = self._first or (now, share)
        left = f", about {_clock((now - began) * (1.0 - share) / (share - done))} left" if done < share < 1.0 else ""
        return f"{self.name}: {share:.0%} after {_clock(now - self.began)}{left}; {self.text}"

    def _beat(self) -> None:
        while not self._over.wait(min(1.0, LINE_SECONDS)):
            if time.monotonic() - self._said_at >= LINE_SECONDS:
                if self.look is not None:
                    self.done = max(self.done, self.look())
                self._say_if_due()


def _clock(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))
