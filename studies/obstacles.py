"""The tables of docs/evidence/obstacles.md: how evenly wall particles lie, and which particles get into meshes in a dam break.

python studies/obstacles.py [END_TIME [SPACING]]
"""

import sys
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

import taichi_rts as rts
from taichi_rts.sampling.lining import line_solid
from taichi_rts.scene.obstacles.making import make_solid

MESHES = Path(__file__).parents[1] / "assets" / "obstacles"
S = 0.02
SHAPES = {
    "box": rts.BoxObstacle((0, 0, 0), (0.2, 0.3, 0.25)),
    "sphere": rts.SphereObstacle((0, 0, 0), 0.1),
    "cylinder": rts.CylinderObstacle((0, 0, 0), (0, 0.3, 0.1), 0.1),
    "mesh ball": rts.MeshObstacle(str(MESHES / "ball.obj")),
    "mesh wedge": rts.MeshObstacle(str(MESHES / "wedge.obj")),
}


def evenness():
    for name, shape in SHAPES.items():
        x, _ = line_solid(make_solid(shape, S), 0.75 * S, S)
        gap = cKDTree(x).query(x, k=2)[0][:, 1] / S
        print(f"| {name} | {len(x)} | {gap.mean():.2f} | {gap.std():.2f} | {gap.min():.2f} |")


def leaks(end, spacing):
    scene = rts.load_scene(MESHES / "dam_break_meshes.toml", spacing=spacing)
    scene = scene.replace(obstacles=scene.obstacles[:2])
    meshes = [trimesh.load_mesh(obstacle.file).apply_translation(obstacle.translation) for obstacle in scene.obstacles]
    for stepper in (rts.Uniform(), rts.Regional(), rts.Asynchronous()):
        rts.init("cpu", restart=True)
        sim = rts.Simulation(scene, stepper)
        inside, frames = 0, np.arange(1, round(20 * end) + 1) / 20
        for time in frames:
            sim.advance_to(time)
            x = sim.positions().astype(float)
            inside += sum(int(mesh.contains(x).sum()) for mesh in meshes)
        counts = {key: sim.statistics[key] for key in ("stopped_by_domain", "stopped_by_obstacles", "runaways")}
        print(f"{stepper.name}: {sim.count} particles, {inside} inside in {len(frames)} frames, {counts}", flush=True)


if __name__ == "__main__":
    evenness()
    leaks(*(float(word) for word in (sys.argv[1:] + ["2.0", "0.025"][len(sys.argv) - 1 :])))
