"""What keeps the centres of particles out of obstacles, as the domain's box keeps them in.

Solids are data: their tables of distances lie one behind the other in one field, so that code and compilation do not depend on
how many there are at rest. Each moving body has a motion of its own, which is unrolled into the code.
"""

from collections.abc import Sequence

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.device.fields import Declared, Part, integers, reals
from taichi_rts.scene.geometry.bodies import Body
from taichi_rts.scene.obstacles.solid import PAD, DistanceGrid
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.physics.path import Path
from taichi_rts.solver.physics.timetable import store

PROJECTIONS = 4  # of a point that is inside: the distance is not linear at edges
MOST_BINS = 1 << 18
"""Bins in which solids are looked up; they are made larger where there would be more."""


@ti.data_oriented
class DistanceTables(Part):
    """Signed distances from all obstacles of a scene, by the number of the obstacle, each as it stands at time 0."""

    transient = frozenset({"values", "first", "origin", "scale", "shape"})

    def __init__(self, grids: Sequence[DistanceGrid], dim: int) -> None:
        self.dim = dim
        sizes = [grid.values.size for grid in grids]
        self.make_fields(self.fields(sum(sizes), len(grids), dim))
        store(self.values, np.concatenate([grid.values.reshape(-1) for grid in grids]))
        self.first.from_numpy((np.cumsum(sizes) - sizes).astype(np.int32))
        store(self.origin, np.array([grid.origin for grid in grids]))
        store(self.scale, np.array([1.0 / grid.step for grid in grids]))
        self.shape.from_numpy(np.array([grid.values.shape for grid in grids], np.int32))

    @staticmethod
    def fields(nodes: int, solids: int, dim: int) -> list[Declared]:
        """Declare the tables of so many `solids`, with `nodes` in all, and where each begins."""
        return [
            *reals(nodes, "values"),
            *integers(solids, "first"),
            Declared("origin", float, solids, (dim,)),
            *reals(solids, "scale"),
            Declared("shape", ti.i32, solids, (dim,)),
        ]

    @ti.func
    def look(self, solid, x):
        """Signed distance [m] of `x` [m] from a solid and its gradient, interpolated linearly; 0 gradient off its table."""
        scale = self.scale[solid]
        place = (x - self.origin[solid]) * scale
        near = True
        base = ti.Vector.zero(ti.i32, self.dim)
        share = ti.zero(x)
        for d in ti.static(range(self.dim)):
            near = near and place[d] >= 0.0 and place[d] < ti.cast(self.shape[solid][d], float) - 1.0
            base[d] = ti.min(ti.max(ti.cast(ti.floor(place[d]), ti.i32), 0), self.shape[solid][d] - 2)
            share[d] = place[d] - ti.cast(base[d], float)
        distance, gradient = 1.0, ti.zero(x)
        if near:
            distance = 0.0
            for corner in ti.static(list(np.ndindex(*[2] * self.dim))):
                node = 0
                weight = 1.0
                for d in ti.static(range(self.dim)):
                    node = node * self.shape[solid][d] + base[d] + ti.static(int(corner[d]))
                    weight *= share[d] if ti.static(corner[d] == 1) else 1.0 - share[d]
                value = self.values[self.first[solid] + node]
                distance += weight * value
                for d in ti.static(range(self.dim)):
                    slope = scale if ti.static(corner[d] == 1) else -scale
                    for e in ti.static(range(self.dim)):
                        if ti.static(e != d):
                            slope *= share[e] if ti.static(corner[e] == 1) else 1.0 - share[e]
                    gradient[d] += slope * value
        return distance, gradient

    @ti.func
    def outside(self, solid, x):
        """Nearest point to `x` [m] outside a solid at time 0, and the normal if it is another, else 0."""
        y, normal = x, ti.zero(x)
        for _ in range(PROJECTIONS):
            distance, gradient = self.look(solid, y)
            if distance < 0.0:
                size = ti.max(gradient.norm(), 0.1)
                normal = gradient / size
                y -= (distance / size) * normal
        return y, normal


def bin_solids(
    low: np.ndarray, high: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray, np.ndarray]:
    """Sort boxes from `low` to `high` [m], (n, dim), into bins of 2 `PAD` spacings, or larger ones if there would be too many.

    Returns the corner of the first bin [m], (dim,), the number of bins along each axis, (dim,), their side [m], and for bin n, of
    which the last axis runs fastest, the places `start[n]` to `start[n + 1]` of a list with the boxes' numbers, ascending.
    """
    origin = low.min(axis=0)
    extent = high.max(axis=0) - origin
    side = max(2.0 * PAD * spacing, float(np.prod(extent) / MOST_BINS) ** (1.0 / len(origin)))
    shape = np.floor(extent / side).astype(int) + 1
    first = np.floor((low - origin) / side).astype(int)
    last = np.minimum(np.floor((high - origin) / side).astype(int), shape - 1)
    bins = [
        np.ravel_multi_index(np.meshgrid(*map(np.arange, a, b + 1), indexing="ij"), tuple(shape)).reshape(-1)
        for a, b in zip(first, last, strict=True)
    ]
    numbers = np.repeat(np.arange(len(low)), [len(each) for each in bins])
    together = np.concatenate(bins)
    order = np.argsort(together, kind="stable")
    start = np.searchsorted(together[order], np.arange(np.prod(shape) + 1))
    return origin, shape, side, start, numbers[order]


@ti.data_oriented
class RestingKeeper(Part):
    """Keeps centres out of all obstacles at rest: `numbers` are those in the `tables`, `grids` their tables on the host.

    A point is held against those whose tables reach its bin, in the order of their numbers. Tables reach `PAD` spacings beyond
    their solids, so that one which it is pushed into by another is among them.
    """

    transient = frozenset({"start", "near"})

    def __init__(
        self,
        tables: DistanceTables,
        numbers: Sequence[int],
        grids: Sequence[DistanceGrid],
        geometry: Geometry,
        spacing: float,
    ) -> None:
        self.tables = tables
        self.geometry = geometry
        low = np.array([grid.origin for grid in grids])
        high = low + [grid.step * (np.array(grid.values.shape) - 1) for grid in grids]
        origin, shape, side, start, near = bin_solids(low, high, spacing)
        self.origin, self.shape, self.scale = tuple(origin.tolist()), tuple(shape.tolist()), 1.0 / side
        self.make_fields(self.fields(len(start), len(near)))
        self.start.from_numpy(start.astype(np.int32))
        self.near.from_numpy(np.asarray(numbers, np.int32)[near])

    @staticmethod
    def fields(starts: int, entries: int) -> list[Declared]:
        """Declare the bins: where each begins in a list with so many `entries`."""
        return [*integers(starts, "start"), *integers(entries, "near")]

    @ti.func
    def hold(self, x, v, now, tick, ahead):
        """Nearest point to `x` [m] outside the obstacles, `v` [m/s] without what leads into them, and how many held it."""
        held, slowed, times = x, v, 0
        place = (x - ti.Vector(self.origin)) * self.scale
        inside, n = True, 0
        for d in ti.static(range(self.geometry.dim)):
            along = ti.cast(ti.floor(place[d]), ti.i32)
            inside = inside and along >= 0 and along < self.shape[d]
            n = n * self.shape[d] + along
        if inside:
            for m in range(self.start[n], self.start[n + 1]):
                y, normal = self.tables.outside(self.near[m], held)
                if normal.norm_sqr() > 0.0:
                    times += 1
                    held = self.geometry.place(y)
                    slowed -= ti.min(slowed.dot(normal), 0.0) * normal
        return held, slowed, times


@ti.data_oriented
class MovingKeeper:
    """Keeps centres out of one moving obstacle, number `body.number` of the `tables`."""

    def __init__(self, tables: DistanceTables, body: Body, geometry: Geometry) -> None:
        self.tables = tables
        self.geometry = geometry
        self.number = body.number
        self.path = Path(body)

    @ti.func
    def hold(self, x, v, now, tick, ahead):
        """Nearest point to `x` [m] outside the body, `v` [m/s] without what leads into it, and 1 if it held, else 0.

        It is for the time `ahead` [s] after tick `now`.
        """
        held, slowed, times = x, v, 0
        pivot, turn = self.path.pose(now, tick, ahead)
        arm = self.geometry.difference(x, pivot)
        if arm.norm_sqr() < ti.static(self.path.radius**2):
            start = ti.Vector(self.path.pivot)
            y, at_start = self.tables.outside(self.number, start + turn.transpose() @ arm)
            if at_start.norm_sqr() > 0.0:
                times = 1
                normal = turn @ at_start
                new_arm = turn @ (y - start)
                held = self.geometry.place(x + new_arm - arm)
                straight, spin = self.path.rates(now, tick, ahead)
                velocity = straight + self.path.carried(spin, new_arm)
                slowed -= ti.min((slowed - velocity).dot(normal), 0.0) * normal
        return held, slowed, times
