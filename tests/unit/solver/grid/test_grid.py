import numpy as np
import pytest

from taichi_rts.device.backend import Backend, ti
from taichi_rts.device.counts import CELLS_PER_BLOCK
from taichi_rts.device.fields import vector_field
from taichi_rts.medium.smoothing import make_kernel
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.sums import make_neighbour_sum

SUPPORT = 0.25
CPU = Backend("cpu", "f64")
PLAIN_LOOP = Backend("vulkan", "f64")  # lanes = 1, run on the CPU here


def cloud(dim, seed=0, count=150):
    """Random points in (-0.1, 0.8)^dim (no multiple of the support), and one on each corner, edge and face."""
    rng = np.random.default_rng(seed)
    special = np.stack(np.meshgrid(*[[-0.1, 0.35, 0.8]] * dim), axis=-1).reshape(-1, dim)
    lines = -0.1 + SUPPORT * rng.integers(0, 4, (20, dim))  # exactly between blocks
    return np.concatenate([rng.uniform(-0.1, 0.8, (count, dim)), special, lines])


@ti.data_oriented
class SortedCloud:
    def __init__(self, x, identity, periodic=None, vacates=False):
        self.count, dim = x.shape
        self.geometry = Geometry((-0.1,) * dim, (0.8,) * dim, SUPPORT, periodic=periodic)
        self.grid = BlockGrid(self.geometry, self.count)
        if vacates:
            self.grid.track_vacated()
        self.x = vector_field(dim, ti.f64, self.count)
        self.sorted = vector_field(dim, ti.f64, self.count + CPU.lanes)
        self.identity = ti.field(ti.i32, self.count)
        self.identity.from_numpy(identity.astype(np.int32))
        self.sort(x)

    def sort(self, x):
        self.x.from_numpy(x)
        self.place()
        order = self.grid.order.to_numpy()
        self.sorted.from_numpy(np.pad(x[order], ((0, CPU.lanes), (0, 0))))
        return order

    @ti.kernel
    def place(self):
        for i in range(self.count):
            self.grid.insert(i, self.x[i])
        self.grid.sort(self.identity)


@pytest.mark.parametrize("dim", [2, 3])
def test_counting_sort_is_stable_in_cell_and_identity(taichi_cpu_f64, dim):
    x = cloud(dim)
    identity = np.random.default_rng(1).permutation(len(x))
    cloud_ = SortedCloud(x, identity)
    for points in (x, cloud(dim, seed=2), np.full_like(x, 0.3)):
        order = cloud_.sort(points)
        cell = cloud_.geometry.cell_numpy(points)
        assert order.tolist() == np.lexsort((identity, cell)).tolist()
        assert cloud_.grid.cell_of.to_numpy().tolist() == cell.tolist()
        start = np.searchsorted(np.sort(cell), np.arange(cloud_.geometry.cells + 1))
        assert cloud_.grid.start.to_numpy().tolist() == start.tolist()


def sorted_as(cloud_, points, identity):
    """Whether order, cells, their starts, and occupied and vacated blocks are what NumPy makes of `points`."""
    grid, cell = cloud_.grid, cloud_.geometry.cell_numpy(points)
    before = set(grid.occupied.to_numpy()[: grid.occupied_count[None]].tolist())
    order = cloud_.sort(points)
    now = np.unique(cell // CELLS_PER_BLOCK)
    assert order.tolist() == np.lexsort((identity, cell)).tolist()
    assert grid.cell_of.to_numpy().tolist() == cell.tolist()
    assert (
        grid.start.to_numpy().tolist() == np.searchsorted(np.sort(cell), np.arange(cloud_.geometry.cells + 1)).tolist()
    )
    assert grid.occupied.to_numpy()[: grid.occupied_count[None]].tolist() == now.tolist()
    vacated = grid.vacated.to_numpy()[: grid.vacated_count[None]].tolist()
    assert sorted(vacated) == sorted(before - set(now.tolist()))


@pytest.mark.parametrize(
    ("share", "count"),
    [(0.0, 6000), (0.01, 6000), (0.1, 6000), (0.6, 6000), (0.1, 900)],
    ids=["none", "few", "many", "more than there is room for in the list", "always room for all"],
)
def test_particles_that_change_their_cells_are_merged_into_the_others(taichi_cpu_f64, share, count):
    rng = np.random.default_rng(5)
    x = rng.uniform(-0.1, 0.3, (count, 3))
    identity = rng.permutation(len(x))
    cloud_ = SortedCloud(x, identity, vacates=True)
    room = cloud_.grid.resorting.room
    for _ in range(4):
        moves = rng.random(len(x)) < share
        x = np.where(moves[:, None], rng.uniform(-0.1, 0.8, x.shape), x)
        sorted_as(cloud_, x, identity)
    assert (moves.sum() > room) == (share > 0.5)
    x[:, 1] = np.where(x[:, 1] > 0.5, -0.05, x[:, 1])  # some blocks are left by all
    sorted_as(cloud_, x, identity)
    cloud_.grid.forget()
    sorted_as(cloud_, x[::-1].copy(), identity)
    x[:, 0] = np.minimum(x[:, 0], 0.2)
    cloud_.grid.forget()
    sorted_as(cloud_, x, identity)
    cloud_.grid.restored()
    sorted_as(cloud_, x, identity)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("backend", [CPU, PLAIN_LOOP], ids=["lanes", "plain"])
def test_neighbour_sum_equals_brute_force_even_on_faces_and_corners(taichi_cpu_f64, dim, backend):
    x = cloud(dim)
    cloud_ = SortedCloud(x, np.arange(len(x)))
    kernel = make_kernel("cubic_spline", dim, SUPPORT)
    near = cloud_.sorted

    @ti.func
    def pair(i, j):
        x_ij = near[i] - near[j]
        return ti.Vector([kernel.value(x_ij.norm()), kernel.value(x_ij.norm()) * x_ij[0]])

    total = make_neighbour_sum(cloud_.geometry, cloud_.grid.start, pair, 2, backend)

    @ti.kernel
    def run(result: ti.types.ndarray()):
        for k in range(cloud_.count):
            sums = total(k, near[k], cloud_.grid.cell_of[cloud_.grid.order[k]])
            result[k, 0], result[k, 1] = sums[0], sums[1]

    result = np.empty((len(x), 2))
    run(result)
    y = x[cloud_.grid.order.to_numpy()]
    x_ij = y[:, None] - y
    w = kernel.sample(np.linalg.norm(x_ij, axis=2))
    np.testing.assert_allclose(result[:, 0], w.sum(axis=1), rtol=1e-12)
    np.testing.assert_allclose(result[:, 1], (w * x_ij[..., 0]).sum(axis=1), atol=1e-11 * w.max())


@pytest.mark.parametrize("dim", [2, 3])
def test_neighbour_blocks_of_every_place_in_the_domain_exist(dim):
    geometry = Geometry((-0.1,) * dim, (0.8,) * dim, SUPPORT)
    block = geometry.cell_numpy(cloud(dim)) // CELLS_PER_BLOCK
    assert len(geometry.neighbour_strides) == 3**dim - 1
    assert block.min() + min(geometry.neighbour_strides) >= 0
    assert block.max() + max(geometry.neighbour_strides) < geometry.blocks


def test_place_catches_what_is_not_a_number(taichi_cpu_f64):
    geometry = Geometry((0, 0), (1, 2), 0.5)

    @ti.kernel
    def clamp(x: ti.types.ndarray()):
        for i in range(x.shape[0]):
            y = geometry.place(ti.Vector([x[i, 0], x[i, 1]]))
            x[i, 0], x[i, 1] = y[0], y[1]

    x = np.array([[0.3, 1.7], [-1, 3], [2, -np.inf], [np.nan, np.inf]])
    clamp(x)
    assert x[:3].tolist() == [[0.3, 1.7], [0, 2], [1, 0]]
    assert np.isfinite(x).all()
    assert (x[3] >= 0).all()
    assert (x[3] <= [1, 2]).all()


@pytest.mark.parametrize(
    ("dim", "periodic"),
    [
        (2, (0, 1)),
        (3, (1, 0, 1)),
        *(pytest.param(len(axes), axes, marks=pytest.mark.slow) for axes in ((1, 0), (1, 1), (0, 1, 1))),
    ],
)
def test_neighbours_are_found_across_periodic_faces(taichi_cpu_f64, dim, periodic):
    x = cloud(dim)
    cloud_ = SortedCloud(x, np.arange(len(x)), periodic)
    geometry = cloud_.geometry
    assert geometry.inside == tuple(3 if around else 4 for around in periodic)
    kernel = make_kernel("cubic_spline", dim, SUPPORT)

    @ti.kernel
    def put():
        for k in range(cloud_.count):
            cloud_.sorted[k] = geometry.place(cloud_.x[cloud_.grid.order[k]])

    @ti.func
    def pair(i, j):
        x_ij = geometry.difference(cloud_.sorted[i], cloud_.sorted[j])
        return ti.Vector([kernel.value(x_ij.norm()), kernel.value(x_ij.norm()) * x_ij[0]])

    total = make_neighbour_sum(geometry, cloud_.grid.start, pair, 2, CPU)

    @ti.kernel
    def run(result: ti.types.ndarray()):
        for k in range(cloud_.count):
            sums = total(k, cloud_.sorted[k], cloud_.grid.cell_of[cloud_.grid.order[k]])
            result[k, 0], result[k, 1] = sums[0], sums[1]

    result = np.empty((len(x), 2))
    put()
    run(result)
    y = x[cloud_.grid.order.to_numpy()]
    x_ij = y[:, None] - y
    for d in np.flatnonzero(periodic):
        x_ij[..., d] -= 0.9 * np.round(x_ij[..., d] / 0.9)
    w = kernel.sample(np.linalg.norm(x_ij, axis=2))
    np.testing.assert_allclose(result[:, 0], w.sum(axis=1), rtol=1e-11)
    np.testing.assert_allclose(result[:, 1], (w * x_ij[..., 0]).sum(axis=1), atol=1e-10 * w.max())


@pytest.mark.parametrize(("dim", "periodic"), [(2, (0, 0)), (2, (1, 0)), (3, (0, 1, 1))])
def test_blocks_beside_are_those_across_periodic_faces(taichi_cpu_f64, dim, periodic):
    geometry = Geometry((0,) * dim, (1,) * dim, SUPPORT, periodic=periodic)
    count = len(geometry.offsets)
    found = np.zeros((geometry.blocks, count), np.int32)

    @ti.kernel
    def run(result: ti.types.ndarray()):
        for block in range(geometry.blocks):
            for k in ti.static(range(count)):
                result[block, k] = geometry.beside(block, k)

    run(found)
    inside = np.stack(np.meshgrid(*[np.arange(1, n + 1) for n in geometry.inside], indexing="ij"), -1).reshape(-1, dim)
    strides = np.array(geometry.block_strides)
    for place in inside:
        for k, offset in enumerate(geometry.offsets):
            other = place + offset
            wrapped = np.where(periodic, (other - 1) % geometry.inside + 1, other)
            assert found[place @ strides, k] == wrapped @ strides
    flags = np.zeros(geometry.blocks, bool)
    flags[inside[0] @ strides] = True
    spread = geometry.spread(flags)
    assert all(spread[block] == (flags[block] or flags[found[block]].any()) for block in inside @ strides)
