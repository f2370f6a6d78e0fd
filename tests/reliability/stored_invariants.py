"""What runs of every scene gave when it was last found right, so that a change of the physics cannot go unseen.

`invariants.json` holds it; `python studies/invariants.py --write` writes it anew (docs/evidence/reliability.md).
"""

import json
from pathlib import Path

import numpy as np

import taichi_rts as rts
from taichi_rts.files.writing import write_bytes

STORED = Path(__file__).with_name("invariants.json")
STEPPERS = {"uniform": rts.Uniform(), "regional": rts.Regional(), "asynchronous": rts.Asynchronous()}
SAME = ("serna_ablation",)
"""Scenes that are another one with an earlier end."""
SAMPLES = 5
BASE_STEPS = 150
"""Base steps of `Uniform`: short enough that rounding, which grows from step to step, stays far below the tolerances."""
FLAT_PARTICLES, SOLID_PARTICLES = 400, 800
SPACINGS = {"water_jet": 0.1}
"""Where fewer particles would be coarser than an inflow."""

TOLERANCE = 0.01
"""Of what a quantity changes within the run. Forces that are 5 % too large change each scene by more
(tests/reliability/test_invariants.py)."""
SHARE_TOLERANCE = 0.02
"""Of shares of particles and updates per level."""
ROUNDING = 1e-6
"""Over the largest value that a quantity has, for what hardly changes."""


def names():
    """Names of the scenes."""
    return [name for name in rts.scene_names() if name not in SAME]


def small(name):
    """Return a scene with few particles."""
    if name in SPACINGS:
        return rts.load_scene(name, spacing=SPACINGS[name])
    particles = FLAT_PARTICLES if rts.load_scene(name).dim == 2 else SOLID_PARTICLES
    return rts.load_scene(name, particles=particles)


def measure(scene, stepper):
    """Run a scene; return the curves of its invariants, a value at each time, and its shares of work."""
    end_time = min(scene.end_time, BASE_STEPS * rts.Uniform().timeline(scene).tick)
    sim = rts.Simulation(scene.replace(end_time=end_time), STEPPERS[stepper])
    curves = {}
    for time in np.linspace(0.0, end_time, SAMPLES):
        sim.advance_to(time)
        x, v, rho, _level = (values.astype(np.float64) for values in sim.state())
        seen = sim.energy()._asdict()
        seen |= {"largest speed": np.linalg.norm(v, axis=1).max(), "largest density": rho.max(), "particles": sim.count}
        seen |= {f"centre of mass {axis}": value for axis, value in zip("xyz", x.mean(axis=0), strict=False)}
        for key, value in seen.items():
            curves.setdefault(key, []).append(rounded(value))
    counts = sim.statistics
    shares = {"active": [rounded(counts["active_fraction"])], "levels": [*map(rounded, counts["level_fractions"])]}
    return {"end_time": end_time, "particles": sim.count, "curves": curves, "shares": shares}


def differences(found, stored):
    """List what is further apart than the tolerances, in words."""
    said = []
    for key in ("end_time", "particles"):
        if abs(found[key] - stored[key]) > ROUNDING * stored[key]:
            said.append(f"{key}: {found[key]:g} was {stored[key]:g}")
    for key, values in stored["curves"].items():
        was, now = np.array(values), np.array(found["curves"][key])
        scale = np.abs(was).max() + (1.0 if key.startswith("centre") else 0.0)  # scenes are about a metre large
        allowed = TOLERANCE * np.ptp(was) + ROUNDING * scale
        if not (np.abs(now - was) <= allowed).all():
            worst = np.abs(now - was).argmax()
            said.append(f"{key}: {now[worst]:.6g} was {was[worst]:.6g} at sample {worst}, {allowed:.2g} is allowed")
    for key, values in stored["shares"].items():
        was, now = np.array(values), np.array(found["shares"][key])
        if was.shape != now.shape or np.abs(now - was).max() > SHARE_TOLERANCE:
            said.append(f"share of {key}: {now.round(4).tolist()} was {was.round(4).tolist()}")
    return said


def rounded(value):
    """A number to nine digits, a thousand times finer than any tolerance."""
    return float(f"{value:.9g}")


def read():
    """Return what is stored, by "scene stepper"; nothing if there is no file."""
    return json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}


def write(kept):
    """Store `kept`, a line for each run."""
    lines = ",\n".join(f"{json.dumps(key)}: {json.dumps(kept[key])}" for key in sorted(kept))
    write_bytes(STORED, f"{{\n{lines}\n}}\n".encode())
