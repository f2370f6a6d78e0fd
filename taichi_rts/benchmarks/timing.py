"""Timed windows of a run, after a warm-up; ratios of windows that were timed in turn."""

import statistics
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import taichi_rts as rts
from taichi_rts.device.backend import ti


@dataclass(frozen=True)
class Pace:
    """What a window cost: wall time [s], particle updates, base steps."""

    wall: float
    updates: int
    steps: int

    @property
    def updates_per_second(self) -> float:
        """Particle updates per second of wall time."""
        return self.updates / self.wall

    @property
    def wall_per_step(self) -> float:
        """Wall time [s] of a base step."""
        return self.wall / self.steps


def pace(sim: rts.Simulation, steps: int) -> Pace:
    """Advance by `steps` base steps and return what they cost; the solver's time alone."""
    before = sim.statistics
    sim.advance_to(sim.time + steps * sim.base_step * (1.0 + 1e-9))
    after = sim.statistics
    return Pace(
        after["wall_seconds"] - before["wall_seconds"],
        after["particle_updates"] - before["particle_updates"],
        after["base_steps"] - before["base_steps"],
    )


def in_turn(sims: Sequence[rts.Simulation], steps: Sequence[int], repeats: int) -> list[list[Pace]]:
    """Time windows of several runs one after the other, `repeats` times: what disturbs the machine disturbs all alike."""
    found: list[list[Pace]] = [[] for _ in sims]
    for _ in range(repeats):
        for paces, sim, count in zip(found, sims, steps, strict=True):
            paces.append(pace(sim, count))
    return found


def median_of(paces: Sequence[Pace], what: Callable[[Pace], float]) -> float:
    """Median over windows."""
    return statistics.median(map(what, paces))


def put(sim: rts.Simulation, x: np.ndarray, v: np.ndarray, rho: np.ndarray) -> None:
    """Give a run the state of another at the same resolution, (N, dim), (N, dim), (N,), and step once."""
    p = sim.particles
    order = p.identity.to_numpy()
    for field, values in ((p.x, x), (p.v, v), (p.rho, rho)):
        field.from_numpy(values[order].astype(sim.backend.numpy_dtype))
    p.a.fill(0.0)
    pace(sim, 1)


def timed_steps(sim: rts.Simulation, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Advance `count` steps one by one; return how many particles were due in each and what it took [s], (count,) each."""
    due, wall = np.zeros(count), np.zeros(count)
    for n in range(count):
        target = sim.timeline.now + 64 * sim.schedule.levels
        ti.sync()
        began = clock.perf_counter()
        if sim.schedule.begin(sim.timeline, target):
            sim.step()
        ti.sync()
        wall[n] = clock.perf_counter() - began
        due[n] = int(sim.schedule.due_count[None])
    return due, wall


def share_of_full_step(due: np.ndarray, wall: np.ndarray, particles: int, share: float) -> float:
    """Cost of a step in which `share` of all is due over that of a full one, by the line through timed steps.

    The line goes through the medians of steps with a similar number due, so single disturbed steps do not count.
    """
    bins = np.round(due / particles * 20.0).astype(int)
    kinds = [k for k in np.unique(bins) if (bins == k).sum() >= 3]
    x = np.array([due[bins == k].mean() / particles for k in kinds])
    y = np.array([np.median(wall[bins == k]) for k in kinds])
    slope, rest = np.polyfit(x, y, 1) if len(kinds) > 1 else (0.0, float(y[0]))
    return float((rest + slope * share) / (rest + slope))
