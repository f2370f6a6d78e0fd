"""Measures the asynchronous stepper beside the others and prints the tables of docs/evidence/asynchronous.md.

python studies/asynchronous.py [checks|projectile|front|momentum|speed ...] takes about 25 minutes on 2 cores.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from tables import head, row

import taichi_rts as rts

sys.path.append(str(Path(__file__).parents[1] / "tests" / "validation"))
from experiments import MARTIN_MOYCE_A, MARTIN_MOYCE_FRONT
from experiments import front as front_of

STEPPERS = {
    "uniform 0.4": rts.Uniform(),
    "regional": rts.Regional(),
    "regional, paper": rts.Regional(preset="paper"),
    "asynchronous": rts.Asynchronous(),
    "asynchronous, integers": rts.Asynchronous(steps="integers"),
    "asynchronous, integers, random ages": rts.Asynchronous(steps="integers", stagger=1),
    "asynchronous, 0.8 in 16 levels": rts.Asynchronous(courant=0.8, levels=16),
}
SECTION_THREADS = "TAICHI_RTS_THREADS"


def checks():
    """Whole double dam breaks in debug mode: no extrapolation, and some cell steps in every pass."""
    scene = rts.load_scene("double_dam_break", spacing=0.045)
    head("stepper", "passes", "cells per pass (min, median, max)", "extrapolations", "updates / uniform's at a tick")
    for stepper in (
        rts.Asynchronous(),
        rts.Asynchronous(stagger=1),
        rts.Asynchronous(steps="integers", stagger=1),
        rts.Asynchronous(courant=0.8, levels=16, stagger=1),
    ):
        sim = rts.Simulation(scene, stepper, debug=True)
        sim.advance_to(scene.end_time)
        seen, width = sim.statistics, sim.statistics["cells_per_pass"]
        name = f"{stepper.steps}, courant {stepper.longest_courant}, " + (
            "random ages" if stepper.stagger else "in step"
        )
        cells = f"{width['min']}, {width['median']:.0f}, {width['max']}"
        row(name, seen["passes"], cells, seen["extrapolations"], f"{seen['active_fraction']:.3f}")


def projectile():
    """Kinetic energy over its start while a block at 0.5 c_s enters a pool, against a run at a very small step."""
    scene, times = rts.load_scene("projectile", spacing=0.05, sound_speed=40.0), (0.01, 0.02, 0.04, 0.06, 0.1)
    variants = {
        "uniform 0.8": rts.Uniform(courant=0.8),
        "uniform 0.6": rts.Uniform(courant=0.6),
        "uniform 0.4": rts.Uniform(),
        "uniform 0.2": rts.Uniform(courant=0.2),
        "uniform 0.1": rts.Uniform(courant=0.1),
        "uniform, adaptive": rts.Uniform(adaptive=True),
        "uniform, adaptive 0.2": rts.Uniform(courant=0.2, adaptive=True, lambda_f=0.1),
        "regional": rts.Regional(),
        "regional, limiter": rts.Regional(limiter=True),
        "regional, paper": rts.Regional(preset="paper"),
        "regional, 8 levels at 0.1": rts.Regional(levels=8, courant=0.1),
        "regional, 8 levels at 0.1, limiter off": rts.Regional(levels=8, courant=0.1, limiter=False),
        "asynchronous": rts.Asynchronous(),
        "asynchronous, limiter off": rts.Asynchronous(limiter=False),
        "asynchronous, lambda_f 0.03": rts.Asynchronous(lambda_f=0.03, levels=16),
        "asynchronous, integers": rts.Asynchronous(steps="integers", levels=16),
        "asynchronous, integers, stale densities": rts.Asynchronous(
            steps="integers", levels=16, inactive_density="stale"
        ),
        "asynchronous, 0.8 in 16 levels": rts.Asynchronous(courant=0.8, levels=16),
        "asynchronous, 0.8 in 16 levels, limiter off": rts.Asynchronous(courant=0.8, levels=16, limiter=False),
    }

    def run(stepper):
        sim = rts.Simulation(scene, stepper)
        start, found = sim.energy().kinetic, []
        for time in times:
            sim.advance_to(time)
            found.append(sim.energy().kinetic / start)
        return np.array(found), sim.statistics

    reference, _ = run(rts.Uniform(courant=0.025))
    head("stepper", *(f"t = {time:g} s" for time in times), "largest error", "updates [M]", "woken", "blown up")
    row("uniform 0.025 (reference)", *(f"{value:.4f}" for value in reference), "", "", "", "")
    for name, stepper in variants.items():
        found, seen = run(stepper)
        error = np.abs(found / reference - 1).max()
        work, woken = f"{seen['particle_updates'] / 1e6:.3f}", seen.get("wakes", "")
        row(
            name, *(f"{value:.4f}" for value in found), f"{error:.2%}", work, woken, "yes" if seen["runaways"] else "no"
        )


def front():
    """Front of Martin & Moyce's dam break: mean relative error."""
    head("stepper", "mean error", "signed", "updates [M]")
    for name, stepper in STEPPERS.items():
        errors = []
        sim = rts.Simulation(rts.load_scene("martin_moyce"), stepper)
        for time, place in MARTIN_MOYCE_FRONT:
            sim.advance_to(time / np.sqrt(2 * 9.81 / MARTIN_MOYCE_A))
            errors.append(front_of(sim.positions()) / MARTIN_MOYCE_A / place - 1.0)
        work = f"{sim.statistics['particle_updates'] / 1e6:.2f}"
        row(name, f"{np.abs(errors).mean():.2%}", f"{np.mean(errors):+.2%}", work)


def momentum():
    """Momentum that neither gravity nor walls account for, after 1 s of a double dam break, over mass x sqrt(gH)."""
    scene = rts.load_scene("double_dam_break", spacing=0.05)
    head("stepper", "x", "y", "z")
    for name, stepper in STEPPERS.items():
        sim = rts.Simulation(scene, stepper, debug=True)
        sim.advance_to(1.0)
        drift = sim.momentum_drift() / (sim.medium.mass * sim.count * np.sqrt(9.81))
        row(name, *(f"{value:+.1e}" for value in drift))


SPEED = {
    "double_dam_break": (0.34, 0.40, {"spacing": 0.04}),
    "projectile": (0.0, 0.02, {"spacing": 0.03, "sound_speed": 40.0}),
}
SPEED_STEPPERS = {"uniform at the smallest cell step": rts.Uniform(courant=0.05)} | STEPPERS


def speed():
    """Updates and wall time of a window of two scenes, on one thread and on two; each in a process of its own."""
    for threads in (1, 2):
        environment = os.environ | {SECTION_THREADS: str(threads)}
        subprocess.run([sys.executable, __file__, "_speed"], env=environment, check=True)


def _speed():
    for name, (start, end, changes) in SPEED.items():
        scene = rts.load_scene(name, **changes)
        print(f"\n{name}, t = {start:g} to {end:g} s, {os.environ[SECTION_THREADS]} thread(s)\n")
        head(
            "stepper",
            "updates [M]",
            "saved",
            "wall [s]",
            "us per update",
            "passes",
            "cells per pass (median)",
            "wall / uniform 0.4",
        )
        rows, walls = [], {}
        for label, stepper in SPEED_STEPPERS.items():
            sim = rts.Simulation(scene, stepper)
            share = 0.1 if "smallest" in label else 1.0  # a part of its window, scaled
            begin = start if share == 1.0 else 0.0
            sim.advance_to(begin)
            before = sim.statistics
            seen = len(getattr(sim.schedule, "seen_widths", []))
            sim.advance_to(begin + share * (end - start))
            after = sim.statistics
            updates = (after["particle_updates"] - before["particle_updates"]) / share
            walls[label] = (after["wall_seconds"] - before["wall_seconds"]) / share
            passes = after.get("passes", after["base_steps"]) - before.get("passes", before["base_steps"])
            widths = getattr(sim.schedule, "seen_widths", None)
            width = f"{np.median(np.concatenate(widths[seen:])):.0f}" if widths else ""
            rows.append((label, updates, walls[label], passes, width))
        most, best = rows[0][1], walls["uniform 0.4"]
        for label, updates, wall, passes, width in rows:
            saved, cost = f"{1 - updates / most:.1%}", f"{1e6 * wall / updates:.2f}"
            row(label, f"{updates / 1e6:.2f}", saved, f"{wall:.1f}", cost, passes, width, f"{wall / best:.2f}")


PARTS = {part.__name__: part for part in (checks, projectile, front, momentum, speed, _speed)}

if __name__ == "__main__":
    count = os.environ.get(SECTION_THREADS)
    rts.init("cpu", **({"cpu_max_num_threads": int(count)} if count else {}))
    for part in sys.argv[1:] or list(PARTS)[:-1]:
        if not part.startswith("_"):
            print(f"\n# {part}\n", flush=True)
        PARTS[part]()
