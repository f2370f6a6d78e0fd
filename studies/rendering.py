"""The table of docs/evidence/speed.md: time and memory of pictures of many particles; nothing is simulated.

python studies/rendering.py [PARTICLES [REPEATS [ARCH]]]
"""

import resource
import sys
import time

import numpy as np
from tables import head, row

import taichi_rts as rts
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.colours import scalar_colours
from taichi_rts.rendering.splatter import Splatter

LOWER, UPPER = (0.0, 0.0, 0.0), (3.0, 1.6, 1.0)
FRAMES = 10


def dam(count):
    """Positions [m], (about `count`, 3), of a shaken dam of 2 x 1 x 1 m in random order, and its spacing [m]."""
    rows = round((count / 2) ** (1 / 3))
    spacing = 1.0 / rows
    random = np.random.default_rng(1)
    places = np.stack(np.meshgrid(*(np.arange(n) for n in (2 * rows, rows, rows)), indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    x = (places + 0.5 + random.uniform(-0.2, 0.2, places.shape)) * spacing
    return random.permutation(x).astype(np.float32), spacing


def splash(count):
    """The same number of particles all over the box: fewer of them hide others."""
    x, spacing = dam(count)
    return np.random.default_rng(2).uniform(LOWER, UPPER, x.shape).astype(np.float32), spacing


def measure(positions, spacing, width, height, quality, repeats):
    """Wall and processor time [s] of FRAMES frames: the best of `repeats`."""
    splatter, camera = Splatter(width, height, quality=quality), Camera.framing(LOWER, UPPER)
    times = []
    for _ in range(repeats + 1):
        began = time.perf_counter(), time.process_time()
        for frame in range(FRAMES):
            colours = scalar_colours(positions[:, 0] + 0.1 * frame, 0, 3)
            splatter.draw(positions, colours, 0.5 * spacing, camera, (LOWER, UPPER))
        times.append((time.perf_counter() - began[0], time.process_time() - began[1]))
    return np.min(times[1:], axis=0)


def main(count=1_000_000, repeats=3, arch="cpu"):
    rts.init(arch)
    head("particles", "pixels", "quality", f"{FRAMES} frames [s]", "processor time [s]", "memory so far [GB]")
    for name, make in (("dam", dam), ("splash", splash)):
        positions, spacing = make(count)
        sizes = [(1280, 720, "draft"), (1280, 720, "good"), (1280, 720, "best"), (3840, 2160, "good")]
        for width, height, quality in sizes if name == "dam" else sizes[1:2]:
            wall, busy = measure(positions, spacing, width, height, quality, repeats)
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
            cells = f"{name} {len(positions):,}", f"{width} x {height}", quality
            row(*cells, f"{wall:.1f}", f"{busy:.1f}", f"{memory:.1f}")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]), *sys.argv[3:4])
