import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.medium.smoothing import make_kernel
from taichi_rts.sampling.faces import line_walls
from taichi_rts.sampling.sampling import calibrate_mass, sample
from taichi_rts.sampling.walls import calibrate_walls

S = 0.1
mediums = pytest.mark.parametrize(
    ("kernel", "dim", "ratio"),
    [
        ("cubic_spline", 2, 2.0),
        ("cubic_spline", 3, 2.0),
        ("wendland_c2", 2, 2.0),
        ("wendland_c2", 3, 3.0),
        ("cubic_spline", 3, 2.6),
        ("wendland_c2", 2, 4.0),
    ],
)


def filled(dim, size=1.0, top=1.0, **changes):
    fields = {"domain": rts.Box((0,) * dim, (size,) * dim), "fluids": [rts.Block((0,) * dim, (top,) * dim)]}
    return rts.Scene(**(fields | {"spacing": S} | changes))


def density(scene, x, with_walls):
    kernel = make_kernel(scene.kernel, scene.dim, scene.support)
    start = sample(scene)
    rho = start.mass * kernel.sample(np.linalg.norm(x[:, None] - start.positions, axis=2)).sum(axis=1)
    if with_walls:
        w = kernel.sample(np.linalg.norm(x[:, None] - start.walls.positions, axis=2))
        rho += scene.rest_density * (w * start.walls.volumes).sum(axis=1)
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


@mediums
def test_the_walls_density_falls_off_more_steeply_than_the_lattices(kernel, dim, ratio):
    """By 4/3 at r = 2s, and by as much more as the support is wider."""
    scene = filled(dim, kernel=kernel, support_ratio=ratio)
    probes = np.full((2, dim), 0.45)
    probes[:, 1] = 0.5 * S + np.array([-1e-5, 1e-5]) * S
    walls = density(scene, probes, with_walls=True) - density(scene, probes, with_walls=False)
    steps = S * np.arange(-4, 5)
    sides = np.stack(np.meshgrid(*[steps] * (dim - 1)), axis=-1).reshape(-1, dim - 1)
    smooth, mass = make_kernel(kernel, dim, scene.support), sample(scene).mass

    def missing(y):
        planes = [mass * smooth.sample(np.sqrt((sides**2).sum(axis=1) + (y + (k + 0.5) * S) ** 2)) for k in range(4)]
        return np.sum(planes)

    lattice = missing(probes[1, 1]) - missing(probes[0, 1])
    assert (walls[1] - walls[0]) / lattice == pytest.approx(4 / 3 * ratio / 2, rel=1e-4)


@pytest.mark.parametrize(("dim", "ratio"), [(2, 2.0), (3, 2.6), (2, 3.0), (2, 4.0)])
def test_integrated_densities_see_the_whole_lattice_continued_in_corners_too(dim, ratio):
    scene = filled(dim, kernel="wendland_c2", support_ratio=ratio, density="continuity")
    corner = np.full((1, dim), 0.5 * S)
    assert density(scene, corner, with_walls=True) == pytest.approx(1000.0, rel=1e-9)
    layer, _ = line_walls(scene)
    planes = {2.0: 1, 2.6: 2, 3.0: 2, 4.0: 3}[ratio]
    assert len(layer.positions) == (10 + 2 * planes) ** dim - 10**dim
    assert len(np.unique(layer.positions.round(9), axis=0)) == len(layer.positions)
    outside = np.where(layer.normals > 0, -layer.positions, np.where(layer.normals < 0, layer.positions - 1.0, 0.0))
    np.testing.assert_allclose(outside.sum(axis=1), layer.depths, rtol=1e-12)
    assert set(layer.depths.round(9)) == {round((k + 0.5) * S, 9) for k in range(planes)}
    assert layer.depths.max() < scene.support  # so that none lies beyond the grid's margin


def test_no_plane_lies_out_of_reach_or_beyond_the_grids_margin():
    for kernel in ("cubic_spline", "wendland_c2"):
        layer, _ = line_walls(filled(2, kernel=kernel, support_ratio=4.0))
        assert layer.depths.max() < 4.0 * S
        assert len(set(layer.depths)) == 2  # the first is 2.1 spacings deep, a third would be out of reach


def wall_particles(scene):
    layer, owners = line_walls(scene)
    assert (owners == -1).all()
    return layer.positions, layer.volumes


def test_wall_particles_lie_beyond_the_faces_and_within_reach():
    scene = filled(3)
    positions, volumes = wall_particles(scene)
    depth, volume = calibrate_walls(scene)
    outside = np.maximum(-positions, positions - 1.0).max(axis=1)
    np.testing.assert_allclose(outside, depth, rtol=1e-12)
    assert 0 < depth < scene.support - 0.5 * S
    assert len(np.unique(positions.round(9), axis=0)) == len(positions) == 12**3 - 10**3
    np.testing.assert_allclose(volumes, volume, rtol=1e-12)


def test_wall_spacing_adapts_to_the_domain_and_keeps_the_volume_of_a_face():
    scene = filled(2, size=0.93, top=0.5)
    positions, volumes = wall_particles(scene)
    _, volume = calibrate_walls(scene)
    floor = (positions[:, 1] < 0) & (positions[:, 0] > 0) & (positions[:, 0] < 0.93)
    assert floor.sum() == 9
    assert volumes[floor].sum() == pytest.approx(volume * 0.93 / S)


def test_scene_without_walls_has_no_wall_particles():
    positions, volumes = wall_particles(filled(3, walls=False))
    assert positions.shape == (0, 3)
    assert volumes.shape == (0,)


@pytest.mark.parametrize("top", [0.5, 0.54, 0.55, 0.599])
def test_size_that_is_no_multiple_leaves_a_gap_not_an_overlap(top):
    scene = filled(2, top=top)
    x = scene.fluids[0].fill((scene.spacing,) * 2, scene.domain)
    assert len(x) == 25
    assert x.min() == pytest.approx(0.5 * S)
    assert x.max() + 0.5 * S <= top + 1e-9


@pytest.mark.parametrize(("lower", "upper", "first"), [(0.43, 1.0, 0.55), (0.43, 0.98, 0.48), (0.0, 1.0, 0.05)])
def test_lattice_rests_on_the_wall_it_touches(lower, upper, first):
    block = rts.Block((lower, 0.0), (upper, 0.3))
    x = block.fill((S, S), rts.Box((0, 0), (1, 1)))
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


@pytest.mark.parametrize(("dim", "count"), [(2, 52), (3, 304)])
def test_sphere_is_filled_symmetrically_about_its_centre(dim, count):
    centre = (0.43, 0.52, 0.5)[:dim]
    sphere = rts.Sphere(centre, 0.42)
    offsets = sphere.fill((S,) * dim, rts.Box((0,) * dim, (1,) * dim)) - centre
    assert len(offsets) == count
    assert count * S**dim == pytest.approx(sphere.volume, rel=0.1)
    assert np.linalg.norm(offsets, axis=1).max() <= 0.42
    np.testing.assert_allclose(offsets.mean(axis=0), 0, atol=1e-15)
    assert set(np.abs(offsets).ravel().round(9)) == {0.05, 0.15, 0.25, 0.35}
    places = {tuple(x) for x in offsets.round(9).tolist()}
    assert len(places) == count
    assert {x[::-1] for x in places} == {(-x[0], *x[1:]) for x in places} == places


def test_smallest_sphere_has_a_particle_in_each_quadrant():
    sphere = rts.Sphere((0.5, 0.5), S)
    assert len(sphere.fill((S, S), rts.Box((0, 0), (1, 1)))) == 4


@pytest.mark.parametrize("touching", [0.0, 1e-12])
def test_sphere_touching_a_block_keeps_half_a_spacing(touching):
    fluids = [rts.Block((0, 0), (1, 0.3)), rts.Sphere((0.5, 0.553 - touching), 0.253)]
    x = sample(filled(2, fluids=fluids)).positions
    gaps = np.linalg.norm(x[:, None] - x, axis=2)[~np.eye(len(x), dtype=bool)]
    assert gaps.min() >= 0.5 * S


def test_a_linear_velocity_is_evaluated_at_each_particle():
    field = rts.LinearField(((-3, 1), (0, 4)), value=(5, 0), origin=(0.5, 0.5))
    fluids = [rts.Block((0, 0), (1, 0.1)), rts.Sphere((0.5, 0.5), 0.2, velocity=field)]
    start = sample(filled(2, fluids=fluids))
    x, y = (start.positions[10:] - 0.5).T
    assert start.velocities[:10].tolist() == [[0, 0]] * 10
    np.testing.assert_allclose(start.velocities[10:], np.stack([5 - 3 * x + y, 4 * y], axis=1), rtol=1e-12, atol=1e-15)
    block = rts.Block((0, 0), (0.2, 0.1), velocity=field)
    moving = sample(filled(2, fluids=[block])).velocities
    np.testing.assert_allclose(moving, [[5.9, -1.8], [5.6, -1.8]], rtol=1e-12)
