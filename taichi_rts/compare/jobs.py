"""One piece of a comparison as plain data, and the functions that a worker process runs. Errors are computed
elsewhere.
"""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from typing import Any, cast

import numpy as np

import taichi_rts as rts
from taichi_rts.assembly.rewind import Rewind
from taichi_rts.assembly.work import speedup_bound
from taichi_rts.compare.trajectory import Trajectory
from taichi_rts.scene.loading import scene_from
from taichi_rts.scene.near_pairs import mean_neighbours
from taichi_rts.solver.stepping.base import Stepper
from taichi_rts.solver.stepping.steppers import stepper_from
from taichi_rts.trials.demands import demanded_density
from taichi_rts.trials.memory import peak_memory, reset_peak_memory
from taichi_rts.trials.survival import largest_stable, watch

NEIGHBOUR_SAMPLES = 5


@dataclasses.dataclass(frozen=True)
class Job:
    """A run to make: plain data only, so that it can be sent to another process or machine, and hashed.

    `scene` as `Scene.to_dict` gives it, whose end time is where the run ends; `stepper` as `stepper_data` does; the number of
    equal intervals `samples` at whose ends the state is read; the device `arch` and `precision`; how many times the run is timed;
    whether it is a reference, which is followed whatever its largest density; and for others `density`, the largest that the
    reference has, over rest.
    """

    scene: dict[str, Any]
    stepper: dict[str, Any]
    samples: int = 40
    arch: str = "cpu"
    precision: str = "f32"
    repeats: int = 1
    reference: bool = False
    density: float = 1.0

    @property
    def times(self) -> list[float]:
        """Times [s] at which the state is read: the same for all runs on a scene, whatever their steps."""
        return [self.scene["end_time"] * k / self.samples for k in range(self.samples + 1)]

    @property
    def demanded_density(self) -> float:
        """Density over rest that the scene demands: by its speeds and depth, or because the reference has it.

        Single particles overshoot the jump of a shock however short the steps are (docs/evidence/stability.md).
        """
        return math.inf if self.reference else max(demanded_density(scene_from(self.scene)), self.density)


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What a run gave: its trajectory, its costs, and whether it survived; if not, `reason` says what happened."""

    trajectory: Trajectory
    costs: dict[str, Any]
    survived: bool
    reason: str
    device: str


def run(job: Job) -> Outcome:
    """Run a job in this process: once with the state read at its times, then again for each further repeat.

    The wall time is the median over all of them. Every one is warm: building a `Simulation` compiles its kernels and takes a
    first step, and a repeat starts from the same object, rewound.
    """
    device = rts.init(job.arch, job.precision, restart=True, unrolling_limit=0)  # `Rewind` unrolls over all fields
    scene = scene_from(job.scene)
    reset_peak_memory()
    follower = _Follower(job)
    seen = watch(
        scene,
        stepper_from(job.stepper),
        times=job.times,
        demanded_density=job.demanded_density,
        on_sample=follower.look,
    )
    if follower.sim is None:  # it failed before anything could be seen
        return Outcome(follower.record, {}, False, seen.reason, f"{device.arch} {device.precision}")
    memory = peak_memory()
    statistics = follower.sim.statistics
    seconds = [statistics["wall_seconds"]]
    if follower.start is not None and seen.survived:
        for _ in range(job.repeats - 1):
            follower.start.restore()
            for time in follower.record.times[1:]:
                follower.sim.advance_to(time)
            seconds.append(follower.sim.statistics["wall_seconds"])
    neighbours = float(np.mean(follower.neighbours))
    costs = {
        "wall_seconds": float(np.median(seconds)),
        "wall_seconds_all": seconds,
        "peak_memory_bytes": memory,
        "mean_neighbours": neighbours,
        **_work(follower.sim, statistics, neighbours),
    }
    return Outcome(follower.record, costs, seen.survived, seen.reason, f"{device.arch} {device.precision}")


class _Follower:
    """Keeps what a comparison needs of a run, at each of its sample times; none of it counts as the solver's time."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.record = Trajectory()
        self.neighbours: list[float] = []
        self.sim: Any = None
        self.start: Rewind | None = None
        self.every = max(1, job.samples // NEIGHBOUR_SAMPLES)

    def look(self, sim: Any) -> None:
        """Keep the present state of `sim`."""
        if self.sim is None:
            self.sim = sim
            self.start = Rewind(sim) if self.job.repeats > 1 else None
        now = sim.read()
        if len(self.record.times) % self.every == 0:
            self.neighbours.append(mean_neighbours(now.positions, now.scene.support))
        self.record.append(now)


def _work(sim: Any, statistics: dict[str, Any], neighbours: float) -> dict[str, Any]:
    """Return the counts of a run and the bound of its speed-up over uniform steps of its base step (method.md)."""
    steps, overhead = statistics["base_steps"], statistics["overhead_fraction"]
    passes = statistics.get("passes", steps) / max(1, steps)
    bound = speedup_bound(statistics["active_fraction"], overhead, passes) if overhead is not None else None
    return {
        "particle_updates": statistics["particle_updates"],
        "pair_interactions": round(statistics["particle_updates"] * neighbours),
        "base_steps": steps,
        "base_step": sim.base_step,
        "active_fraction": statistics["active_fraction"],
        "level_fractions": statistics["level_fractions"],
        "overhead_fraction": overhead,
        "speedup_bound": bound,
    }


def find_largest_stable(job: Job) -> dict[str, Any]:
    """Find the largest Courant number at which uniform steps survive the job's scene: `stable`, `unstable`, `reason`."""
    bracket = largest_stable(
        scene_from(job.scene),
        lambda courant: cast(Stepper, rts.Uniform(courant=courant)),
        fresh=lambda: rts.init(job.arch, job.precision, restart=True),
        run=partial(watch, demanded_density=job.demanded_density, times=job.times),
    )
    return {"stable": bracket.stable, "unstable": bracket.unstable, "reason": bracket.reason}
