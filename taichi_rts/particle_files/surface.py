"""The water's surface as triangles in a PLY file, through pysplashsurf (extra `surface`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_rts.particle_files.frame import ParticleFrame
from taichi_rts.particle_files.ply import write_ply

SMOOTHING_LENGTH = 2.0
CUBE_SIZE = 0.75
THRESHOLD = 0.6
SMOOTHING_ITERATIONS = 15
"""What splashsurf advises for smooth water; lengths in particle radii, which are half a spacing."""


def write_surface(frame: ParticleFrame) -> bytes:
    """Return the surface around the particles of `frame`, three-dimensional, with the velocity at its corners."""
    import pysplashsurf  # only here, because it is an extra

    if frame.spacing is None:
        raise ValueError("a surface needs the particles' spacing")
    velocity = {name: frame.attributes[name] for name in ("velocity",) if name in frame.attributes}
    options: dict[str, Any] = {
        "attributes_to_interpolate": velocity,
        "particle_radius": 0.5 * frame.spacing,
        "smoothing_length": SMOOTHING_LENGTH,
        "cube_size": CUBE_SIZE,
        "iso_surface_threshold": THRESHOLD,
        "mesh_smoothing_iters": SMOOTHING_ITERATIONS,
        "mesh_cleanup": True,
        "decimate_barnacles": True,
        "multi_threading": True,
    }
    offset = frame.offset
    local = frame.positions - offset if offset.any() else frame.positions
    for values in velocity.values():  # which have the run's precision, and both have to have the same
        local = local.astype(values.dtype, copy=False)
    result = pysplashsurf.reconstruction_pipeline(np.ascontiguousarray(local), **options)
    mesh: Any = result[0] if isinstance(result, tuple) else result
    corners = {name: values for name, values in mesh.point_attributes.items() if name in velocity}
    vertices = mesh.mesh.vertices + offset if offset.any() else mesh.mesh.vertices
    return write_ply(ParticleFrame(vertices, corners, frame.time, frame.spacing, frame.origin), mesh.mesh.triangles)
