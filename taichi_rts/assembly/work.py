"""How much work a run did: counts by level, and the share of a step that is done for all particles."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from taichi_rts.device.backend import ti
from taichi_rts.solver.particles.particles import Particles


@dataclass
class Tally:
    """Work done so far. Counts per level start at level 1."""

    levels: int
    base_steps: int = 0
    possible: int = 0
    """Updates if every particle had been updated in every base step."""
    wall_seconds: float = 0.0
    particle_steps: list[int] = field(default_factory=list)
    updates: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.particle_steps = [0] * self.levels
        self.updates = [0] * self.levels

    def add(self, steps: int, count: int, particle_steps: Sequence[int], updates: Sequence[int]) -> None:
        """Add `steps` steps of `count` particles with their counts per level; empty ones mean all particles at level 1."""
        self.base_steps += steps
        self.possible += steps * count
        all_at_first = [steps * count]
        for k, n in enumerate(particle_steps or all_at_first):
            self.particle_steps[k] += n
        for k, n in enumerate(updates or all_at_first):
            self.updates[k] += n

    @property
    def particle_updates(self) -> int:
        """Updates so far."""
        return sum(self.updates)

    def statistics(self) -> dict[str, Any]:
        """Return the counts as a plain dict; fractions per level are averages over all particles and steps."""
        total = max(1, sum(self.particle_steps))
        updates, full = self.particle_updates, max(1, self.possible)
        return {
            "base_steps": self.base_steps,
            "particle_updates": updates,
            "wall_seconds": self.wall_seconds,
            "active_fraction": updates / full if self.base_steps else 1.0,
            "level_fractions": [n / total for n in self.particle_steps],
            "update_fractions": [n / max(1, updates) for n in self.updates],
        }


class Stopwatch:
    """Adds up the time spent inside its `with` blocks while `running`; waits for the device at both ends."""

    def __init__(self) -> None:
        self.running = False
        self.seconds = 0.0
        self._began = 0.0

    def __enter__(self) -> None:
        if self.running:
            ti.sync()
            self._began = clock.perf_counter()

    def __exit__(self, *_: object) -> None:
        if self.running:
            ti.sync()
            self.seconds += clock.perf_counter() - self._began


class Overhead:
    """Measures the work for all particles in a step against that for the due particles, on every `EVERY`-th step.

    Waiting for the device costs a GPU a little, so only a sample is timed.
    """

    EVERY = 61  # prime, or it would always sample the same pass of a cycle

    def __init__(self, particles: Particles) -> None:
        self.particles = particles
        self.shared = Stopwatch()
        self.due = Stopwatch()
        self.samples = 0
        self.updates = 0
        self._steps = 0

    @contextmanager
    def sampled_step(self, due_count: ti.Field) -> Iterator[None]:
        """Time the step inside if it is its turn; `due_count` then says how many particles it updated."""
        self._steps += 1
        if self._steps % self.EVERY:
            yield
            return
        self.shared.running = self.due.running = True
        yield
        self.shared.running = self.due.running = False
        self.samples += 1
        self.updates += int(due_count[None])

    @property
    def fraction(self) -> float | None:
        """Epsilon: shared time over the time of a step in which all particles are due; None before the first sample."""
        if not self.updates:
            return None
        shared = self.shared.seconds / self.samples
        return shared / (shared + self.due.seconds / self.updates * self.particles.count)


def speedup_bound(active_fraction: float, overhead_fraction: float, passes: float = 1.0) -> float:
    """Upper bound for the speed-up over uniform steps of the base step: 1 / (e p + (1-e) a).

    `active_fraction` a holds sum_n f_n/n and the recomputation by pre-emption; `overhead_fraction` e is the share of
    the work that is done for all particles in each of the p `passes` of a base step.
    """
    return 1.0 / (overhead_fraction * passes + (1.0 - overhead_fraction) * active_fraction)
