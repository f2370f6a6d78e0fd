"""What the rounding of positions costs: python studies/domain_size.py (CPU, f32).

A still pool of 32 x 16 particles lies at the far end of a domain so long that single precision rounds positions there by a
given share of the spacing. Prints its rms speed over sqrt(gH) from 2 to 3 s, when it has all but settled.
"""

import math

import numpy as np

import taichi_rts as rts
from taichi_rts.assembly import resources

SPACING, DEPTH, GRAVITY = 1 / 32, 0.5, 9.81
SHARES = (0.0, 0.0001, 0.00025, 0.0005, 0.001, 0.002, 0.005, 0.009)


def pool(length: float) -> rts.Scene:
    """The pool behind a wall, in a domain of `length` [m]."""
    wall = rts.BoxObstacle((length - 1 - 8 * SPACING, 0), (length - 1, 1))
    return rts.Scene(
        domain=rts.Box((0, 0), (length, 1)),
        fluids=[rts.Block((length - 1, 0), (length, DEPTH))],
        obstacles=[wall],
        spacing=SPACING,
        sound_speed=10.0 * math.sqrt(2.0 * GRAVITY * DEPTH),
        end_time=3.0,
    )


def rms_speed(sim: rts.Simulation) -> float:
    """Over sqrt(gH), of eleven moments."""
    squares = []
    for time in np.linspace(2.0, 3.0, 11):
        sim.advance_to(float(time))
        squares.append((sim.velocities().astype(float) ** 2).sum(axis=1).mean())
    return math.sqrt(np.mean(squares) / (GRAVITY * DEPTH))


def main() -> None:
    """Print a row for each share."""
    rts.init("cpu", "f32")
    resources.FINEST_POSITION = 1.0  # so that nothing is refused
    print("| rounding over spacing | domain [m] | uniform | regional |\n|---|---|---|---|")
    for share in SHARES:
        length = max(2.0, round(share * SPACING / resources.SINGLE))
        speeds = [rms_speed(rts.Simulation(pool(length), stepper)) for stepper in (rts.Uniform(), rts.Regional())]
        print(f"| {share:.3%} | {length:g} | {speeds[0]:.4f} | {speeds[1]:.4f} |", flush=True)


if __name__ == "__main__":
    main()
