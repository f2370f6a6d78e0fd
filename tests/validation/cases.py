"""The validation cases: a scene, when to look at it, and how far it is from an exact solution or an experiment.

`tests/validation/test_cases.py` bounds the errors at a coarse size, `studies/validation.py` prints the table of
docs/evidence/validation.md.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import exact
import experiments as measured
import numpy as np

import taichi_rts as rts


class Look(NamedTuple):
    """What a run looks like at `time` [s]: positions [m] and velocities [m/s], (N, dim), and pressures [Pa], (N,)."""

    time: float
    x: np.ndarray
    v: np.ndarray
    p: np.ndarray


@dataclass(frozen=True)
class Case:
    """A scene at two spacings [m], and what is measured of it.

    `times` gives, for the scene, when to look [s]; `errors` makes named errors out of the scene and the looks. The scene is
    a built-in one with `changes`; `peers` says for some errors what others reach. Where it is about the formulation,
    `all_steppers` is false, and the table has uniform steps only.
    """

    scene_name: str
    spacings: tuple[float, float]
    times: Callable
    errors: Callable
    changes: dict = field(default_factory=dict)
    peers: dict = field(default_factory=dict)
    all_steppers: bool = True

    def scene(self, spacing=None):
        """Return the scene, at the coarser spacing if none is given."""
        return rts.load_scene(self.scene_name, spacing=spacing or self.spacings[0], **self.changes)


def run(case, stepper, spacing=None, **wrong):
    """Return the errors of a run and its statistics; `wrong` changes the run's scene, but not what it is compared with."""
    scene = case.scene(spacing)
    sim = rts.Simulation(scene.replace(**wrong), stepper)
    looks = []
    for time in case.times(scene):
        sim.advance_to(time)
        looks.append(Look(time, sim.positions().astype(float), sim.velocities().astype(float), sim.pressures()))
    return case.errors(scene, looks), sim.statistics


def parts(number, start=0.0):
    """Return a function that cuts the scene's time from `start` times its end into `number` equal parts."""
    return lambda scene: scene.end_time * (start + (1.0 - start) * np.arange(1, number + 1) / number)


def relative_l2(found, expected):
    """Relative L2 norm of the difference."""
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def drop_errors(frequency):
    """Largest relative error of the semi-axes over all looks, and that of the axes at the last."""

    def errors(scene, looks):
        times = np.array([look.time for look in looks])
        axes = np.stack(exact.drop_axes(times, scene.fluids[0].velocity.gradient[0][0], frequency), axis=1)
        found = np.array([2.0 * np.sqrt((look.x**2).mean(axis=0)) for look in looks])
        off = np.abs(found / axes - 1.0)
        return {"axes": float(off.max()), "axes at the end": float(off[-1].max())}

    return errors


def pressure_error(scene, looks):
    """Mean over the looks of the relative L2 error of p = rho g (H - z)."""
    depth = scene.fluids[0].upper[1]

    def error(look):
        expected = scene.rest_density * measured.G * np.maximum(depth - look.x[:, 1], 0.0)
        return relative_l2(look.p, expected)

    return {"pressure": float(np.mean([error(look) for look in looks]))}


def jet_errors(scene, looks):
    """Relative error, with its sign, of the jet's speed against sqrt(2 g h), mean over its particles and the looks.

    h is their depth under the tank's surface, which lies half a spacing over its 20 highest particles.
    """
    floor, sink = scene.obstacles[0].lower[1], scene.outlets[0].upper[1]

    def error(look):
        surface = np.sort(look.x[:, 1])[-20:].mean() + 0.5 * scene.spacing
        jet = (look.x[:, 1] > sink + 0.05) & (look.x[:, 1] < floor)
        fall = np.sqrt(2.0 * measured.G * (surface - look.x[jet, 1]))
        return float((np.linalg.norm(look.v[jet], axis=1) / fall).mean()) - 1.0

    return {"jet": float(np.mean([error(look) for look in looks]))}


def vortex_errors(scene, looks):
    """Largest error of the rms speed over its start's, and relative L2 error of the velocities at the last look."""
    k = 2.0 * math.pi / scene.fluids[0].velocity.wavelength
    decay = [math.exp(-2.0 * scene.kinematic_viscosity * k * k * look.time) for look in looks]
    start = 0.5 * scene.fluids[0].velocity.speed ** 2
    speeds = np.sqrt([(look.v**2).sum(axis=1).mean() / start for look in looks])
    last = scene.fluids[0].velocity.at(looks[-1].x) * decay[-1]
    return {"speed": float(np.abs(speeds / decay - 1.0).max()), "velocities": relative_l2(looks[-1].v, last)}


def poiseuille_errors(scene, looks):
    """Largest error of the velocity along the channel over its steady maximum, at all looks, and at the last relative L2."""
    force, nu = scene.acceleration[0], scene.kinematic_viscosity
    profiles = [exact.poiseuille(look.x[:, 1], look.time, force, nu) for look in looks]
    worst = max(np.abs(look.v[:, 0] - u).max() for look, u in zip(looks, profiles, strict=True))
    return {
        "velocity, largest": float(worst / (force / (8.0 * nu))),
        "velocity, start-up": relative_l2(looks[0].v[:, 0], profiles[0]),
        "velocity, steady": relative_l2(looks[-1].v[:, 0], profiles[-1]),
    }


def wave_errors(scene, looks):
    """Relative errors, with their signs, of the period and of the first crest of the surface's first mode.

    The mode is read from all particles, 2 <y cos kx>: water of height h = H + a cos kx has its mean y at h/2 in each column.
    It goes through zero after half a period and again after a whole one.
    """
    wave = scene.fluids[0].velocity
    k = wave.wavenumber
    omega = math.sqrt(measured.G * k * math.tanh(k * wave.depth))
    times = np.array([look.time for look in looks])
    mode = np.array([2.0 * (look.x[:, 1] * np.cos(k * look.x[:, 0])).mean() for look in looks])
    n = int(np.argmax((mode[:-1] < 0.0) & (mode[1:] >= 0.0)))
    period = times[n] - mode[n] * (times[n + 1] - times[n]) / (mode[n + 1] - mode[n])
    crest = float(mode.max() / (wave.speed / omega) - 1.0)
    return {"period": float(period * omega / (2.0 * math.pi) - 1.0), "crest": crest}


def fall_error(scene, looks):
    """Largest error of the velocity over that of the fall; positions are second in line, they integrate it."""
    look = looks[-1]
    fall = measured.G * look.time
    return {"velocity": float(np.abs(look.v + np.array([0.0, fall, 0.0])).max() / fall)}


def after(table, base, gravities):
    """Times [s] of an experiment's `table`, which has them over sqrt(base/(gravities g))."""
    return table[:, 0] * math.sqrt(base / (gravities * measured.G))


def front_errors(table, times, base):
    """Mean absolute and mean relative error of the front at `times` [s] against a `table`, which has it over `base` [m]."""

    def errors(scene, looks):
        at = {look.time: look for look in looks}
        off = np.array([measured.front(at[time].x) / base for time in times]) / table[:, 1] - 1.0
        return {"front": float(np.abs(off).mean()), "front, signed": float(off.mean())}

    return errors


A, L = measured.MARTIN_MOYCE_A, measured.KOSHIZUKA_OKA_L
HEIGHT = measured.MARTIN_MOYCE_HEIGHT[:-1]
"""Without the last, when the front has long met the end of the scene's tank."""
FRONT_TIMES, HEIGHT_TIMES = after(measured.MARTIN_MOYCE_FRONT, A, 2), after(HEIGHT, A, 1)
KOSHIZUKA_TIMES = after(measured.KOSHIZUKA_OKA_FRONT, L, 2)


def martin_moyce_errors(scene, looks):
    """Errors of the front, and of the height at the wall over its first."""
    at = {look.time: look for look in looks}
    heights = np.array([measured.column_height(at[time].x, scene.spacing) for time in HEIGHT_TIMES])
    off = heights / scene.fluids[0].upper[1] - HEIGHT[:, 1]
    front = front_errors(measured.MARTIN_MOYCE_FRONT, FRONT_TIMES, A)(scene, looks)
    return front | {"height": float(np.abs(off).mean()), "height, signed": float(off.mean())}


TRIXI_DROP = {"density": "continuity", "kernel": "wendland_c2", "support_ratio": 3.0, "sound_speed": 10.0}
"""As in TrixiParticles.jl's examples/fluid/oscillating_drop_2d.jl, but for the particles' arrangement."""
JAX_CHANNEL = {
    "kinematic_viscosity": 100.0,
    "gravity": (1000.0, 0.0),
    "sound_speed": 12.5,
    "end_time": 0.005,
    "background_pressure": 781.25,
}
"""As in JAX-SPH's tests/test_pf2d.py: Re = 0.0125, so that no particle moves by a spacing."""


def start_up(scene):
    """Times [s] at which nu t / d^2 is 0.05, 0.1 and 0.5."""
    return np.array([0.05, 0.1, 0.5]) / scene.kinematic_viscosity


CASES = {
    "free_fall": Case("free_fall", (0.2, 0.1), lambda scene: [0.3], fall_error),
    "elliptical_drop": Case("elliptical_drop", (0.1, 0.05), parts(8), drop_errors(0.0)),
    "oscillating_drop": Case("oscillating_drop", (0.1, 0.05), parts(8), drop_errors(1.0)),
    "oscillating_drop_trixi": Case(
        "oscillating_drop",
        (0.1, 0.05),
        parts(8),
        drop_errors(1.0),
        TRIXI_DROP,
        {"axes at the end": "2e-4 at 0.05"},
        False,
    ),
    "hydrostatic_column": Case(
        "hydrostatic_column",
        (0.1, 0.05),
        parts(8, 0.5),
        pressure_error,
        {"end_time": 1.5},
        {"pressure": "4.5e-2 at 0.05"},
    ),
    "hydrostatic_summation": Case(
        "hydrostatic_column",
        (0.1, 0.05),
        parts(8, 0.5),
        pressure_error,
        {"end_time": 1.5, "density": "summation"},
        {"pressure": "4.5e-2 at 0.05"},
        False,
    ),
    "taylor_green": Case("taylor_green", (0.05, 0.025), parts(4), vortex_errors),
    "torricelli": Case("torricelli", (0.03, 0.02), parts(4, 0.25), jet_errors),
    "poiseuille": Case("poiseuille", (0.1, 0.05), start_up, poiseuille_errors),
    "poiseuille_jax": Case(
        "poiseuille",
        (1 / 15, 1 / 30),
        start_up,
        poiseuille_errors,
        JAX_CHANNEL,
        {"velocity, largest": "8e-3 at 1/30"},
        False,
    ),
    "standing_wave": Case("standing_wave", (0.05, 0.025), parts(52), wave_errors, {"end_time": 1.3}),
    "martin_moyce": Case(
        "martin_moyce", (A / 8, A / 12), lambda scene: np.union1d(FRONT_TIMES, HEIGHT_TIMES), martin_moyce_errors
    ),
    "koshizuka_oka": Case(
        "koshizuka_oka",
        (L / 16, L / 32),
        lambda scene: KOSHIZUKA_TIMES,
        front_errors(measured.KOSHIZUKA_OKA_FRONT, KOSHIZUKA_TIMES, L),
    ),
}
