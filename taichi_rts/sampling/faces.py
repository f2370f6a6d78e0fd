"""The walls of a domain: lattices of wall particles behind its faces, whole or in part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from taichi_rts.sampling.walls import WallLayer, calibrate_walls, face_volume, plane_depths, wall_stiffness
from taichi_rts.scene.fluids.shape import lattice
from taichi_rts.scene.parts.conditions import AXES
from taichi_rts.scene.rows import fit_rows
from taichi_rts.scene.scene import Scene


@dataclass(frozen=True)
class Faces:
    """The wall behind the two faces across one `axis`: a lattice of wall particles, the last axis fastest.

    Attributes:
        coordinates: [m], ascending, along each axis.
        depths: [m] behind the face, one for each coordinate along `axis`.
        behind_lower: which of those coordinates lie behind the lower face.
        volume: of each particle [m^dim].
        depth, stiffness: as in `WallLayer`.
    """

    axis: int
    coordinates: tuple[np.ndarray, ...]
    depths: np.ndarray
    behind_lower: np.ndarray
    volume: float
    depth: float
    stiffness: float

    @property
    def count(self) -> int:
        """Number of particles."""
        return math.prod(map(len, self.coordinates))

    def whole(self) -> tuple[WallLayer, np.ndarray]:
        """Return all, and which, (M,), lie behind the lower face."""
        numbers = np.arange(len(self.depths))
        across = [np.arange(1)] * len(self.coordinates)
        shape = tuple(map(len, self.coordinates))
        across[self.axis] = numbers
        along = np.broadcast_to(np.ix_(*across)[self.axis], shape).reshape(-1)
        return self._layer(lattice(list(self.coordinates)), along), self.behind_lower[along]

    def select(self, bins: Sequence[np.ndarray], wanted: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        """Return the numbers along each axis, (M,) each, of the particles in the `wanted` bins, and in the how manieth, (M,).

        `bins` says for each axis in which bin each coordinate lies, ascending; `wanted` names bins by these, (K,) for each axis.
        """
        low, counts = self.ranges(bins, wanted)
        total = np.prod(counts, axis=0)
        which = np.repeat(np.arange(len(total)), total)
        n = np.arange(len(which)) - np.repeat(np.cumsum(total) - total, total)
        numbers: list[np.ndarray] = []
        for first, count in zip(low[::-1], counts[::-1], strict=True):
            n, within = np.divmod(n, count[which])
            numbers.insert(0, first[which] + within)
        return numbers, which

    def ranges(self, bins: Sequence[np.ndarray], wanted: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return the first number and the count of coordinates in each of the `wanted` bins, (dim, K) both."""
        low, high = (
            np.stack([np.searchsorted(have, want, side) for have, want in zip(bins, wanted, strict=True)])
            for side in ("left", "right")
        )
        return low, high - low

    def some(self, numbers: Sequence[np.ndarray]) -> WallLayer:
        """Return those whose coordinates have these `numbers` along each axis, (M,) each."""
        positions = np.stack([x[n] for x, n in zip(self.coordinates, numbers, strict=True)], axis=-1)
        return self._layer(positions, numbers[self.axis])

    def _layer(self, positions: np.ndarray, along: np.ndarray) -> WallLayer:
        sides = np.where(self.behind_lower[along], 1.0, -1.0)
        normals = sides[:, None] * np.eye(len(self.coordinates))[self.axis]
        volumes = np.full(len(positions), self.volume)
        return WallLayer(positions, normals, volumes, self.depths[along], self.depth, self.stiffness)


def faces_of(scene: Scene) -> list[Faces]:
    """Return the walls behind the faces of the domain, but for those across periodic axes; none if the scene has no walls.

    They lie in `Scene.wall_planes` planes, a spacing apart. Depth and volume come from `calibrate_walls`; along a face the
    spacing is adapted so that a whole number fits. Earlier axes' faces own the edges that they share with later ones.
    """
    if not scene.walls or all(scene.is_periodic):
        return []
    s, lower, upper = scene.spacing, scene.domain.lower, scene.domain.upper
    depth, volume = calibrate_walls(scene)
    depths = plane_depths(scene, depth)
    steps = fit_rows(scene).steps
    inner, stretch = [], []
    for low, high, step in zip(lower, upper, steps, strict=True):
        count = max(1, round((high - low) / s))
        width = (high - low) / count
        inner.append(low + (np.arange(count) + 0.5) * width)
        stretch.append(width / step)
    found = []
    for axis in range(scene.dim):
        if scene.is_periodic[axis]:
            continue
        across = np.concatenate([lower[axis] - depths[::-1], upper[axis] + depths])
        beyond = [
            inner[d] if scene.is_periodic[d] else np.concatenate([lower[d] - depths[::-1], inner[d], upper[d] + depths])
            for d in range(axis + 1, scene.dim)
        ]
        share = math.prod(stretch[d] for d in range(scene.dim) if d != axis)
        found.append(
            Faces(
                axis,
                (*inner[:axis], across, *beyond),
                np.concatenate([depths[::-1], depths]),
                across < lower[axis],
                face_volume(scene, steps, axis, depth, volume) * share,
                depth,
                wall_stiffness(scene),
            )
        )
    return found


def line_walls(scene: Scene) -> tuple[WallLayer, np.ndarray]:
    """Wall particles behind each face of the domain, and (M,), which moving wall each is part of, -1 if of none.

    They are those of `faces_of`, without those behind an inflow.
    """
    faces = faces_of(scene)
    if not faces:
        return no_walls(scene)
    numbers: dict[str, int] = {wall.face: number for number, wall in enumerate(scene.moving_walls)}
    layers, owners = [], []
    for each in faces:
        layer, behind = each.whole()
        layers.append(layer)
        name = AXES[each.axis]
        owners.append(np.where(behind, numbers.get(name + "-", -1), numbers.get(name + "+", -1)))
    layer = layers[0].joined(layers[1:])
    kept = ~behind_inflows(scene, layer)
    return layer.choose(kept), np.concatenate(owners)[kept]


def walls_near(scene: Scene, faces: Sequence[Faces], x: np.ndarray) -> WallLayer:
    """Return those of `faces` within the support radius of any of the points `x` [m], (N, dim), and some that are not."""
    r, lower = scene.support, np.asarray(scene.domain.lower)
    occupied = np.unique(np.floor((x[np.isfinite(x).all(axis=1)] - lower) / r).astype(np.int64), axis=0)
    around = np.stack(list(np.ndindex(*[3] * scene.dim))) - 1
    wanted = np.unique((occupied[:, None] + around).reshape(-1, scene.dim), axis=0)
    layers = [no_walls(scene)[0]]
    for each in faces:
        bins = [np.floor((c - low) / r).astype(np.int64) for c, low in zip(each.coordinates, lower, strict=True)]
        layers.append(each.some(each.select(bins, list(wanted.T))[0]))
    layer = layers[0].joined(layers[1:])
    return layer.choose(~behind_inflows(scene, layer))


def no_walls(scene: Scene) -> tuple[WallLayer, np.ndarray]:
    """Return no wall particles, of no moving wall."""
    nothing = np.zeros((0, scene.dim))
    return WallLayer(nothing, nothing, np.zeros(0), np.zeros(0), 0.0, 1.0), np.zeros(0, int)


def behind_inflows(scene: Scene, layer: WallLayer) -> np.ndarray:
    """Say which wall particles of `layer`, (M,), lie behind the patch of an inflow."""
    behind = np.zeros(len(layer.positions), bool)
    if scene.inflows:
        depths = plane_depths(scene, layer.depth)
    for inflow in scene.inflows:
        reach = np.where(np.arange(scene.dim) == inflow.axis, depths[-1] + 0.5 * layer.depth, 0.5 * scene.spacing)
        first, last = np.asarray(inflow.lower) - reach, np.asarray(inflow.upper) + reach
        behind |= ((layer.positions >= first) & (layer.positions <= last)).all(axis=1)
    return behind
