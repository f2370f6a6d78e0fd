import numpy as np
import pytest
import taichi as ti

import taichi_rts as rts
from taichi_rts import backend
from taichi_rts.grid import BlockGrid, Geometry
from taichi_rts.particles import Particles
from taichi_rts.stepping.limiter import BlockLimiter, NeighbourLimiter, Sweep
from taichi_rts.stepping.regions import RegionalSchedule
from taichi_rts.surroundings import Surroundings

EMPTY = BlockLimiter.EMPTY


def random_levels(geometry, n_max=5, seed=0):
    """Levels 1 to n_max inside the domain, a third of the blocks empty, and the margin empty."""
    rng = np.random.default_rng(seed)
    levels = np.full(geometry.shape, EMPTY)
    inside = tuple(slice(1, n - 1) for n in geometry.shape)
    shape = levels[inside].shape
    levels[inside] = np.where(rng.random(shape) < 1 / 3, EMPTY, rng.integers(1, n_max + 1, shape))
    return levels.ravel(order="F").astype(np.int32)


def lowest_neighbour(geometry, levels):
    """Smallest level of the 8 (26) blocks around each block, by coordinates rather than strides."""
    grid = levels.reshape(geometry.shape, order="F")
    padded = np.pad(grid, 1, constant_values=EMPTY)
    lowest = np.full(grid.shape, EMPTY)
    for offset in np.ndindex(*[3] * geometry.dim):
        if offset != (1,) * geometry.dim:
            window = tuple(slice(o, o + n) for o, n in zip(offset, grid.shape, strict=True))
            lowest = np.minimum(lowest, padded[window])
    return lowest.ravel(order="F")


def occupy(grid, blocks):
    """Let somebody be in `blocks` of `grid`, and nobody elsewhere."""
    grid.occupied.from_numpy(np.pad(blocks, (0, grid.geometry.blocks - len(blocks))).astype(np.int32))
    grid.occupied_count[None] = len(blocks)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("jump", [0, 1])
def test_no_block_keeps_more_than_its_neighbours_raw_level_plus_jump(taichi_cpu, dim, jump):
    geometry = Geometry((0,) * dim, (1.1,) * dim, 0.1)
    source, target = ti.field(ti.i32, geometry.blocks), ti.field(ti.i32, geometry.blocks)
    grid = BlockGrid(geometry, 1)
    around = Surroundings(grid)
    sweep = Sweep(BlockLimiter(geometry), source, target, 1, jump)

    @ti.kernel
    def limit():
        around.visit(sweep, True, EMPTY)

    for seed in range(3):
        raw = random_levels(geometry, seed=seed)
        occupied = raw != EMPTY
        occupy(grid, np.nonzero(occupied)[0])
        source.from_numpy(raw)
        target.fill(EMPTY)
        limit()
        limited = target.to_numpy()
        expected = np.minimum(raw, lowest_neighbour(geometry, raw) + jump)
        assert (limited == np.where(occupied, expected, EMPTY)).all()
        assert source.to_numpy().tolist() == raw.tolist()


def apply_minimum_region(schedule, occupied):
    """Run the sweeps of `schedule` over the blocks `occupied`."""
    occupy(schedule.grid, occupied)

    @ti.kernel
    def run():
        schedule.apply_minimum_region()

    run()


@pytest.mark.parametrize("levels", [2, 3, 5])
def test_grading_leaves_jumps_of_one_and_only_lowers(taichi_cpu, levels):
    scene = rts.Scene(domain=rts.Box((0, 0), (2, 1)), fluids=[rts.Block((0, 0), (0.4, 0.4))], spacing=0.05)
    geometry = Geometry((0, 0), (2, 1), scene.support)
    state = Particles(np.zeros((1, 2)), np.zeros((1, 2)), np.ones(1), 1.0, backend.current())
    schedule = RegionalSchedule(rts.Regional(levels=levels, grading=True), scene, state, BlockGrid(geometry, 1))
    raw = random_levels(geometry, n_max=levels)
    occupied = raw != EMPTY
    raw[occupied] = levels
    raw[np.flatnonzero(occupied)[[3, 100]]] = 1  # two fast blocks in a slow fluid
    schedule.own_level.from_numpy(raw)
    apply_minimum_region(schedule, np.flatnonzero(occupied))
    graded = schedule.block_level.to_numpy()
    assert (graded[~occupied] == EMPTY).all()
    assert (graded <= np.minimum(raw, lowest_neighbour(geometry, raw)))[occupied].all()
    assert (graded <= lowest_neighbour(geometry, graded) + 1)[occupied].all()
    assert set(graded[occupied]) == set(range(1, levels + 1))


def settled(limiter, cases):
    """Run `NeighbourLimiter.settled` on rows of wanted step, current step and tick."""
    table = np.array(cases, dtype=np.int32)
    found = np.empty(len(table), dtype=np.int32)

    @ti.kernel
    def run(table: ti.types.ndarray(), found: ti.types.ndarray()):
        for k in range(found.shape[0]):
            found[k] = limiter.settled(table[k, 0], table[k, 1], table[k, 2])

    run(table, found)
    return found.tolist()


def test_steps_shrink_at_once_and_grow_by_one_level_when_synchronised(taichi_cpu):
    doubling, counting = NeighbourLimiter(doubling=True), NeighbourLimiter(doubling=False)
    free = NeighbourLimiter(doubling=True, aligned=False)
    assert settled(doubling, [(1, 8, 3), (8, 8, 3), (8, 2, 4), (8, 2, 6), (4, 2, 2), (8, 1, 2)]) == [1, 8, 4, 2, 2, 2]
    assert settled(counting, [(1, 3, 5), (3, 1, 2), (3, 1, 3), (3, 2, 6), (3, 2, 4)]) == [1, 2, 1, 3, 2]
    assert settled(free, [(9, 3, 7), (5, 3, 7), (2, 3, 7)]) == [6, 5, 2]


def test_a_woken_step_ends_now_or_where_twice_the_neighbours_step_would_have(taichi_cpu):
    limiter = NeighbourLimiter(doubling=True)
    cases = np.array([(0, 8, 3, 1), (0, 8, 3, 2), (0, 8, 1, 1), (4, 2, 4, 1), (0, 3, 2, 5)], dtype=np.int32)
    ends = np.empty(len(cases), dtype=np.int32)

    @ti.kernel
    def run(cases: ti.types.ndarray(), ends: ti.types.ndarray()):
        for k in range(ends.shape[0]):
            ends[k] = limiter.woken_end(cases[k, 0], cases[k, 1], cases[k, 2], cases[k, 3])

    run(cases, ends)
    assert ends.tolist() == [3, 4, 2, 6, 3]


def test_the_limiter_of_regions_halves_the_step_at_most_from_block_to_block(taichi_cpu):
    scene = rts.Scene(domain=rts.Box((0, 0), (2, 1)), fluids=[rts.Block((0, 0), (0.4, 0.4))], spacing=0.05)
    geometry = Geometry((0, 0), (2, 1), scene.support)
    state = Particles(np.zeros((1, 2)), np.zeros((1, 2)), np.ones(1), 1.0, backend.current())
    schedule = RegionalSchedule(rts.Regional(levels=8, limiter=True), scene, state, BlockGrid(geometry, 1))
    raw = random_levels(geometry, n_max=8)
    occupied = raw != EMPTY
    raw[occupied] = 8
    raw[np.flatnonzero(occupied)[[3, 100]]] = 1
    schedule.own_level.from_numpy(raw)
    apply_minimum_region(schedule, np.flatnonzero(occupied))
    limited = schedule.block_level.to_numpy()
    assert (limited[~occupied] == EMPTY).all()
    assert (limited <= np.minimum(raw, lowest_neighbour(geometry, raw)))[occupied].all()
    assert (limited <= 2 * lowest_neighbour(geometry, limited))[occupied].all()
    assert set(limited[occupied]) == {1, 2, 4, 8}
