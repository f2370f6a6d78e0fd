"""Wall boundary particles after Akinci et al. 2012.

Why this one and not Adami et al. 2012: its wall particles carry a volume and no state. Nothing has to be extrapolated
to them, so a wall is valid at every time, as particles at different times need. And its pressure force
derives from the same energy as the fluid's, so a wall at rest does no work.

Akinci's V_b = 1 / sum_k W_bk makes up for what a single layer lacks, seen from the wall. For the even faces of the domain
`sampling/walls.calibrate_walls` works it out as seen from fluid at rest on them.
"""

import copy
from typing import Any

import numpy as np

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.device.fields import Declared, Part, integers, reals, vectors
from taichi_rts.sampling.walls import WallLayer
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.particles.fields import Rows, Values
from taichi_rts.solver.particles.neighbourhood import Neighbourhood

LARGEST_SHEAR = 4.0
LARGEST_SHEAR_LAYERED = 6.0
"""Where walls have several planes: the first may lie 2.2 spacings deep (r = 4s), and fluid at rest half a spacing from the face
must still count as it is."""


@ti.data_oriented
class Walls(Part):
    """Wall particles at rest, sorted into the grid's cells once.

    Positions x [m], volumes [m^dim], and normals into the fluid; `near` flags blocks that see one.
    """

    moves = False
    transient = frozenset(
        {"x", "volume", "normal", "depth", "stiffness", "start", "near", "shift", "speed", "windows", "dtype"}
        | {"depths", "layered"}
    )

    def __init__(self, layer: WallLayer, fluid: Neighbourhood, geometry: Geometry, backend: Backend) -> None:
        positions, volumes = layer.positions, layer.volumes
        layered = bool((layer.depths != layer.depth).any())
        self.make(fluid, geometry, backend, layer.depth, layer.stiffness, len(positions), layered=layered)
        cell = geometry.cell_numpy(positions)
        order = np.argsort(cell, kind="stable")
        start = np.searchsorted(cell[order], np.arange(geometry.cells + 1))
        near = geometry.spread(np.diff(start[::CELLS_PER_BLOCK]) > 0)
        if layered:
            self.depths.from_numpy(np.pad(layer.depths[order], (0, backend.lanes)).astype(backend.numpy_dtype))
        sorted_ = (values[order].astype(backend.numpy_dtype) for values in (positions, volumes, layer.normals))
        self.load(*sorted_, start.astype(np.int32), near.astype(np.int32))

    def make(
        self,
        fluid: Neighbourhood,
        geometry: Geometry,
        backend: Backend,
        depth: float,
        stiffness: float,
        count: int,
        *,
        layered: bool,
    ) -> None:
        """Make room for `count` wall particles, whose first plane lies `depth` [m] deep; `layered`: in several planes."""
        self.fluid, self.geometry, self.dtype = fluid, geometry, backend.dtype
        self.windows: Any = None  # see `windows.py`
        self.count, self.depth, self.stiffness, self.layered = count, depth, stiffness, layered
        self.make_fields(self.particle_fields(count + backend.lanes, geometry.dim, layered), backend.dtype)
        self.make_fields(self.block_fields(geometry.blocks))

    @staticmethod
    def particle_fields(entries: int, dim: int, layered: bool) -> list[Declared]:
        """Declare the fields with `entries` for wall particles; `layered`: in several planes."""
        declared = [*vectors(dim, entries, "x"), *reals(entries, "volume"), *vectors(dim, entries, "normal")]
        return declared + reals(entries, "depths") if layered else declared

    @staticmethod
    def block_fields(blocks: int) -> list[Declared]:
        """Declare the fields for `blocks` of the grid that the particles are sorted into."""
        return [*integers(blocks * CELLS_PER_BLOCK + 1, "start"), *integers(blocks, "near")]

    @ti.func
    def take(self, b, x: ti.template(), volume: ti.template(), normal: ti.template()):
        """Take over place, volume and normal of wall particle `b`."""
        self.volume[b] = volume[b]
        for d in ti.static(range(self.x.n)):
            self.x[b][d], self.normal[b][d] = x[b, d], normal[b, d]

    @ti.kernel
    def load(self, x: Rows, volume: Values, normal: Rows, start: Values, near: Values):
        """Take these over; one kernel compiles quicker than many assignments."""
        for b in range(x.shape[0]):
            self.take(b, x, volume, normal)
        for cell in self.start:
            self.start[cell] = start[cell]
        for block in self.near:
            self.near[block] = near[block]

    def densest_column(self) -> int:
        """Return how many wall particles the blocks in and around one row hold at one column, at most."""
        counts = np.diff(self.start.to_numpy()[::CELLS_PER_BLOCK]).reshape(self.geometry.shape[::-1])
        for axis in range(self.geometry.dim - 1):
            counts = counts + np.roll(counts, 1, axis) + np.roll(counts, -1, axis)
        return int(counts.max())

    def room_for(self, count: int) -> "Walls":
        """Return the same with room for `count` particles, none of which is there yet."""
        other = copy.copy(self)
        other.make_fields(self.particle_fields(count, self.geometry.dim, self.layered), self.dtype)
        return other

    @ti.func
    def seen_from(self, k, cell):
        """Position [m] and cell, among the wall particles, of the fluid particle at place `k` in `cell`."""
        return self.fluid.x[k], cell

    @ti.func
    def difference(self, k, b):
        """x_k - x_b [m] between the fluid at place `k` and wall particle `b`."""
        return self.geometry.difference(self.fluid.x[k], self.x[b])

    @ti.func
    def relative_velocity(self, k, b):
        """v_k - v_b [m/s]."""
        return self.fluid.v[k]

    @ti.func
    def facing(self, k, b):
        """Normal of wall particle `b`, for the fluid at place `k`."""
        return self.normal[b]

    @ti.func
    def slip(self, k, b, x_ib, v_ib):
        """Velocity [m/s] of the fluid at place `k` past the wall's face, where the line to particle `b` crosses it."""
        return v_ib

    @ti.func
    def shear(self, k, b, x_ib):
        """How much faster than fluid at x_ib [m] from particle `b` that fluid moves past the wall's far side, per its speed.

        With (d_i + d_b)/d_i, d_i and d_b being the distances to the face, velocities go through zero on the face (Morris, Fox &
        Zhu 1997, Eq. 23), and a linear profile along a resting lattice feels no force, as it should. Bounded, because fluid
        may come arbitrarily close: no nearer than d_b/3 counts (d_b/5 with several planes, d_b being that of the first). And at
        least once: a particle of an obstacle that faces away, round an edge or on a plate's other side, has the obstacle's speed.
        """
        distance = self.facing(k, b).dot(x_ib)
        depth, largest = self.depth, LARGEST_SHEAR
        if ti.static(self.layered):
            depth = self.depths[b]
            largest = 1.0 + (LARGEST_SHEAR_LAYERED - 1.0) / self.depth * depth
        ratio = ti.min(distance / ti.max(distance - depth, 1e-3 * depth), largest)
        return ti.max(ratio, 1.0) / self.stiffness
