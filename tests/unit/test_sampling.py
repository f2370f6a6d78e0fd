import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.sampling import calibrate_mass, calibrate_walls, fill_block, line_walls, sample
from taichi_rts.smoothing import make_kernel

S = 0.1
mediums = pytest.mark.parametrize(
    ("kernel", "dim", "ratio"),
    [("cubic_spline", 2, 2.0), ("cubic_spline", 3, 2.0), ("wendland_c2", 2, 2.0), ("wendland_c2", 3, 3.0)],
)


def filled(dim, size=1.0, top=1.0, **changes):
    fields = {"domain": rts.Box((0,) * dim, (size,) * dim), "fluids": [rts.Block((0,) * dim, (top,) * dim)]}
    return rts.Scene(**(fields | {"spacing": S} | changes))


def density(scene, x, with_walls):
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    start = sample(scene)
    rho = start.mass * kernel.sample(np.linalg.norm(x[:, None] - start.positions, axis=2)).sum(axis=1)
    if with_walls:
        w = kernel.sample(np.linalg.norm(x[:, None] - start.wall_positions, axis=2))
        rho += scene.rest_density * (w * start.wall_volumes).sum(axis=1)
    return rho


@mediums
def test_lattice_has_its_rest_density(kernel, dim, ratio):
    scene = filled(dim, kernel=kernel, support_ratio=ratio)
    centre = np.full((1, dim), 0.45)
    assert density(scene, centre, with_walls=False) == pytest.approx(1000.0, rel=1e-12)


def test_without_calibration_wendland_would_be_compressed():
    scene = filled(3, kernel="wendland_c2")
    assert scene.rest_density * S**3 / calibrate_mass(scene) > 1.03


@mediums
def test_walls_complete_the_density_of_a_resting_layer(kernel, dim, ratio):
    scene = filled(dim, kernel=kernel, support_ratio=ratio)
    resting = np.full((1, dim), 0.45)
    resting[0, 1] = 0.5 * S
    assert density(scene, resting, with_walls=False) < 900
    assert density(scene, resting, with_walls=True) == pytest.approx(1000.0, rel=0.006)


@mediums
def test_walls_complete_the_density_exactly(kernel, dim, ratio):
    resting = np.full((1, dim), 0.45)
    resting[0, 1] = 0.5 * S
    scene = filled(dim, kernel=kernel, support_ratio=ratio)
    assert density(scene, resting, with_walls=True) == pytest.approx(1000.0, rel=1e-9)


def test_wall_particles_lie_beyond_the_faces_and_within_reach():
    scene = filled(3)
    positions, volumes = line_walls(scene)
    depth, volume = calibrate_walls(scene)
    outside = np.maximum(-positions, positions - 1.0).max(axis=1)
    np.testing.assert_allclose(outside, depth, rtol=1e-12)
    assert 0 < depth < scene.support - 0.5 * S
    assert len(np.unique(positions.round(9), axis=0)) == len(positions) == 12**3 - 10**3
    np.testing.assert_allclose(volumes, volume, rtol=1e-12)


def test_wall_spacing_adapts_to_the_domain_and_keeps_the_volume_of_a_face():
    scene = filled(2, size=0.93, top=0.5)
    positions, volumes = line_walls(scene)
    _, volume = calibrate_walls(scene)
    floor = (positions[:, 1] < 0) & (positions[:, 0] > 0) & (positions[:, 0] < 0.93)
    assert floor.sum() == 9
    assert volumes[floor].sum() == pytest.approx(volume * 0.93 / S)


def test_scene_without_walls_has_no_wall_particles():
    positions, volumes = line_walls(filled(3, walls=False))
    assert positions.shape == (0, 3)
    assert volumes.shape == (0,)


@pytest.mark.parametrize("top", [0.5, 0.54, 0.55, 0.599])
def test_size_that_is_no_multiple_leaves_a_gap_not_an_overlap(top):
    scene = filled(2, top=top)
    x = fill_block(scene, scene.fluids[0])
    assert len(x) == 25
    assert x.min() == pytest.approx(0.5 * S)
    assert x.max() + 0.5 * S <= top + 1e-9


@pytest.mark.parametrize(("lower", "upper", "first"), [(0.43, 1.0, 0.55), (0.43, 0.98, 0.48), (0.0, 1.0, 0.05)])
def test_lattice_rests_on_the_wall_it_touches(lower, upper, first):
    block = rts.Block((lower, 0.0), (upper, 0.3))
    x = fill_block(filled(2, fluids=[block]), block)
    assert x[:, 0].min() == pytest.approx(first)
    assert x[:, 0].max() + 0.5 * S <= upper + 1e-9


def test_touching_blocks_stay_a_spacing_apart():
    blocks = [rts.Block((0, 0), (0.47, 0.3)), rts.Block((0.47, 0), (1.0, 0.3))]
    x = sample(filled(2, fluids=blocks)).positions
    gaps = np.diff(np.unique(x[:, 0].round(9)))
    assert gaps.min() >= S * (1 - 1e-9)


def test_multiples_that_rounding_blurs_are_filled_completely():
    scene = rts.Scene(domain=rts.Box((0, 0), (3, 2)), fluids=[rts.Block((0, 0), (0.3, 0.7))], spacing=0.1)
    assert len(sample(scene).positions) == 21
    assert len(sample(rts.load_scene("dam_break", spacing=0.05)).positions) == 20 * 20 * 10


def test_velocities_and_order_follow_the_blocks():
    blocks = [rts.Block((0, 0), (0.2, 0.2)), rts.Block((0.5, 0.5), (0.8, 0.6), velocity=(1, -2))]
    start = sample(filled(2, fluids=blocks))
    assert start.velocities.tolist() == [[0, 0]] * 4 + [[1, -2]] * 3
