"""Ctrl-C and SIGTERM: a run that has begun stops between two steps and keeps what it has done."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupts:
    """Within this context the first signal is noted for `asked`; a second one, or one before `defer`, ends the program at once.

    Whatever `KeyboardInterrupt` leaves the context gets the `exit_code` of the signal: 130 or 143.
    """

    def __init__(self) -> None:
        self.number = 0
        self.deferred = False
        self._before: dict[Any, Any] = {}

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():  # others cannot handle signals
            self._before = {each: signal.signal(each, self._handle) for each in SIGNALS}
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: TracebackType | None) -> None:
        for each, handler in self._before.items():
            signal.signal(each, handler)
        if isinstance(error, KeyboardInterrupt) and self.number:
            error.exit_code = 128 + self.number  # type: ignore[attr-defined]

    def defer(self) -> None:
        """From now on the first signal is only noted."""
        self.deferred = True

    def asked(self) -> bool:
        """Whether a signal has come."""
        return self.number != 0

    def _handle(self, number: int, frame: FrameType | None) -> None:
        first, self.number = self.number == 0, number
        if not (first and self.deferred):
            raise KeyboardInterrupt  # perhaps in the middle of a step, whose state is of no use
