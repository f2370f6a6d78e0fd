"""The table of docs/evidence/splishsplash.md: which of SPlisHSPlasH's own scenes load and run, and how many particles they have.

pip install pysplishsplash==2.19.0; python studies/splishsplash_scenes.py [NAME ...]

Each scene is loaded and runs five uniform steps. Beside our counts of particles stand those that SPlisHSPlasH
makes of the same file (splishsplash_counts.py). Walls are the domain's and its container's, obstacles all other bodies.
"""

import json
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import tables

import taichi_rts as rts
from taichi_rts.sampling.sampling import sample

SCENES = Path(sys.prefix) / "bin" / "data" / "Scenes"
STEPS = 5
MOST = 200_000  # fluid particles of a run
TIMEOUT = 120.0  # [s], of a count there
SYSTEM_GLX = Path("/lib/x86_64-linux-gnu/libGLX.so.0")
COLUMNS = (
    "scene",
    "loads",
    "runs",
    "fluid",
    "theirs",
    "walls",
    "theirs",
    "obstacles",
    "theirs",
    "base step / their largest [ms]",
)


def theirs(path: Path) -> tuple[str, str, str]:
    """Return fluid, wall and obstacle particles that SPlisHSPlasH makes of a scene, "-" where it makes none in time."""
    script = Path(__file__).with_name("splishsplash_counts.py")
    extra = {"LD_PRELOAD": str(SYSTEM_GLX)} if SYSTEM_GLX.exists() else {}
    try:
        result = subprocess.run(
            [sys.executable, script, path], capture_output=True, text=True, timeout=TIMEOUT, env=os.environ | extra
        )
    except subprocess.TimeoutExpired:
        return "-", "-", "-"
    found = [line for line in result.stdout.splitlines() if line.startswith("COUNTS ")]
    if not found:
        return "-", "-", "-"
    counts = json.loads(found[0].removeprefix("COUNTS "))
    bodies = json.loads(path.read_text()).get("RigidBodies", [])
    container = [bool(body.get("isWall") or body.get("mapInvert")) for body in bodies]
    sums = [
        sum(n for n, holds in zip(counts["bodies"], container, strict=False) if holds == which)
        for which in (True, False)
    ]
    return f"{counts['fluid']:,}", *(f"{n:,}" for n in sums)


def largest_step(path: Path) -> float:
    """Return the largest step [ms] that the file allows."""
    given = json.loads(path.read_text()).get("Configuration", {})
    key = "timeStepSize" if given.get("cflMethod", 1) == 0 else "cflMaxTimeStepSize"
    return 1e3 * given.get(key, 0.005)


def ours(path: Path) -> Iterator[str]:
    """Yield whether a scene loads and runs, its numbers of fluid, wall and obstacle particles, and its base step [ms]."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = rts.load_scene(path)
        start = sample(scene)
    except rts.Error as error:
        yield from (f"no: {str(error).rpartition(': ')[2]}", "-", "-", "-", "-", "-")
        return
    yield "yes"
    count = len(start.positions)
    if count > MOST:
        runs, step = f"not tried: more than {MOST:,}", "-"
    else:
        rts.init("cpu", restart=True, advanced_optimization=False)  # a few steps need no fast kernels
        sim = rts.Simulation(scene, rts.Uniform())
        sim.advance_to(STEPS * sim.base_step)
        sane = np.isfinite(sim.positions()).all() and sim.statistics["runaways"] == 0
        runs, step = "yes" if sane else "blows up", f"{1e3 * sim.base_step:.3g}"
    yield from (runs, f"{count:,}", f"{len(start.walls.positions):,}")
    yield f"{sum(len(layer.positions) for layer in start.obstacles):,}"
    yield step


def main(names: list[str]) -> None:
    """Print the table."""
    tables.head(*COLUMNS)
    for path in sorted(SCENES.glob("*.json")):
        if names and path.stem not in names:
            continue
        loads, runs, fluid, walls, obstacles, step = ours(path)
        there = theirs(path)
        tables.row(
            path.stem,
            loads,
            runs,
            fluid,
            there[0],
            walls,
            there[1],
            obstacles,
            there[2],
            f"{step} / {largest_step(path):g}",
        )


if __name__ == "__main__":
    main(sys.argv[1:])
