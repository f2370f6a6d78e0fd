"""Errors and updates of `Regional` against uniform steps of 0.1 r/c_s, scene by scene: a table of docs/evidence/defaults.md.

python studies/schedule.py [SCENE:PARTICLES ...], about 10 minutes on 2 cores. It uses public names only, so it also runs in a
worktree of another commit (PYTHONPATH), whose schedule is to be compared.
"""

import sys

import numpy as np
from tables import head, row

import taichi_rts as rts

SCENES = ("double_dam_break:3k", "dam_break_drop:3k", "projectile:6k", "martin_moyce:3k")
LOOKS = 40


def run(scene, stepper):
    """Centre of mass [m], (LOOKS, dim), kinetic energy [J], (LOOKS,), largest density over rest and updates."""
    sim, centres, kinetic, density = rts.Simulation(scene, stepper), [], [], 0.0
    for time in np.linspace(0.0, scene.end_time, LOOKS + 1)[1:]:
        sim.advance_to(time)
        centres.append(sim.positions().mean(axis=0))
        kinetic.append(sim.energy().kinetic)
        density = max(density, float(sim.densities().max()) / scene.rest_density)
    return np.array(centres), np.array(kinetic), density, sim.statistics["particle_updates"]


def rms(one, other):
    """Root of the mean square of a difference."""
    return float(np.sqrt(np.mean((one - other) ** 2)))


def main():
    """Print the table."""
    rts.init("cpu", "f32")
    head("scene, particles", "stepper", "updates [M]", "centre of mass", "kinetic energy", "largest density")
    for given in sys.argv[1:] or SCENES:
        name, particles = given.split(":")
        scene = rts.load_scene(name, particles=particles)
        centres, kinetic, density, _ = run(scene, rts.Uniform(courant=0.1))
        row(given, "uniform 0.1 (reference)", "", "", "", f"{density:.3f}")
        for label, sound, stepper in (
            ("regional", None, rts.Regional()),
            ("regional, 8 levels, integers", None, rts.Regional(levels=8, steps="integers")),
            ("regional, regional sound speed", "regional", rts.Regional()),
            ("regional, paper", None, rts.Regional(preset="paper")),
        ):
            found = run(scene.replace(sound_speed=sound) if sound else scene, stepper)
            errors = rms(found[0], centres) / np.ptp(centres[:, 1]), rms(found[1], kinetic) / kinetic.max()
            row(given, label, f"{found[3] / 1e6:.3f}", *(f"{each:.2%}" for each in errors), f"{found[2]:.3f}")


if __name__ == "__main__":
    main()
