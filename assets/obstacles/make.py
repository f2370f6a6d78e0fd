"""Writes the meshes of this folder: a ball (a subdivided icosahedron) and a wedge, in metres, standing on the floor."""

from pathlib import Path

import numpy as np
import trimesh

FOLDER = Path(__file__).parent


def save(name: str, mesh: trimesh.Trimesh) -> None:
    """Write an OBJ file of vertices and faces alone."""
    lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    (FOLDER / f"{name}.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")


ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
ball.apply_translation((0.0, 0.1, 0.0))
save("ball", ball)

# a ramp that rises from a sharp edge at x = 0 to 0.2 m at x = 0.4, 0.3 m wide
profile = np.array([(0.0, 0.0), (0.4, 0.0), (0.4, 0.2)])
corners = np.array([(x, y, z) for z in (-0.15, 0.15) for x, y in profile])
faces = [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)]
wedge = trimesh.Trimesh(corners, faces, process=False)
assert wedge.is_watertight
assert wedge.volume > 0
save("wedge", wedge)
