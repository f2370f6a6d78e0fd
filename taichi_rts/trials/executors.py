"""Where runs are made: in one process after another by default, in this one, or on a Dask cluster."""

from __future__ import annotations

import importlib.util
import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from taichi_rts.errors import Error

POLL = 0.05  # seconds between two looks at what is done


@dataclass(frozen=True)
class Task:
    """A call to make in a worker: a function of a module and plain data, what to tell the user, and about how much work it is."""

    description: str
    weight: float
    function: Callable[[Any], Any]
    argument: Any


class Here:
    """An executor that makes each call at once, in this process."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call `function`; the future returned is done."""
        future: Future[Any] = Future()
        future.set_result(function(*arguments))
        return future


@contextmanager
def processes(workers: int = 1) -> Iterator[ProcessPoolExecutor]:
    """Provide `workers` fresh processes; they end at once when this one is interrupted."""
    if workers < 1:
        raise Error(f"--workers {workers} is below 1; use 1, or as many as there are idle processors")
    context = multiprocessing.get_context("spawn")  # Taichi's threads do not survive a fork
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_leave_interrupts_to_parent)
    try:
        yield pool
    except BaseException:
        for process in list((pool._processes or {}).values()):  # a task would take minutes to end by itself
            process.terminate()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def _leave_interrupts_to_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def require_dask() -> None:
    """Raise `Error` if the extra is not installed, before any work is done."""
    if importlib.util.find_spec("distributed") is None:
        raise Error("--dask needs the package distributed; run: pip install 'taichi_rts[cluster]'")


@contextmanager
def dask(address: str, workers: int = 1) -> Iterator[Any]:
    """Connect to the Dask scheduler at `address`, or start a `local` cluster of `workers` processes with one task each.

    Raises `Error` if the package is missing or no scheduler answers.
    """
    require_dask()
    from distributed import Client, LocalCluster

    if address == "local":
        with (
            LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
            ) as cluster,
            Client(cluster) as client,  # type: ignore[no-untyped-call]
        ):
            yield client
        return
    try:
        client = Client(address, timeout=10)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise Error(
            f"--dask {address!r}: no scheduler answers there ({error}); check the address, or use local"
        ) from None
    with client:
        yield client


def collect(
    executor: Any, tasks: Sequence[Task], begin: Callable[[str], None], done: Callable[[int, Any], None]
) -> None:
    """Run all tasks; call `begin` with what runs now and `done` with a task's number and result as soon as it is there."""
    futures: dict[int, Any] = {}
    for number, task in enumerate(tasks):
        begin(task.description)
        futures[number] = executor.submit(task.function, task.argument)
        if isinstance(executor, Here):
            done(number, futures.pop(number).result())
    while futures:
        ready = [number for number, future in futures.items() if not hasattr(future, "done") or future.done()]
        for number in ready:
            try:
                result = futures.pop(number).result()
            except BrokenProcessPool:
                raise Error(
                    f"the process that ran {tasks[number].description} died, perhaps for want of memory; "
                    "use a coarser --spacing or fewer --workers, then --resume"
                ) from None
            done(number, result)
        if futures:
            begin(tasks[min(futures)].description)
            if not ready:
                time.sleep(POLL)
