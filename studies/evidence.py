"""Measures what the defaults rest on and prints the tables of docs/evidence/defaults.md: python studies/evidence.py [part ...].

Parts: pool, pools, dam, walls, front. All of it takes about 20 minutes on 2 cores.
"""

import sys
from pathlib import Path

import numpy as np

import taichi_rts as rts
from taichi_rts.sampling import walls as sampling_walls

sys.path.append(str(Path(__file__).parents[1] / "tests" / "validation"))
from experiments import MARTIN_MOYCE_A, MARTIN_MOYCE_FRONT
from experiments import front as front_of

STEPPERS = {
    "uniform 0.4": rts.Uniform(),
    "uniform 0.6": rts.Uniform(courant=0.6),
    "uniform 0.7": rts.Uniform(courant=0.7),
    "uniform 0.8": rts.Uniform(courant=0.8),
    "regional, defaults": rts.Regional(),
    "regional, longest step 0.4": rts.Regional(courant=0.4 / 3),
    "regional, 2 levels": rts.Regional(levels=2),
    "regional, paper": rts.Regional(preset="paper"),
    "regional, paper, aligned": rts.Regional(preset="paper", steps="half_octaves"),
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


POOLS = {
    "still_pool, 4000": (rts.load_scene("still_pool"), 0.5),
    "still_pool, 500": (rts.load_scene("still_pool", spacing=0.1), 0.5),
    "2D, 1250": (rts.Scene(domain=rts.Box((0, 0), (1, 1)), fluids=[rts.Block((0, 0), (1, 0.5))], spacing=0.02), 0.5),
    "2D, 500": (rts.Scene(domain=rts.Box((0, 0), (2, 1)), fluids=[rts.Block((0, 0), (2, 0.4))], spacing=0.04), 0.4),
    "3D, 2016": (
        rts.Scene(
            domain=rts.Box((0, 0, 0), (0.6, 1, 0.6)), fluids=[rts.Block((0, 0, 0), (0.6, 0.7, 0.6))], spacing=0.05
        ),
        0.7,
    ),
    "3D, 1620": (
        rts.Scene(
            domain=rts.Box((0, 0, 0), (0.9, 1, 0.5)), fluids=[rts.Block((0, 0, 0), (0.9, 0.45, 0.5))], spacing=0.05
        ),
        0.45,
    ),
}


def pools(stepper):
    """Return rms speed over sqrt(gH) of each of `POOLS`, the mean of 31 looks from 2 to 5 s."""
    found = []
    for scene, depth in POOLS.values():
        sim, speeds = rts.Simulation(scene, stepper), []
        for time in np.linspace(2.0, 5.0, 31):
            sim.advance_to(time)
            speeds.append(np.sqrt((sim.velocities() ** 2).sum(axis=1).mean() / (9.81 * depth)))
        found.append(np.mean(speeds))
    return found


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
    default = sampling_walls.WALL_STIFFNESS
    for stiffness in (1.0, default, 2.0):
        sampling_walls.WALL_STIFFNESS = stiffness
        show(f"walls {stiffness:.2f}: pool", pool(rts.Uniform()))
        for courant in (0.4, 0.6):
            show(f"walls {stiffness:.2f}: dam, uniform {courant}", dam(rts.Uniform(courant=courant)))
    sampling_walls.WALL_STIFFNESS = default


def show(name, values):
    """Print one row."""
    print(f"{name:45s}", *(f"{value:10.4g}" for value in values), flush=True)


if __name__ == "__main__":
    rts.init("cpu")
    parts = sys.argv[1:] or ["pool", "pools", "dam", "front", "walls"]
    for part in parts:
        print(f"# {part}")
        if part == "walls":
            walls()
        else:
            for label, choice in STEPPERS.items():
                show(label, {"pool": pool, "pools": pools, "dam": dam, "front": front}[part](choice))
