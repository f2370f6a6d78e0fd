"""Still pools whose width or depth is no multiple of the spacing: the table of docs/evidence/reliability.md.

python studies/fitted_pools.py [--only 20.5x10,5.49x10]: two-dimensional pools, sizes in spacings, of both formulations of
density, for 1 s from a hydrostatic start; about 5 minutes on 2 cores.
"""

import argparse

import numpy as np
from tables import head, row

import taichi_rts as rts
from taichi_rts.sampling.filling import filling

SPACING = 0.05
SIZES = "20x10,20.5x10,20x10.5,10.49x10.49,5.49x10,5.51x10,3.5x10,2.5x10,1.6x10"
COLUMNS = (
    "size [spacings]",
    "density",
    "rows [spacings]",
    "water kept",
    "largest speed",
    "speed at the end",
    "centre of mass",
)


def pool(width, depth, density):
    """A tank that water fills from wall to wall, half full."""
    size = width * SPACING, depth * SPACING
    return rts.Scene(
        domain=rts.Box((0, 0), (size[0], 2 * size[1])),
        fluids=[rts.Block((0, 0), size)],
        spacing=SPACING,
        density=density,
        hydrostatic=True,
        end_time=1.0,
    )


def measure(scene):
    """Water kept, largest and last rms speed over sqrt(g H), and the height of the centre of mass over H/2."""
    sim = rts.Simulation(scene)
    depth = scene.fluids[0].upper[1]
    calm = np.sqrt(9.81 * depth)
    largest, last, height = 0.0, [], []
    for time in np.linspace(0.05, scene.end_time, 20):
        sim.advance_to(time)
        speed = np.linalg.norm(sim.velocities(), axis=1)
        largest = max(largest, float(speed.max()))
        last.append(np.sqrt((speed**2).mean()))
        height.append(sim.positions()[:, 1].mean())
    return 1.0 + filling(scene).gain, largest / calm, np.mean(last[-5:]) / calm, np.mean(height[-5:]) / (0.5 * depth)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=SIZES, help="sizes, parted by commas")
    options = parser.parse_args()
    head(*COLUMNS)
    for size in options.only.split(","):
        for density in ("summation", "continuity"):
            rts.init("cpu", "f32", restart=True)
            scene = pool(*map(float, size.split("x")), density)
            kept, largest, last, height = measure(scene)
            steps = " x ".join(f"{step / SPACING:.3g}" for step in filling(scene).steps)
            row(size, density, steps, f"{kept:.1%}", f"{largest:.3f}", f"{last:.4f}", f"{height:.3f}")


if __name__ == "__main__":
    main()
