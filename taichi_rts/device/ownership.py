"""Objects that are lost when Taichi is started again: using them then is a clear error instead of a crash.

Taichi frees all memory when it is started again, has its CPU threads only in the process that started it, and makes fields only
in the thread that did.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import gc
import os
import threading
from collections.abc import Callable
from typing import Any, TypeVar

from taichi_rts.errors import BackendError

FORKED = (
    "this process was forked after Taichi had started, and Taichi's threads do not survive a fork: use "
    'multiprocessing.get_context("spawn"), and call taichi_rts.init in each process (docs/starting.md)'
)
T = TypeVar("T", bound=type)
_taichi: Any = None
"""The module, as `backend` has imported it; it cannot be had from there, which imports this file."""
_lost = False


def watch(taichi: Any) -> None:
    """Say which module is Taichi; `backend` does so once, before anything else here is called."""
    global _taichi
    _taichi = taichi
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_forget_in_child)


class Start:
    """One start of Taichi, in this process and this thread."""

    def __init__(self) -> None:
        self._runtime = _runtime()
        self._thread, self._thread_name = threading.get_ident(), threading.current_thread().name

    @property
    def lives(self) -> bool:
        """Whether Taichi has neither been started again nor reset since."""
        return _runtime() is self._runtime and program(self._runtime) is not None

    @property
    def is_here(self) -> bool:
        """Whether this is the thread in which Taichi was started."""
        return threading.get_ident() == self._thread

    def require(self, what: str) -> None:
        """Raise `BackendError` if `what` lived in memory that Taichi has freed since, or in another process."""
        if not self.lives:
            require_own_process()
            raise BackendError(
                f"{what} belongs to an earlier init: Taichi has been started again or reset since, which frees its memory; "
                "build it again, and call init once for all simulations"
            )

    def require_thread(self) -> None:
        """Raise `BackendError` unless fields can be made here."""
        if not self.is_here:
            here = threading.current_thread().name
            raise BackendError(
                f"Taichi was started in thread {self._thread_name!r} and makes fields only there, not in {here!r}; build the "
                "simulation there and run it in any thread, or call init in the thread that builds it (docs/starting.md)"
            )


def require_own_process() -> None:
    """Raise `BackendError` in a process that was forked after Taichi had started."""
    if _lost:
        raise BackendError(FORKED)


def holds_fields() -> bool:
    """Whether anything would be lost if Taichi were started again: fields or arrays, ours or the user's."""
    runtime = _runtime()
    started = program(runtime)
    if started is None:
        return False
    if started.get_snode_tree_size() or runtime.global_vars or not _taichi.lang.impl.root.empty:
        return True
    # Taichi keeps no list of its arrays.
    return any(
        isinstance(thing, _taichi.Ndarray) and getattr(thing, "_runtime", runtime) is runtime
        for thing in gc.get_objects()
    )


def guarded(*plain: str) -> Callable[[T], T]:
    """Decorate a class with a `taichi_start`: its public methods and properties, but for `plain` ones, check that first."""

    def decorate(kind: T) -> T:
        for name, member in list(vars(kind).items()):
            if name.startswith("_") or name in plain:
                continue
            if isinstance(member, property) and member.fget:
                setattr(kind, name, property(_checked(member.fget), member.fset, member.fdel, member.__doc__))
            elif callable(member):
                setattr(kind, name, _checked(member))
        return kind

    return decorate


def program(runtime: Any) -> Any:
    """Return what Taichi has started, None if nothing."""
    return getattr(runtime, _program_name(runtime))


def _program_name(runtime: Any) -> str:
    return "_prog" if hasattr(runtime, "_prog") else "prog"  # quadrants' `prog` raises where there is none


def _runtime() -> Any:
    return _taichi.lang.impl.get_runtime()  # a new object after each `ti.init` and `ti.reset`


def _checked(method: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(method)
    def checked(self: Any, *args: Any, **options: Any) -> Any:
        self.taichi_start.require("this simulation")
        return method(self, *args, **options)

    return checked


def _forget_in_child() -> None:
    """In a forked child drop Taichi's program: to use it, or even to end it, would wait for threads that it lacks."""
    global _lost
    runtime = _runtime()
    started = program(runtime)
    if started is not None:
        _lost = True
        with contextlib.suppress(AttributeError):  # no CPython
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(started))  # so that its destructor never runs
        setattr(runtime, _program_name(runtime), None)
