"""A still pool at wide supports, for docs/evidence/validation.md: python studies/wide_supports.py."""

import sys
from pathlib import Path

import numpy as np

import taichi_rts as rts
from taichi_rts.device.backend import ti

sys.path.append(str(Path(__file__).parents[1] / "tests" / "validation"))
from test_wide_supports import CALM, DEPTH, SPACING, rest

POOLS = [
    ("summation", "cubic_spline", 2.0),
    ("summation", "cubic_spline", 2.6),
    ("summation", "wendland_c2", 3.0),
    ("summation", "wendland_c2", 4.0),
    ("continuity", "cubic_spline", 2.0),
    ("continuity", "cubic_spline", 2.6),
    ("continuity", "wendland_c2", 3.0),
    ("continuity", "wendland_c2", 4.0),
]
END = 1.5  # [s]

if __name__ == "__main__":
    print("| density, kernel, r/s | stops, speed, depth |\n|---|---|")
    for density, kernel, ratio in POOLS:
        rts.init("cpu", "f32", restart=True)
        sim = rest(3, ratio, kernel, density, END)
        x, v, stopped = sim.positions(), sim.velocities().astype(float), sim.statistics["stopped_by_domain"]
        speed = np.sqrt((v**2).sum(axis=1).mean()) / CALM
        top = (np.sort(x[:, 1])[-len(x) // 16 :].mean() + 0.5 * SPACING) / DEPTH
        print(f"| {density}, {kernel}, {ratio:g} | {stopped:,}, {speed:.3f}, {top:.2f} |", flush=True)
        ti.reset()
