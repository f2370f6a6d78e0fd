"""Walls of a domain that the water does not fill: wall particles are laid where the grid keeps blocks, and nowhere else."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.sampling.faces import Faces, behind_inflows
from taichi_rts.sampling.walls import WallLayer
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.grid.geometry import MARGIN, Geometry
from taichi_rts.solver.grid.tiles import CELLS, TILE, Tiles
from taichi_rts.solver.particles.fields import Rows, Values
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.walls import Walls

Indices: Any = ti.types.ndarray(dtype=ti.i32, ndim=1)


def most_along(scene: Scene, geometry: Geometry, spacing: float, axis: int, blocks: int) -> int:
    """Return how many coordinates of a wall's lattice lie in so many blocks one behind the other, at most."""
    length = scene.domain.size[axis]
    width = length / max(1, round(length / spacing))
    return math.ceil(blocks * geometry.sides[axis] / width - 1e-9) + 1


def densest_column(scene: Scene, geometry: Geometry, spacing: float) -> int:
    """Return how many wall particles the blocks in and around one row hold at one column, at most."""
    reach, total = [1] + [3] * (scene.dim - 1), 0
    for face in range(scene.dim):
        sides = [most_along(scene, geometry, spacing, d, reach[d]) + 2 * scene.wall_planes for d in range(scene.dim)]
        sides[face] = scene.wall_planes * (2 if geometry.inside[face] <= reach[face] else 1)
        total += math.prod(sides)
    return total


def room_for_walls(scene: Scene, geometry: Geometry, spacing: float, particles: int) -> int:
    """Return how many wall particles may have to be laid at once, at most, for so many particles of fluid.

    Each may have a face in all tiles around it, or two where the domain is thin, and in the one where it was before. What lies
    within two tiles of an edge comes on top; and there are no more than lie behind all faces.
    """
    dim, planes = scene.dim, scene.wall_planes
    most = [[most_along(scene, geometry, spacing, axis, n) for axis in range(dim)] for n in (2 * TILE, TILE, 3, 1)]
    wide, own = (
        along[0] * (max(aside[1:]) if dim == 3 else 1) for along, aside in ((most[0], most[2]), (most[1], most[3]))
    )
    each = planes * (wide + own) * (1 + sum(n <= 3 for n in geometry.inside))
    lengths = [scene.domain.size[axis] / spacing + 2.0 * planes + 2.0 for axis in range(dim)]
    near = [min(n, most_along(scene, geometry, spacing, axis, 2 * TILE + 1) + planes) for axis, n in enumerate(lengths)]
    edges = every = 0.0
    for face in range(dim):
        others = [axis for axis in range(dim) if axis != face]
        every += 2.0 * planes * math.prod(lengths[axis] for axis in others)
        for edge in others:  # of the edges between these two faces, or corners in two dimensions, what is behind `face`
            edges += 4.0 * planes * math.prod(near[axis] if axis == edge else lengths[axis] for axis in others)
    return math.ceil(min(particles * each + edges, every))


@ti.data_oriented
class LaidWalls(Walls):
    """Wall particles at rest of the tiles that `geometry` keeps, up to `room` of them; `faces` are those of the `scene`."""

    transient = frozenset({"scene", "faces", "steps"})
    geometry: Tiles

    def __init__(
        self,
        scene: Scene,
        faces: Sequence[Faces],
        room: int,
        densest: int,
        fluid: Neighbourhood,
        geometry: Tiles,
        backend: Backend,
    ) -> None:
        first = faces[0]
        layered = bool((first.depths != first.depth).any())
        self.make(fluid, geometry, backend, first.depth, first.stiffness, room, layered=layered)
        self.scene, self.faces, self.densest = scene, list(faces), densest
        self.numpy_dtype = backend.numpy_dtype
        self.steps = [
            [self._steps(geometry, x, axis) for axis, x in enumerate(each.coordinates)] for each in self.faces
        ]
        """For each face, column of cells or step in blocks of each coordinate."""

    @staticmethod
    def _steps(geometry: Tiles, x: np.ndarray, axis: int) -> np.ndarray:
        """Return what `Geometry.cell_numpy` finds of coordinates `x` [m] along an axis."""
        if axis == 0:
            scale = CELLS_PER_BLOCK / geometry.sides[0]
            return np.floor((x - geometry.lower[0]) * scale).astype(np.int64) + MARGIN * CELLS_PER_BLOCK
        return np.floor((x - geometry.lower[axis]) / geometry.sides[axis]).astype(np.int64) + MARGIN

    def densest_column(self) -> int:
        """Return how many wall particles the blocks in and around one row may hold at one column."""
        return self.densest

    def count_in(self, keys: np.ndarray) -> int:
        """Return how many wall particles lie in the tiles `keys`, (used,), those behind inflows too."""
        wanted = self._wanted(keys)
        found = (each.ranges(self._bins(k), wanted)[1] for k, each in enumerate(self.faces))
        return sum(int(np.prod(counts, axis=0).sum()) for counts in found)

    def lay(self) -> None:
        """Lay the wall particles of the tiles that the grid keeps, in the order that they would have among all."""
        keys = self.geometry.keys()
        layers, cells = [], []
        for k, each in enumerate(self.faces):
            numbers, slot = each.select(self._bins(k), self._wanted(keys))
            column = self.steps[k][0][numbers[0]] - keys[slot] % self.geometry.tiles * CELLS
            layers.append(each.some(numbers))
            cells.append((slot + 1) * CELLS + column)
        self._load(layers[0].joined(layers[1:]), np.concatenate(cells), len(keys) + 1)

    def _load(self, layer: WallLayer, cell: np.ndarray, slots: int) -> None:
        kept = ~behind_inflows(self.scene, layer)
        layer, cell = layer.choose(kept), cell[kept]
        order = np.argsort(cell, kind="stable")
        start = np.searchsorted(cell[order], np.arange(slots * CELLS + 1)).astype(np.int32)
        values = (layer.positions, layer.volumes, layer.normals, layer.depths)
        self.load_some(*(each[order].astype(self.numpy_dtype) for each in values), start)

    def _bins(self, face: int) -> list[np.ndarray]:
        """Return in which tile of a row, and in which rows, each of a face's coordinates lies."""
        return [self.steps[face][0] // CELLS, *self.steps[face][1:]]

    def _wanted(self, keys: np.ndarray) -> list[np.ndarray]:
        """Return the same of tiles."""
        row, tile = np.divmod(keys, self.geometry.tiles)
        wanted, stride = [tile], 1
        for length in self.geometry.shape[1:]:
            wanted.append(row // stride % length)
            stride *= length
        return wanted

    @ti.kernel
    def load_some(self, x: Rows, volume: Values, normal: Rows, depths: Values, start: Indices):
        """Take these over, of which each cell has its share from `start` on; behind the last cell there is nothing."""
        for b in range(x.shape[0]):
            self.take(b, x, volume, normal)
            if ti.static(self.layered):
                self.depths[b] = depths[b]
        for cell in self.start:
            self.start[cell] = start[ti.min(cell, start.shape[0] - 1)]
        for block in self.near:
            near = 0
            if (block + 1) * CELLS_PER_BLOCK < start.shape[0] and self.geometry.safe(block * CELLS_PER_BLOCK):
                near = self.count_at(block)
                for k in ti.static(range(len(self.geometry.offsets))):
                    near += self.count_at(self.geometry.beside(block, k))
            self.near[block] = ti.cast(near > 0, ti.i32)

    @ti.func
    def count_at(self, block):
        """Number of wall particles in `block`."""
        return self.start[(block + 1) * CELLS_PER_BLOCK] - self.start[block * CELLS_PER_BLOCK]
