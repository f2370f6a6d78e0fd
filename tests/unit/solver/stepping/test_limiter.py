import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.device import backend
from taichi_rts.device.backend import ti
from taichi_rts.solver.grid.geometry import Geometry
from taichi_rts.solver.grid.grid import BlockGrid
from taichi_rts.solver.grid.surroundings import Surroundings
from taichi_rts.solver.particles.particles import FluidState
from taichi_rts.solver.stepping.limiter import EMPTY, Ladder, NeighbourLimiter, Sweep
from taichi_rts.solver.stepping.settled import lengths


@pytest.fixture(scope="module")
def started(start_taichi, quick):
    with start_taichi("cpu", "f32", **quick) as device:
        yield device


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
    """Let there be particles in `blocks` of `grid`, and none elsewhere."""
    grid.occupied.from_numpy(np.pad(blocks, (0, grid.geometry.blocks - len(blocks))).astype(np.int32))
    grid.occupied_count[None] = len(blocks)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("jump", [0, 1])
def test_no_block_keeps_more_than_its_neighbours_raw_level_plus_jump(started, dim, jump):
    geometry = Geometry((0,) * dim, (1.1,) * dim, 0.1)
    source, target = ti.field(ti.i32, geometry.blocks), ti.field(ti.i32, geometry.blocks)
    grid = BlockGrid(geometry, 1)
    around = Surroundings(grid)

    @ti.func
    def most(level):
        return level + jump

    sweep = Sweep(source, target, most)

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


SCENE = rts.Scene(domain=rts.Box((0, 0), (2, 1)), fluids=[rts.Block((0, 0), (0.4, 0.4))], spacing=0.05)


def levels_from(stepper, raw_levels, ticks=1):
    """What blocks allow themselves, which are occupied, and the levels that `stepper` gives them at each of `ticks` steps."""
    geometry = Geometry((0, 0), (2, 1), SCENE.support)
    state = FluidState(np.zeros((1, 2)), np.zeros((1, 2)), np.ones(1), 1.0, backend.current())
    schedule = stepper.schedule(SCENE, state, BlockGrid(geometry, 1), stepper.timeline(SCENE))
    raw = random_levels(geometry, n_max=1)
    occupied = raw != EMPTY
    raw[occupied] = raw_levels(np.count_nonzero(occupied))
    schedule.raw_level.from_numpy(raw)
    occupy(schedule.grid, np.flatnonzero(occupied))

    @ti.kernel
    def run(now: ti.i32):
        schedule.note_time(now, 1)
        if ti.static(schedule.keeps_last):
            for block in range(schedule.blocks):
                schedule.last_level[block] = schedule.block_level[block]
        schedule.apply_minimum_region()

    found = []
    for now in range(ticks):
        run(now)
        found.append(schedule.block_level.to_numpy())
    assert (found[-1][~occupied] == EMPTY).all()
    return geometry, raw, occupied, found


def two_fast_blocks(slow):
    def raw(count):
        levels = np.full(count, slow)
        levels[[3, 100]] = 1
        return levels

    return raw


@pytest.mark.parametrize("steps", ["integers", "half_octaves", "powers_of_two"])
@pytest.mark.parametrize("levels", [3, 8, *(pytest.param(levels, marks=pytest.mark.slow) for levels in (2, 5))])
def test_grading_leaves_jumps_of_one_level_and_only_lowers(started, levels, steps):
    members = np.array(lengths(steps, levels))
    stepper = rts.Regional(levels=levels, grading=True, steps=steps, limiter=False)
    geometry, raw, occupied, (graded,) = levels_from(stepper, two_fast_blocks(members[-1]))
    lowest = lowest_neighbour(geometry, graded)
    assert (graded <= np.minimum(raw, lowest_neighbour(geometry, raw)))[occupied].all()
    above = np.append(members[1:], members[-1])
    for block in np.flatnonzero(occupied & (lowest != EMPTY)):
        assert graded[block] <= above[members.tolist().index(lowest[block])]
    assert set(graded[occupied]) == set(members)


@pytest.mark.parametrize("steps", ["integers", "half_octaves", "powers_of_two"])
def test_a_frozen_state_keeps_a_fixed_pattern_of_levels(started, steps):
    stepper = rts.Regional(levels=12, steps=steps, limiter=True)
    geometry, raw, occupied, found = levels_from(stepper, two_fast_blocks(lengths(steps, 12)[-1]), ticks=200)
    settled_pattern = found[48]  # every level has been a divisor of a tick since then, and again
    for levels in found[48:]:
        assert levels.tolist() == settled_pattern.tolist()
    assert (settled_pattern <= 2 * lowest_neighbour(geometry, settled_pattern))[occupied].all()
    # As far as R_min reaches, from what blocks allow themselves and no further.
    ones = (raw == 1) | ((lowest_neighbour(geometry, raw) == 1) & occupied)
    assert ((settled_pattern == 1) == ones).all()
    assert settled_pattern[occupied].max() == lengths(steps, 12)[-1]


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


def test_levels_shrink_at_once_and_grow_by_one_when_synchronised_and_the_blocks_beside_allow_it(started):
    ladder = Ladder(lengths("half_octaves", 12))
    rows = [
        (1, 8, EMPTY, 3, 1),  # wanted, before, least beside, tick: level
        (8, 8, EMPTY, 3, 8),
        (8, 2, EMPTY, 3, 3),
        (8, 2, EMPTY, 4, 2),
        (8, 4, EMPTY, 12, 6),
        (8, 4, 3, 12, 6),
        (8, 4, 2, 12, 4),
        (12, 12, 1, 12, 12),  # which the sweeps lower, not growth
        (12, 8, EMPTY, 24, 12),
    ]
    table = np.array(rows, dtype=np.int32)
    found = np.empty(len(rows), dtype=np.int32)

    @ti.func
    def twice(level):
        return 2 * level

    @ti.kernel
    def run(table: ti.types.ndarray(), found: ti.types.ndarray()):
        for k in range(found.shape[0]):
            found[k] = ladder.grown(table[k, 0], table[k, 1], table[k, 2], table[k, 3], twice)

    run(table, found)
    assert found.tolist() == table[:, 4].tolist()


def test_steps_shrink_at_once_and_grow_by_one_level_when_synchronised(started):
    doubling, free = NeighbourLimiter(), NeighbourLimiter(aligned=False)
    assert settled(doubling, [(1, 8, 3), (8, 8, 3), (8, 2, 4), (8, 2, 6), (4, 2, 2), (8, 1, 2)]) == [1, 8, 4, 2, 2, 2]
    assert settled(free, [(9, 3, 7), (5, 3, 7), (2, 3, 7)]) == [6, 5, 2]


def test_a_woken_step_ends_now_or_where_twice_the_neighbours_step_would_have(started):
    limiter = NeighbourLimiter()
    cases = np.array([(0, 8, 3, 1), (0, 8, 3, 2), (0, 8, 1, 1), (4, 2, 4, 1), (0, 3, 2, 5)], dtype=np.int32)
    ends = np.empty(len(cases), dtype=np.int32)

    @ti.kernel
    def run(cases: ti.types.ndarray(), ends: ti.types.ndarray()):
        for k in range(ends.shape[0]):
            ends[k] = limiter.woken_end(cases[k, 0], cases[k, 1], cases[k, 2], cases[k, 3])

    run(cases, ends)
    assert ends.tolist() == [3, 4, 2, 6, 3]


def test_the_limiter_of_regions_halves_the_step_at_most_from_block_to_block(started):
    geometry, raw, occupied, (limited,) = levels_from(rts.Regional(levels=8, limiter=True), two_fast_blocks(8))
    assert (limited <= np.minimum(raw, lowest_neighbour(geometry, raw)))[occupied].all()
    assert (limited <= 2 * lowest_neighbour(geometry, limited))[occupied].all()
    assert set(limited[occupied]) == {1, 2, 4, 8}
