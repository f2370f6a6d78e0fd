"""Wall boundary particles after Akinci et al. 2012.

Why this one and not Adami et al. 2012: its wall particles carry a volume and no state. Nothing has to be extrapolated to
them, so a wall is valid at every time: just what particles that all live at different times need. And its pressure force
derives from the same energy as the fluid's, so a wall at rest does no work.

Akinci's V_b = 1 / sum_k W_bk makes up for what a single layer lacks, seen from the wall. For the even faces of the domain
`sampling.calibrate_walls` works it out as seen from fluid at rest on them.
"""

import numpy as np
import taichi as ti

from taichi_rts.backend import Backend
from taichi_rts.grid import CELLS_PER_BLOCK, Geometry
from taichi_rts.particles import vector_field


@ti.data_oriented
class Walls:
    """Wall particles sorted into the grid's cells once: positions x [m] and volumes [m^dim]; `near` flags blocks that see one."""

    def __init__(self, positions: np.ndarray, volumes: np.ndarray, geometry: Geometry, backend: Backend) -> None:
        self.count = len(positions)
        cell = geometry.cell_numpy(positions)
        order = np.argsort(cell, kind="stable")
        start = np.searchsorted(cell[order], np.arange(geometry.cells + 1))
        occupied = np.diff(start[::CELLS_PER_BLOCK]) > 0
        near = occupied.copy()
        for stride in geometry.neighbour_strides:
            near |= np.roll(occupied, stride)
        padded = self.count + backend.lanes
        self.x = vector_field(geometry.dim, backend.dtype, padded)
        self.volume = ti.field(backend.dtype, padded)
        self.start = ti.field(ti.i32, geometry.cells + 1)
        self.near = ti.field(ti.i32, geometry.blocks)
        pad = backend.lanes
        self.x.from_numpy(np.pad(positions[order], ((0, pad), (0, 0))).astype(backend.numpy_dtype))
        self.volume.from_numpy(np.pad(volumes[order], (0, pad)).astype(backend.numpy_dtype))
        self.start.from_numpy(start.astype(np.int32))
        self.near.from_numpy(near.astype(np.int32))
