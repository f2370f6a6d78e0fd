"""Sums over windows are those over all pairs: on faces and corners, across periodic faces, and where too many do not fit."""

import numpy as np
import pytest

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.medium.smoothing import make_kernel
from taichi_rts.sampling.walls import WallLayer
from taichi_rts.solver.grid import windows
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.neighbour_sum import TASKS, NeighbourSum
from taichi_rts.solver.grid.windows import FluidWindows, WallWindows
from taichi_rts.solver.particles.neighbourhood import Neighbourhood
from taichi_rts.solver.physics.walls import Walls

SUPPORT = 0.25
LOWER, UPPER = -0.1, 0.8
CPU = Backend("cpu", "f64")


@ti.data_oriented
class Due:
    """A schedule under which every `every`-th place is due."""

    def __init__(self, grid, count, every):
        places = np.arange(0, count, every)
        starts = grid.start.to_numpy()[::CELLS_PER_BLOCK]
        self.grid = grid
        self.first = ti.field(ti.i32, grid.geometry.blocks + 1)
        self.first.from_numpy(np.searchsorted(places, starts).astype(np.int32))
        self.due = ti.field(ti.i32, len(places))
        self.due.from_numpy(places.astype(np.int32))
        self.due_count = ti.field(ti.i32, ())
        self.due_count[None] = len(places)

    @ti.func
    def due_in(self, m):
        block = self.grid.occupied[m]
        return self.first[block], self.first[block + 1]


@ti.data_oriented
class Sums:
    """Sum of W and of W x_ij over fluid and wall, of points in a box."""

    def __init__(self, x, periodic, wall=None, per_block=25, backend=CPU):
        count, dim = x.shape
        self.geometry = Geometry((LOWER,) * dim, (UPPER,) * dim, SUPPORT, periodic=periodic)
        self.grid = BlockGrid(self.geometry, count)
        self.near = Neighbourhood(count, dim, backend, geometry=self.geometry)
        self.width = 1 + dim
        self.x = ti.Vector.field(dim, ti.f64, count)
        self.x.from_numpy(x)
        identity = ti.field(ti.i32, count)
        identity.from_numpy(np.arange(count, dtype=np.int32))
        self.sort(identity)
        self.gather()
        self.windows = FluidWindows(self.near, self.grid, per_block, backend, frozenset())
        self.walls = [Walls(wall, self.near, self.geometry, backend)] if wall else []
        for each in self.walls:
            if not self.geometry.repeats:
                each.windows = WallWindows(each)
        self.kernel = make_kernel("cubic_spline", dim, SUPPORT)
        self.found = ti.Vector.field(2 * self.width, ti.f64, count)
        self.shares = ti.field(ti.i32, TASKS + 1)

        @ti.func
        def both(x_ij):
            w = self.kernel.value(x_ij.norm())
            result = ti.Vector.zero(ti.f64, 1 + dim)
            result[0] = w
            for d in ti.static(range(dim)):
                result[1 + d] = w * x_ij[d]
            return result

        @ti.func
        def pair(near, i, j):
            return both(near.difference(i, j))

        def wall_pair(wall):
            @ti.func
            def against(k, b):
                return wall.volume[b] * both(wall.difference(k, b))

            return against

        self.sum = NeighbourSum(
            pair, wall_pair, 1 + dim, ("x",), ("x", "volume"), self.near, self.grid, self.windows, self.walls, backend
        )

    @ti.kernel
    def sort(self, identity: ti.template()):
        for i in range(self.x.shape[0]):
            self.grid.insert(i, self.x[i])
        self.grid.sort(identity)

    @ti.kernel
    def gather(self):
        for k in range(self.x.shape[0]):
            self.near.x[k] = self.geometry.place(self.x[self.grid.order[k]])

    def run(self, every=1):
        """Places due, and the sums of the others as NaN, (N, 2 width)."""
        self.found.fill(np.nan)
        self.visit(Due(self.grid, self.x.shape[0], every))
        return self.found.to_numpy()

    @ti.kernel
    def visit(self, due: ti.template()):
        self.sum.visit(self.note, due, 0, 0.0)

    @ti.kernel
    def share_out(self, due: ti.template()):
        for task in self.shares:
            self.shares[task] = self.sum.share(due, task)

    @ti.func
    def note(self, k, fluid, walls, due: ti.template(), now, tick):
        for d in ti.static(range(self.width)):
            self.found[k][d] = fluid[d]
            self.found[k][self.width + d] = walls[d]


def brute_force(kernel, x_ij, weights, lengths):
    """The same over all pairs, (N, M, dim)."""
    for d, length in enumerate(lengths):
        if length:
            x_ij[..., d] -= length * np.round(x_ij[..., d] / length)
    w = kernel.sample(np.linalg.norm(x_ij, axis=2)) * weights
    return np.concatenate([w.sum(axis=1)[:, None], (w[..., None] * x_ij).sum(axis=1)], axis=1)


def cloud(dim, count=200, lower=LOWER, upper=UPPER, seed=0):
    """Random points, and one on each corner, edge and face."""
    rng = np.random.default_rng(seed)
    special = np.stack(np.meshgrid(*[[lower, 0.5 * (lower + upper), upper]] * dim), axis=-1).reshape(-1, dim)
    return np.concatenate([rng.uniform(lower, upper, (count, dim)), special])


def wall_beside(dim):
    """Particles behind the lowest face, with volumes of their own."""
    x = np.stack(np.meshgrid(*[np.arange(LOWER + 0.02, UPPER, 0.06)] * dim), axis=-1).reshape(-1, dim)
    x[:, -1] = LOWER - 0.05
    x = np.unique(x, axis=0)
    return WallLayer(x, np.zeros_like(x), np.linspace(1.0, 2.0, len(x)), np.full(len(x), 0.05), 0.05, 1.0)


def check(sums, every=1):
    found = sums.run(every)
    dim, periodic = sums.geometry.dim, sums.geometry.periodic
    lengths = [UPPER - LOWER if around else 0.0 for around in periodic]
    y = sums.near.x.to_numpy()[: len(found)]
    due = np.arange(0, len(y), every)
    fluid = brute_force(sums.kernel, y[due][:, None] - y, np.ones(len(y)), lengths)
    scale = np.abs(fluid).max()
    np.testing.assert_allclose(found[due, : 1 + dim], fluid, atol=1e-11 * scale)
    assert np.isnan(np.delete(found, due, axis=0)).all()
    walls = 0.0
    for wall in sums.walls:
        z, volume = wall.x.to_numpy()[: wall.count], wall.volume.to_numpy()[: wall.count]
        walls = brute_force(sums.kernel, y[due][:, None] - z, volume, lengths)
        assert (walls[:, 0] > 0).sum() >= 3
    np.testing.assert_allclose(found[due, 1 + dim :], walls, atol=1e-11 * scale)


@pytest.mark.parametrize("dim", [2, 3])
def test_sums_are_those_over_all_pairs_walls_included(taichi_cpu_f64, dim):
    sums = Sums(cloud(dim), None, wall_beside(dim))
    check(sums)
    check(sums, every=7)


@pytest.mark.parametrize("periodic", [(True, False), (True, True), (False, True, True), (True, False, True)])
def test_windows_reach_across_periodic_faces(taichi_cpu_f64, periodic):
    check(Sums(cloud(len(periodic)), periodic, wall_beside(len(periodic)) if not periodic[-1] else None))


@pytest.mark.parametrize("bounds_checked", [pytest.param(False, marks=pytest.mark.slow), True])
def test_what_does_not_fit_into_a_window_is_summed_without(start_taichi, bounds_checked):
    crowd = np.random.default_rng(1).uniform(0.1, 0.3, (3000, 2))
    with start_taichi("cpu", "f64", debug=bounds_checked):
        sums = Sums(np.concatenate([cloud(2, 100), crowd]), None, wall_beside(2), per_block=8)
        assert sums.windows.capacity < np.diff(sums.grid.start.to_numpy()[::CELLS_PER_BLOCK]).max()
        check(sums)


def test_more_entries_than_a_masked_index_holds_are_copied_one_by_one(taichi_cpu_f64, monkeypatch):
    x = cloud(3)
    assert Sums(x, None).windows.at_once == 8
    monkeypatch.setattr(windows, "INDEX", len(x))
    sums = Sums(x, None)
    assert sums.windows.at_once == 1
    check(sums)


def test_cells_that_hold_more_than_is_copied_at_once_are_summed_whole(taichi_cpu_f64):
    crowd = np.random.default_rng(1).uniform(0.15, 0.4, (300, 3))
    sums = Sums(np.concatenate([cloud(3, 100), crowd]), None, per_block=60)
    assert np.diff(sums.grid.start.to_numpy()).max() > 2 * sums.windows.at_once
    check(sums)


@pytest.mark.parametrize("every", [1, 7])
def test_tasks_share_out_the_due_not_the_blocks(taichi_cpu_f64, every):
    low = np.random.default_rng(1).uniform(LOWER, (UPPER, UPPER, LOWER + 0.4), (2000, 3))
    sums = Sums(np.concatenate([cloud(3, 20), low]), None)
    due = Due(sums.grid, sums.x.shape[0], every)
    sums.share_out(due)
    occupied = sums.grid.occupied.to_numpy()[: sums.grid.occupied_count[None]]
    shares, first = sums.shares.to_numpy(), np.append(due.first.to_numpy()[occupied], due.due_count[None])
    assert shares[0] == 0
    assert (np.diff(shares) >= 0).all()
    begins = first[shares]
    assert begins[-1] == due.due_count[None]  # no due particle is left out
    fair = due.due_count[None] / TASKS + np.diff(first).max()
    assert np.diff(begins).max() <= fair
    by_blocks = due.first.to_numpy()[np.arange(TASKS + 1) * sums.geometry.blocks // TASKS]
    assert np.diff(by_blocks).max() > 1.2 * fair  # equal shares of the blocks are not
