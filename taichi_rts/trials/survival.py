"""Does a run survive, and up to which step? One definition for the stability suite, the comparison tool and the tests."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from taichi_rts.errors import Error, SimulationDivergedError
from taichi_rts.readings.reading import Reading
from taichi_rts.scene.parts.conditions import face_axis
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation
from taichi_rts.solver.stepping.base import Stepper
from taichi_rts.trials import demands
from taichi_rts.trials.demands import demanded_density as demanded_density  # part of this module's interface

DENSITY_MARGIN = 1.05
"""Largest density over what the scene demands."""
ENERGY_MARGIN = 0.05
"""Largest gain of energy, over the scale of the scene's energy."""
CALM_MACH = 0.05
"""Mach number whose kinetic energy is the least scale of energy: half of that of a still pool at the default sound speed."""
FIRST_COURANT = 0.4
"""Where the search for the largest stable step begins."""


@dataclasses.dataclass(frozen=True)
class Outcome:
    """How a run went, by what was seen of it at its sample times.

    Attributes:
        survived: whether it kept to every criterion.
        reason: what it violated first, empty if nothing.
        time: how far it came [s].
        density: largest density over rest.
        energy: largest of (total energy - work put in) over the start's; where the start has next to none, 1 + the gain over
            the scale of `energy_scale`. Not judged where the scene is `driven_around`.
        speed: largest speed [m/s].
        courant: Courant number dt c_s/r of the longest step that was taken, by the smallest sound speed where it is regional.
        runaways: how often a speed or an acceleration had to be limited.
        base_steps: base steps done.
    """

    survived: bool
    reason: str
    time: float
    density: float
    energy: float
    speed: float
    courant: float
    runaways: int
    base_steps: int


@dataclasses.dataclass(frozen=True)
class Bracket:
    """What a bisection found.

    Attributes:
        stable: largest courant that survived; None: not even the lowest.
        unstable: smallest courant above it that did not; None: even the highest survived.
        reason: why the run at `unstable` failed.
        runs: every courant tried, in that order, and how it went.
    """

    stable: float | None
    unstable: float | None
    reason: str
    runs: tuple[tuple[float, Outcome], ...] = ()


def watch(
    scene: Scene,
    stepper: Stepper,
    *,
    samples: int = 40,
    demanded_density: float | None = None,
    end_time: float | None = None,
    times: Sequence[float] | None = None,
    on_sample: Callable[[Simulation], None] | None = None,
    build: Callable[..., Simulation] | None = None,
) -> Outcome:
    """Run `scene` and look at it at `samples` times up to its end (`sample_times`); stop at the first violation.

    It survives if at every sample: all is finite, no speed or acceleration was limited (`runaways`), no particle is lost, the
    largest density is at most 1.05 x `demanded_density` (over rest; None: `demands.demanded_density`), and the total energy
    less the work of walls, gravity changes and inflow is at most 5 % of `energy_scale` above the start's.

    With `times` [s] it is looked at exactly then, whatever the steps; the energy read between steps is less certain
    (`sample_times`), and may be twice as much above. `build` takes scene, stepper and `debug` and returns the simulation, by
    default a new one. Works in any precision, on the backend that was initialised last. Steps do not depend on when it looks.
    """
    demanded = demands.demanded_density(scene) if demanded_density is None else demanded_density
    moving = bool(scene.wall_speed or scene.inflows)
    sim = (build or Simulation)(scene, stepper, debug=moving)  # only then is their work added up
    watcher = _Watcher(sim, demanded, ENERGY_MARGIN if times is None else 2.0 * ENERGY_MARGIN)
    end = scene.end_time if end_time is None else end_time
    for time in sample_times(sim, end, samples) if times is None else times:
        try:
            sim.advance_to(time)
        except SimulationDivergedError as error:
            return watcher.outcome(str(error).partition(";")[0])
        now = sim.read()  # held while `on_sample` looks at it too
        if reason := watcher.look(now):
            return watcher.outcome(reason)
        if on_sample is not None:
            on_sample(sim)
    return watcher.outcome("")


def largest_stable(
    scene: Scene,
    make_stepper: Callable[[float], Stepper],
    lowest: float = 0.1,
    highest: float = 2.0,
    tolerance: float = 0.05,
    *,
    first: float = FIRST_COURANT,
    fresh: Callable[[], Any] | None = None,
    run: Callable[[Scene, Stepper], Outcome] = watch,
) -> Bracket:
    """Find the largest courant at which `scene` survives: double or halve from `first`, then bisect to a relative `tolerance`.

    `make_stepper` turns a courant into a stepper. `fresh` is called before every run: each builds a `Simulation`, whose Taichi
    fields stay allocated until Taichi is started again, so for more than a few runs pass e.g.
    `lambda: rts.init("cpu", restart=True)`. `run` watches one run.
    Survival is taken to be monotonic: islands of stability above the first failure are not looked for.
    Raises `Error` for bounds that are no interval.
    """
    if not (0.0 < lowest < highest and tolerance > 0.0):
        raise Error(
            f"lowest {lowest:g}, highest {highest:g}, tolerance {tolerance:g}: need 0 < lowest < highest and "
            "tolerance > 0; try 0.1, 2 and 0.05"
        )
    runs: list[tuple[float, Outcome]] = []

    def survives(courant: float) -> bool:
        if fresh is not None:
            fresh()
        runs.append((courant, run(scene, make_stepper(courant))))
        return runs[-1][1].survived

    def bracket(stable: float | None, unstable: float | None) -> Bracket:
        reason = next((outcome.reason for courant, outcome in runs if courant == unstable), "")
        return Bracket(stable, unstable, reason, tuple(runs))

    stable: float | None = None
    unstable: float | None = None
    courant = min(max(first, lowest), highest)
    while True:
        if survives(courant):
            stable = courant
        else:
            unstable = courant
        if unstable is None:
            if courant >= highest:
                return bracket(stable, None)
            courant = min(2.0 * courant, highest)
        elif stable is None:
            if courant <= lowest:
                return bracket(None, unstable)
            courant = max(0.5 * courant, lowest)
        elif unstable - stable > tolerance * stable * (1.0 + 1e-9):
            courant = 0.5 * (stable + unstable)
        else:
            return bracket(stable, unstable)


def sample_times(sim: Simulation, end: float, samples: int) -> list[float]:
    """Times [s] at which to look: `samples` equal ones, each moved back to the last end of a base step, and `end` itself.

    Between two evaluations a reader sees predicted velocities but densities of the last evaluation, and so where fluid bounces
    an energy that does not exist: +7 % for a block at Mach 0.7 on a pool, although none is gained.
    """
    step = sim.base_step
    times = {math.floor(end * k / samples / step * (1.0 + 1e-12)) * step for k in range(samples + 1)}
    return sorted({time for time in times if time < end * (1.0 - 1e-9)} | {end})


def energy_scale(sim: Simulation, start: float, work: float) -> float:
    """Energy [J] that gains are measured by: that of the start, or the work done since, where that is larger.

    A scene that starts with next to none (at rest without gravity, or on the floor) is measured by the kinetic energy of all
    its fluid at Mach 0.05, of the smallest sound speed where it is regional.
    """
    calm = 0.5 * sim.medium.mass * sim.count * (CALM_MACH * sim.scene.least_wave_speed) ** 2
    return max(start, abs(work), calm)


def driven_around(scene: Scene) -> bool:
    """Whether gravity or a body force acts along a periodic axis, where it has no potential: energy comes in with every round."""
    force, gradient = np.array(scene.acceleration, float), np.zeros((scene.dim, scene.dim))
    if scene.body_force is not None:
        force, gradient = force + np.array(scene.body_force.base[1]), np.array(scene.body_force.gradient)
    return any(around and (force[d] != 0.0 or gradient[d].any()) for d, around in enumerate(scene.is_periodic))


class _Watcher:
    """Looks at a run at its sample times and keeps the extremes."""

    def __init__(self, sim: Simulation, demanded: float, energy_margin: float) -> None:
        self.sim = sim
        self.demanded = demanded
        self.energy_margin = energy_margin
        self.start_count = sim.count
        self.start = sim.energy().total
        self.density = self.speed = self.courant = 0.0
        self.energy = -math.inf
        self.runaways = 0

    def look(self, now: Reading) -> str:
        """Return the first violation of the present state, or nothing."""
        sim = self.sim
        x, v, rho = now.positions, now.velocities, now.densities
        self.runaways = now.runaways
        at = f"at t = {sim.time:.4g} s"
        finite = np.isfinite(x).all() and np.isfinite(v).all() and np.isfinite(rho).all()
        if not finite:
            return f"not finite {at}"
        density = float(rho.max()) / sim.medium.rest_density
        self.density = max(self.density, density)
        self.speed = max(self.speed, float(np.linalg.norm(v.astype(np.float64), axis=1).max()))
        self.courant = max(self.courant, float(now.steps.max()) * sim.scene.least_wave_speed / sim.medium.support)
        work = sim.work()
        scale = energy_scale(sim, self.start, work)
        gain = (now.energy.total - work - self.start) / scale
        self.energy = max(self.energy, 1.0 + gain)
        if self.runaways:
            return f"{self.runaways} speeds or accelerations limited {at}"
        if lost := lost_particles(sim, x, self.start_count):
            return f"{lost} {at}"
        if density > DENSITY_MARGIN * self.demanded:
            return f"density {density:.3f} of rest {at}, at most {DENSITY_MARGIN:g} x {self.demanded:.3f} allowed"
        if gain > self.energy_margin and not driven_around(sim.scene):
            return f"energy {gain:+.1%} {at}, at most {self.energy_margin:+.0%} of {scale:.3g} J allowed"
        return ""

    def outcome(self, reason: str) -> Outcome:
        """Sum up what was seen."""
        return Outcome(
            survived=not reason,
            reason=reason,
            time=self.sim.time,
            density=self.density,
            energy=max(self.energy, 0.0),
            speed=self.speed,
            courant=self.courant,
            runaways=self.runaways,
            base_steps=int(self.sim.statistics["base_steps"]),
        )


def lost_particles(sim: Simulation, x: np.ndarray, expected: int) -> str:
    """Say how many particles are missing, outside the domain, or behind a wall that moved; empty if none.

    `x` are positions [m], (N, dim). Faces of periodic axes lose none. More particles than `expected` come from inflows; those
    that outlets have taken out are not missed.
    """
    expected -= sim.removed_count
    if sim.count < expected:
        return f"{expected - sim.count} of {expected} particles gone"
    lower, upper = (np.array(corner, dtype=np.float64) for corner in (sim.scene.domain.lower, sim.scene.domain.upper))
    for wall in sim.scene.moving_walls:
        axis, face = face_axis(wall.face), lower if wall.face[1] == "-" else upper
        face[axis] += wall.displacement(sim.time)
    slack = 1e-3 * sim.scene.spacing + 4.0 * np.spacing(np.abs(x).max())  # the rounding of the state's precision
    closed = ~np.array(sim.scene.is_periodic)
    outside = (((x < lower - slack) | (x > upper + slack)) & closed).any(axis=1)
    return f"{int(outside.sum())} particles outside the walls" if outside.any() else ""
