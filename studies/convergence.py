"""Error of every stepper against its step, on two drops with a free surface: prints the tables of docs/evidence/asynchronous.md.

python studies/convergence.py [elliptical_drop|oscillating_drop ...] takes about 5 minutes on 2 cores.

The step is that of the calmest region, and all criteria shrink with it, so that steps differ between cells in the same
places. lambda_f is far smaller than the default here, because at the default all cells of these drops take the longest step.

The reference is the same particles in double precision at a step 64 times smaller than the largest tested; the error is
the relative L2 norm of the velocities and of the displacements at matched ids, its order that between the largest and the
smallest step. Beside it the error of the long semi-axis
against the exact solution, which is that of the particles, not of the step.
"""

import sys
from pathlib import Path

import numpy as np

import taichi_rts as rts

sys.path.append(str(Path(__file__).parents[1] / "tests" / "validation"))
from exact import drop_axes

COURANTS = (0.4, 0.2, 0.1, 0.05)
SMALLEST = 0.4 / 64
DROPS = {"elliptical_drop": (0.1, 0.004, (-100.0,)), "oscillating_drop": (0.1, 0.3, (0.5, 1.0))}
"""Spacing [m], end time [s], arguments of the exact solution."""


def regional(courant, **options):
    """Three levels, the longest step at `courant`, with all criteria scaled by it, so that the regions stay the same."""
    return rts.Regional(courant=courant / 3, levels=3, alpha=courant / 2, lambda_f=courant / 32, **options)


STEPPERS = {
    "uniform, serna": lambda courant: rts.Uniform(courant=courant),
    "uniform, symplectic euler": lambda courant: rts.Uniform(courant=courant, integrator="symplectic_euler"),
    "regional, 3 levels": lambda courant: regional(courant),
    "regional, 3 levels, extrapolated densities": lambda courant: regional(courant, inactive_density="extrapolated"),
    "asynchronous, powers of two": lambda courant: rts.Asynchronous(courant=courant, lambda_f=courant / 32),
    "the same, stale densities": lambda courant: rts.Asynchronous(
        courant=courant, lambda_f=courant / 32, inactive_density="stale"
    ),
    "asynchronous, integers, random ages": lambda courant: rts.Asynchronous(
        courant=courant, lambda_f=courant / 8, steps="integers", stagger=1
    ),
    "the same, stale densities ": lambda courant: rts.Asynchronous(
        courant=courant, lambda_f=courant / 8, steps="integers", stagger=1, inactive_density="stale"
    ),
}


def run(scene, stepper, end_time):
    """Return displacements and velocities at `end_time`, the long semi-axis, and the work."""
    sim = rts.Simulation(scene, stepper)
    start = sim.positions()
    sim.advance_to(end_time)
    x = sim.positions()
    return x - start, sim.velocities(), 2.0 * np.sqrt((x**2).mean(axis=0)).max(), sim.statistics


def distance(one, two):
    """Relative L2 norm of the difference of two arrays."""
    return float(np.linalg.norm(one - two) / np.linalg.norm(two))


def table(name):
    """Print the table of one drop."""
    spacing, end_time, exact = DROPS[name]
    scene = rts.load_scene(name, spacing=spacing)
    axis = max(float(side[-1]) for side in drop_axes(np.array([end_time]), *exact))
    reference, coarser = (run(scene, rts.Uniform(courant=c), end_time) for c in (SMALLEST, 2 * SMALLEST))
    print(f"\n{name}, {len(reference[0])} particles, t = {end_time:g} s; v of the reference is known to", end=" ")
    print(f"{distance(coarser[1], reference[1]):.1e}\n")
    print("| stepper | " + " | ".join(f"λ = {c:g}" for c in COURANTS) + " | order | x, order | axis | updates |")
    print("|---|" + "---|" * (len(COURANTS) + 4))
    for label, make in STEPPERS.items():
        found = [run(scene, make(c), end_time) for c in COURANTS]
        v = [distance(result[1], reference[1]) for result in found]
        x = [distance(result[0], reference[0]) for result in found]
        orders = [np.log2(e[0] / e[-1]) / (len(COURANTS) - 1) for e in (v, x)]
        cells = [label, *(f"{e:.1e}" for e in v), f"{orders[0]:.2f}", f"{orders[1]:.2f}"]
        work = found[0][3]["particle_updates"] / len(reference[0])
        print("| " + " | ".join([*cells, f"{found[0][2] / axis - 1:+.2%}", f"{work:.0f}"]) + " |", flush=True)


if __name__ == "__main__":
    rts.init("cpu", "f64")
    for drop in sys.argv[1:] or DROPS:
        table(drop)
