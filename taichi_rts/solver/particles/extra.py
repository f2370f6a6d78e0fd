"""What only some runs have, such as inflows or a regional sound speed: a class derived from `Extra` with the hooks it needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Extra:
    """The hooks on the host, which `Solver` and what reads a run call for each extra; each does nothing unless derived.

    `now` is a tick, `tick` its length [s].
    """

    def before_sort(self, now: int, tick: float, before_change: Callable[[], object]) -> None:
        """The grid is about to be sorted (line 4); call `before_change()` before changing the number of particles."""

    def before_regions(self, schedule: Any, now: int, tick: float) -> None:
        """Regions are about to be assigned (lines 5-16)."""

    def before_forces(self, schedule: Any, now: int, tick: float) -> None:
        """Densities and forces of the particles that are due in `schedule` are about to be found (lines 18-29)."""

    def statistics(self) -> dict[str, Any]:
        """What the run's statistics say of it."""
        return {}

    def energy_brought(self) -> float:
        """Energy [J] that it has brought among the particles so far, by their number; taken away where negative."""
        return 0.0

    def restored(self) -> None:
        """All fields that are not transient have been put back to what they were at another time."""

    def kept(self, tick: float) -> Any:
        """What a snapshot of the run keeps of it; arrays by particle id."""
        return None

    def go_on(self, kept: Any, now: int, tick: float) -> None:
        """Go on at tick `now` from what a snapshot has kept, None if that run had no such extra."""
