"""Rows of particles that fit their fluids: volumes, faces, and the density that such a lattice has at rest."""

import itertools

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.medium.smoothing import make_kernel
from taichi_rts.sampling.filling import filling
from taichi_rts.sampling.sampling import sample
from taichi_rts.scene.rows import fit_rows

S = 0.1
MULTIPLES = ("dam_break", "dam_break_2d", "still_pool", "taylor_green", "koshizuka_oka", "martin_moyce", "free_fall")


def scene(*fluids, size=(3.22, 1.0), **changes):
    return rts.Scene(domain=rts.Box((0.0,) * len(size), size), fluids=fluids, spacing=S, **changes)


def pool(*size, **changes):
    """Water that fills a tank from wall to wall, `size[1]` deep."""
    return scene(rts.Block((0,) * len(size), size), size=(size[0], 2.0, *size[2:]), **changes)


def gaps(made):
    x = sample(made).positions
    return np.linalg.norm(x[:, None] - x, axis=2)[~np.eye(len(x), dtype=bool)]


def density(made, x):
    """Density [kg/m^3] at `x`, (M, dim), summed over fluid and walls."""
    kernel, start = make_kernel(made.kernel, made.dim, made.support), sample(made)
    fluid = kernel.sample(np.linalg.norm(x[:, None] - start.positions, axis=2)).sum(axis=1)
    walls = kernel.sample(np.linalg.norm(x[:, None] - start.walls.positions, axis=2)) @ start.walls.volumes
    return start.mass * fluid + made.rest_density * walls


@pytest.mark.parametrize("name", MULTIPLES)
def test_multiples_of_the_spacing_keep_every_bit(name):
    made = rts.load_scene(name)
    rows = fit_rows(made)
    assert rows.steps == (made.spacing,) * made.dim
    assert rows.fluids == made.fluids
    assert filling(made).facts(made.spacing) == []
    (block,) = made.fluids
    axes = [
        a + (np.arange(round((b - a) / made.spacing)) + 0.5) * made.spacing
        for a, b in zip(block.lower, block.upper, strict=True)
    ]
    expected = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, made.dim)
    if not made.hydrostatic:
        np.testing.assert_array_equal(sample(made).positions, expected)


def test_a_block_that_is_no_multiple_keeps_its_volume():
    made = scene(rts.Block((0, 0), (1.29, 0.59)))
    assert fit_rows(made).steps == pytest.approx((1.29 / 13, 0.59 / 6))
    start, found = sample(made), filling(made)
    assert len(start.positions) == 13 * 6
    assert found.filled == pytest.approx(0.7611, rel=1e-12)
    assert len(start.positions) * start.mass == pytest.approx(761.1, rel=0.005)  # was 600
    assert found.rounded == ()
    assert found.facts(S) == [("rows", "0.09923 x 0.09833 m apart, so that they fit; particles' mass follows")]


@pytest.mark.parametrize("count", ["300", "1k", "3k", "10k"])
@pytest.mark.parametrize("name", ["dam_break", "dam_break_2d", "still_pool"])
def test_a_count_of_particles_loses_no_water(name, count):
    made = rts.load_scene(name, particles=count)
    wanted = float(count.replace("k", "e3"))
    found, start = filling(made), sample(made)
    assert abs(found.gain) < 0.045  # was up to 0.14; half a layer of 300 particles is 0.12
    assert abs(len(start.positions) / wanted - 1.0) < 0.085  # a row more of 6 is 17 %, in three dimensions
    assert max(abs(step / made.spacing - 1.0) for step in found.steps) < 0.1


@pytest.mark.parametrize(
    ("size", "step"), [((1.04, 0.6), 0.104), ((0.96, 0.6), 0.096), ((2.05, 0.55, 0.74), 0.1025), ((0.36, 0.6), 0.12)]
)
@pytest.mark.parametrize("kind", [{}, {"density": "continuity"}, {"kernel": "wendland_c2", "support_ratio": 3.0}])
def test_between_walls_rows_leave_no_gap_and_do_not_press_on_them(size, step, kind):
    made = pool(*size, **kind)
    steps = fit_rows(made).steps
    assert steps[0] == pytest.approx(step)
    x = sample(made).positions
    np.testing.assert_allclose(x.min(axis=0), np.array(steps) / 2, rtol=1e-9)
    np.testing.assert_allclose(x.max(axis=0)[[0, *range(2, made.dim)]], (np.array(size) - np.array(steps) / 2)[::2])
    if size[0] < 0.9 or len(size) == 3 or made.support_ratio > 2.0:  # where corners or the surface are in reach of all
        return
    middle = np.array([4.5 * step, 2.5 * steps[1]])
    floor, side = np.array([middle[0], 0.5 * steps[1]]), np.array([0.5 * step, middle[1]])
    assert density(made, np.array([middle, floor, side])) == pytest.approx(1000.0, rel=1e-9)


def test_a_tank_of_less_than_two_rows_keeps_its_gap_and_says_so():
    found = filling(pool(0.16, 0.5))
    assert found.rounded == ("fluids.0: size rounded to 0.1 x 0.5 m, from 0.16 x 0.5 m",)
    assert found.gain == pytest.approx(0.1 / 0.16 - 1.0)
    assert ("volume", "0.05 of 0.08 m^2 asked for (-37.5%)") in found.facts(S)


def test_layers_that_fill_a_tank_keep_a_common_face():
    lower, upper = rts.Block((0, 0), (1, 0.55)), rts.Block((0, 0.55), (1, 1.03))
    made = scene(lower, upper, size=(1.0, 1.03))
    one, two = fit_rows(made).fluids
    assert one.upper[1] == two.lower[1] == pytest.approx(5 * 0.103)
    assert two.upper[1] == pytest.approx(1.03)
    assert len(sample(made).positions) == 100
    assert gaps(made).min() == pytest.approx(0.1)
    assert filling(made).filled == pytest.approx(1.03)
    assert filling(made).rounded[0] == "fluids.0: size rounded to 1 x 0.515 m, from 1 x 0.55 m"


def test_a_block_below_a_sphere_may_only_shrink():
    made = scene(rts.Block((0, 0), (1, 0.57)), rts.Block((1.5, 0), (2.5, 0.3)), rts.Sphere((0.5, 0.78), 0.2))
    assert fit_rows(made).fluids[0].upper[1] <= 0.57 + 1e-12
    assert gaps(made).min() >= 0.5 * S


def test_particles_given_one_by_one_keep_the_spacings_mass():
    given = rts.Particles(np.array([[2.0, 0.5]]))
    made = scene(rts.Block((0, 0), (1.29, 0.59)), given)
    assert fit_rows(made).steps == (S, S)
    assert filling(made).rounded == ("fluids.0: size rounded to 1.2 x 0.5 m, from 1.29 x 0.59 m",)
    assert filling(made).filled == pytest.approx(0.6 + S**2)


def random_scene(seed):
    """Blocks beside and on top of each other, some at walls; none is a multiple of the spacing."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(1.5, 4.0, 2)
    columns = np.cumsum(rng.uniform(0.25, 1.0, 4))
    columns = np.concatenate([[0.0], columns[columns < size[0] - 0.2], [size[0]]])
    fluids = []
    for a, b in itertools.pairwise(columns):
        bottom = rng.choice([0.0, rng.uniform(0.0, 0.4)])
        while (top := bottom + rng.uniform(0.15, 0.7)) < size[1]:
            if rng.random() < 0.7:
                fluids.append(rts.Block((a, bottom), (b, top)))
            bottom = top + rng.choice([0.0, rng.uniform(0.0, 0.3)])
        if size[1] - bottom > 0.15 and rng.random() < 0.5:
            fluids.append(rts.Block((a, bottom), (b, size[1])))
    return rts.Scene(domain=rts.Box((0, 0), size), fluids=fluids, spacing=S) if fluids else random_scene(seed + 1000)


@pytest.mark.parametrize("seed", range(60))
def test_no_rows_overlap_or_leave_the_domain(seed):
    made = random_scene(seed)
    rows = fit_rows(made)
    x = sample(made).positions
    steps = np.array(rows.steps)
    assert (np.abs(steps / S - 1.0) <= 0.1).all()
    assert (x >= 0.5 * steps - 1e-9).all()
    assert (x <= np.array(made.domain.upper) - 0.5 * steps + 1e-9).all()
    assert gaps(made).min() >= 0.49 * S  # blocks side by side may have their own heights, not their own columns
    for asked, got in zip(made.fluids, rows.fluids, strict=True):
        for d in range(2):
            assert abs(got.lower[d] - asked.lower[d]) <= steps[d] * 1.000001
            assert abs(got.upper[d] - asked.upper[d]) <= steps[d] * 1.000001


@pytest.mark.parametrize("spacing", [0.31, 1.0, 1e6, 1e-12])
def test_an_impossible_spacing_is_still_the_scenes_own_error(spacing):
    with pytest.raises(rts.SceneError, match=r"spacing: "):
        scene(rts.Block((0, 0), (1.29, 0.3)), rts.Block((2, 0), (2.57, 0.59))).replace(spacing=spacing)
