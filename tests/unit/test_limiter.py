import numpy as np
import pytest
import taichi as ti

import taichi_rts as rts
from taichi_rts import backend
from taichi_rts.grid import BlockGrid, Geometry
from taichi_rts.particles import Particles
from taichi_rts.stepping.limiter import BlockLimiter
from taichi_rts.stepping.regional import RegionalSchedule

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


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("jump", [0, 1])
def test_no_block_keeps_more_than_its_neighbours_raw_level_plus_jump(taichi_cpu, dim, jump):
    geometry = Geometry((0,) * dim, (1.1,) * dim, 0.1)
    source, target = ti.field(ti.i32, geometry.blocks), ti.field(ti.i32, geometry.blocks)
    limiter = BlockLimiter(geometry)
    for seed in range(3):
        raw = random_levels(geometry, seed=seed)
        source.from_numpy(raw)
        limiter.limit(source, target, 1, jump)
        limited = target.to_numpy()
        occupied = raw != EMPTY
        expected = np.minimum(raw, lowest_neighbour(geometry, raw) + jump)
        assert (limited == np.where(occupied, expected, EMPTY)).all()
        assert source.to_numpy().tolist() == raw.tolist()


@pytest.mark.parametrize("levels", [2, 3, 5])
def test_grading_leaves_jumps_of_one_and_only_lowers(taichi_cpu, levels):
    scene = rts.Scene(domain=rts.Box((0, 0), (2, 1)), fluids=[rts.Block((0, 0), (0.4, 0.4))], spacing=0.05)
    geometry = Geometry((0, 0), (2, 1), scene.support)
    state = Particles(np.zeros((1, 2)), np.zeros((1, 2)), 1000.0, backend.current())
    schedule = RegionalSchedule(rts.Regional(levels=levels, grading=True), scene, state, BlockGrid(geometry, 1))
    raw = random_levels(geometry, n_max=levels)
    occupied = raw != EMPTY
    raw[occupied] = levels
    raw[np.flatnonzero(occupied)[[3, 100]]] = 1  # two fast blocks in a slow fluid
    schedule.raw_level.from_numpy(raw)
    schedule.apply_minimum_region()
    graded = schedule.block_level.to_numpy()
    assert (graded[~occupied] == EMPTY).all()
    assert (graded <= np.minimum(raw, lowest_neighbour(geometry, raw)))[occupied].all()
    assert (graded <= lowest_neighbour(geometry, graded) + 1)[occupied].all()
    assert set(graded[occupied]) == set(range(1, levels + 1))
