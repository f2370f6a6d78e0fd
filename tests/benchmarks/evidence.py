"""Measures what the defaults rest on and prints the tables of docs/defaults.md: python tests/benchmarks/evidence.py [part ...].

Parts: pool, dam, walls, front. All of it takes about 15 minutes on 2 cores.
"""

import sys
from pathlib import Path

import numpy as np

import taichi_rts as rts
from taichi_rts import sampling

sys.path.append(str(Path(__file__).parents[1] / "validation"))
from experiments import MARTIN_MOYCE_A, MARTIN_MOYCE_FRONT
from experiments import front as front_of

STEPPERS = {
    "uniform 0.4": rts.Uniform(),
    "uniform 0.6": rts.Uniform(courant=0.6),
    "uniform 0.7": rts.Uniform(courant=0.7),
    "uniform 0.8": rts.Uniform(courant=0.8),
    "regional, defaults": rts.Regional(),
    "regional, 2 levels at 0.3": rts.Regional(courant=0.3),
    "regional, paper": rts.Regional(preset="paper"),
    "regional, paper, lambda_f 0.25": rts.Regional(preset="paper", lambda_f=0.25),
}


def pool(stepper):
    """Return rms speed over sqrt(gH) at 3, 4 and 5 s, and the depth over H."""
    scene = rts.load_scene("still_pool")
    sim, speeds = rts.Simulation(scene, stepper), []
    for time in (3.0, 4.0, 5.0):
        sim.advance_to(time)
        speeds.append(np.sqrt((sim.velocities() ** 2).sum(axis=1).mean() / (9.81 * 0.5)))
    return *speeds, 2.0 * sim.positions()[:, 1].mean() / 0.5


def dam(stepper, spacing=0.05, end=1.5):
    """Return largest speed, density over rest and energy over start, active fraction and centres stopped."""
    sim = rts.Simulation(rts.load_scene("double_dam_break", spacing=spacing), stepper)
    start, worst = sim.energy().total, np.zeros(3)
    for time in np.linspace(0.02, end, round(end / 0.02)):
        sim.advance_to(time)
        speed = np.linalg.norm(sim.velocities(), axis=1).max()
        worst = np.maximum(worst, (speed, sim.densities().max() / 1000.0, sim.energy().total / start))
    return *worst, sim.statistics["active_fraction"], sim.statistics["stopped_by_domain"]


def front(stepper):
    """Return mean and signed relative error of the front against Martin & Moyce, and the active fraction."""
    errors = []
    sim = rts.Simulation(rts.load_scene("martin_moyce"), stepper)
    for time, place in MARTIN_MOYCE_FRONT:
        sim.advance_to(time / np.sqrt(2 * 9.81 / MARTIN_MOYCE_A))
        errors.append(front_of(sim.positions()) / MARTIN_MOYCE_A / place - 1.0)
    return np.abs(errors).mean(), np.mean(errors), sim.statistics["active_fraction"]


def walls():
    """Print still pool and double dam break for three wall stiffnesses."""
    default = sampling.WALL_STIFFNESS
    for stiffness in (1.0, default, 2.0):
        sampling.WALL_STIFFNESS = stiffness
        show(f"walls {stiffness:.2f}: pool", pool(rts.Uniform()))
        for courant in (0.4, 0.6):
            show(f"walls {stiffness:.2f}: dam, uniform {courant}", dam(rts.Uniform(courant=courant)))
    sampling.WALL_STIFFNESS = default


def show(name, values):
    """Print one row."""
    print(f"{name:45s}", *(f"{value:10.4g}" for value in values), flush=True)


if __name__ == "__main__":
    rts.init("cpu")
    parts = sys.argv[1:] or ["pool", "dam", "front", "walls"]
    for part in parts:
        print(f"# {part}")
        if part == "walls":
            walls()
        else:
            for label, choice in STEPPERS.items():
                show(label, {"pool": pool, "dam": dam, "front": front}[part](choice))
