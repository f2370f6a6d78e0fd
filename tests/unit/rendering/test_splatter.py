import numpy as np
import pytest

from taichi_rts.device import backend
from taichi_rts.device.backend import ti
from taichi_rts.errors import RenderError
from taichi_rts.rendering import splat_kernels
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.splatter import Splatter, linear_to_srgb, srgb_to_linear

WIDTH, HEIGHT = 160, 120
FRONT = Camera((0, 0, 10), (0, 0, 0), field_of_view=30.0)
RED, BLUE, GREY = (0.9, 0.1, 0.1), (0.1, 0.1, 0.9), (0.5, 0.5, 0.5)


@pytest.fixture(scope="module")
def splatter(start_taichi, quick):
    """One for all tests but the last two, which start Taichi anew."""
    with start_taichi("cpu", "f32", **quick):
        yield Splatter(WIDTH, HEIGHT, supersample=2)


def covered(picture):
    return (picture != 255).any(axis=2)


def cloud(count, seed=0):
    random = np.random.default_rng(seed)
    return random.uniform(-1.5, 1.5, (count, 3)), random.uniform(0, 1, (count, 3))


def test_nearest_of_two_overlapping_spheres_wins_in_either_order(splatter):
    near, far = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
    for positions, colours in (((near, far), (RED, BLUE)), ((far, near), (BLUE, RED))):
        middle = splatter.draw(np.array(positions), np.array(colours), 0.5, FRONT)[HEIGHT // 2, WIDTH // 2]
        assert middle[0] > 2 * middle[2]


def test_spheres_that_intersect_are_cut_where_they_meet(splatter):
    positions, colours = np.array([[-0.3, 0, 0], [0.3, 0, 0]]), np.array([RED, BLUE])
    row = splatter.draw(positions, colours, 0.8, FRONT)[HEIGHT // 2].astype(int)
    inside = covered(row[None])[0]
    red = inside & (row[:, 0] > row[:, 2])
    assert red[: WIDTH // 2 - 1].sum() == inside[: WIDTH // 2 - 1].sum()
    assert red[WIDTH // 2 + 1 :].sum() == 0


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.1, -0.7, 1.0)])
def test_area_of_a_sphere_is_pi_r_squared(splatter, place):
    picture = splatter.draw(np.array([place]), np.array([GREY]), 0.6, FRONT)
    _, _, depth = FRONT.project(np.array([place]), WIDTH, HEIGHT)[0]
    radius = 0.6 * FRONT.focal_pixels(HEIGHT) / depth
    # pixels partly covered count half, since about half of a pixel on the rim is covered
    bare = picture.sum(axis=2) / 3
    dark = covered(picture)
    rim = dark & (bare > bare[dark].min() + 0.75 * (255 - bare[dark].min()))
    assert dark.sum() - 0.5 * rim.sum() == pytest.approx(np.pi * radius**2, rel=0.05)
    rows, columns = np.nonzero(dark)
    x, y, _ = FRONT.project(np.array([place]), WIDTH, HEIGHT)[0]
    assert columns.mean() + 0.5 == pytest.approx(x, abs=0.5)
    assert rows.mean() + 0.5 == pytest.approx(y, abs=0.5)


def test_two_draws_give_the_same_bits_even_with_ties(splatter):
    positions, colours = cloud(3000)
    positions, colours = np.concatenate([positions, positions]), np.concatenate([colours, colours[::-1]])
    box = ((-1.5,) * 3, (1.5,) * 3)
    first = splatter.draw(positions, colours, 0.08, FRONT, box)
    assert np.array_equal(first, splatter.draw(positions, colours, 0.08, FRONT, box))
    assert np.array_equal(first, Splatter(WIDTH, HEIGHT).draw(positions, colours, 0.08, FRONT, box))
    # of equal depths the lower index wins, so the doubles, which come second, never show
    assert np.array_equal(first, splatter.draw(positions[:3000], colours[:3000], 0.08, FRONT, box))


def test_number_of_particles_may_change(splatter):
    positions, colours = cloud(2000)
    fresh = Splatter(WIDTH, HEIGHT).draw(positions[:500], colours[:500], 0.1, FRONT)
    for count in (1, 500, 2000, 0, 500):
        drawn = splatter.draw(positions[:count], colours[:count], 0.1, FRONT)
        assert count != 500 or np.array_equal(drawn, fresh)
        assert covered(drawn).any() == (count > 0)


def test_what_is_behind_beside_or_not_a_number_draws_nothing(splatter):
    places = [[0, 0, 11], [0, 0, 10], [90, 0, 0], [0, -1e9, 0], [np.nan, 0, 0], [0, np.inf, 0]]
    picture = splatter.draw(np.array(places), np.tile(RED, (6, 1)), 0.1, FRONT)
    assert not covered(picture).any()


def test_colour_survives_the_light(splatter):
    picture = splatter.draw(np.zeros((1, 3)), np.array([RED]), 1.5, FRONT)
    mean = picture[covered(picture)].mean(axis=0) / 255
    assert mean[0] > 0.6
    assert mean[1] < 0.35
    assert mean[2] < 0.35


def test_background(splatter):
    picture = Splatter(32, 24, background=(0.2, 0.4, 0.6)).draw(np.zeros((0, 3)), np.zeros((0, 3)), 1.0, FRONT)
    assert np.all(picture == (51, 102, 153))


def test_outline_is_drawn_in_front_and_faint_behind(splatter):
    box = ((-1, -1, -1), (1, 1, 1))
    none = np.zeros((0, 3))
    bare = splatter.draw(none, none, 0.1, FRONT, box)
    corners = FRONT.project(np.array([[1, 1, 1], [1, -1, 1], [1, 1, -1], [1, -1, -1]], float), WIDTH, HEIGHT)
    near, far = int(corners[0, 0]), int(corners[2, 0])  # columns of the near and the far upright edge
    middle = HEIGHT // 2
    assert bare[middle, near - 1 : near + 2].min() < 205
    assert bare[middle, far - 1 : far + 2].min() < 205
    wall = np.array([[0.9, 0.0, 0.0]])
    picture = splatter.draw(wall, np.array([(0.7, 0.7, 0.7)]), 0.5, FRONT, box)
    row = picture[middle].astype(int).sum(axis=1)

    def dip(column):
        return max(row[column - 3], row[column + 3]) - row[column - 1 : column + 2].min()

    assert dip(near) > 2 * max(dip(far), 1)


def test_fluid_above_the_floor_casts_a_shadow_on_it(splatter):
    camera = Camera.framing((-1, -1, -1), (1, 1, 1), aspect=WIDTH / HEIGHT, elevation=35)
    box, ball = ((-1, -1, -1), (1, 1, 1)), np.array([[0.0, -0.5, 0.0]])
    with_shadow = splatter.draw(ball, np.array([RED]), 0.4, camera, box).astype(int)
    bare = Splatter(WIDTH, HEIGHT, shadows=False).draw(ball, np.array([RED]), 0.4, camera, box).astype(int)
    change = bare - with_shadow
    grey = (np.ptp(with_shadow, axis=2) < 12) & (change.min(axis=2) > 25)
    assert 50 < grey.sum() < 0.2 * WIDTH * HEIGHT


def test_a_block_is_darker_under_one_that_floats_above_it(splatter):
    side = 0.05 * np.arange(12)
    slab = np.stack(np.meshgrid(side, [0.0], side, indexing="ij"), axis=-1).reshape(-1, 3)
    lid = slab[(np.abs(slab - 0.275) < 0.16)[:, [0, 2]].all(axis=1)] + (0.0, 0.2, 0.0)
    box = ((0, 0, 0), (0.55, 0.5, 0.55))
    camera = Camera.framing(*box, elevation=15, aspect=WIDTH / HEIGHT)
    open_, covered_ = (
        splatter.draw(points, np.full_like(points, 0.7), 0.03, camera, box).astype(float)
        for points in (slab, np.concatenate([slab, lid]))
    )
    x, y, _ = camera.project(np.array([[0.275, 0.03, 0.35]]), WIDTH, HEIGHT)[0].astype(int)
    patch = np.s_[y - 2 : y + 3, x - 2 : x + 3]
    assert covered_[patch].mean() < 0.85 * open_[patch].mean()
    plain = Splatter(WIDTH, HEIGHT, quality="draft")
    bare = [plain.draw(p, np.full_like(p, 0.7), 0.03, camera, box)[patch] for p in (slab, np.concatenate([slab, lid]))]
    assert np.array_equal(*bare)


def test_without_box_and_floor_there_is_nothing_but_spheres(splatter):
    positions, colours = cloud(40)
    box = ((-3, -3, -3), (3, 3, 3))
    whole = covered(splatter.draw(positions, colours, 0.1, FRONT, box))
    bare = covered(splatter.draw(positions, colours, 0.1, FRONT, box, box=False, floor=False))
    edges = covered(splatter.draw(positions, colours, 0.1, FRONT, box, floor=False))
    alone = covered(splatter.draw(positions, colours, 0.1, FRONT))
    assert np.array_equal(bare, alone)
    assert 0.01 < bare.mean() < edges.mean() < whole.mean()


@pytest.mark.parametrize(("quality", "shades"), [("draft", 0), ("good", 3), ("best", 8)])
def test_edges_have_intermediate_values(splatter, quality, shades):
    camera = Camera((0, 0, 10), (0, 0, 0), field_of_view=30.0)
    clear = Splatter(WIDTH, HEIGHT, quality=quality, transparent=True)
    alpha = clear.draw(np.zeros((1, 3)), np.array([GREY]), 1.5, camera)[..., 3]
    between = np.unique(alpha[(alpha > 0) & (alpha < 255)])
    assert len(between) >= shades
    assert len(between) < clear.supersample**2
    assert alpha.sum() / 255 == pytest.approx(np.pi * (1.5 * camera.focal_pixels(HEIGHT) / 10) ** 2, rel=0.02)


def test_transparent_picture_over_white_is_the_opaque_one(splatter):
    positions, colours = cloud(300)
    box = ((-1.5,) * 3, (1.5,) * 3)
    camera = Camera.framing(*box, elevation=30, aspect=WIDTH / HEIGHT)
    clear = Splatter(WIDTH, HEIGHT, transparent=True).draw(positions, colours, 0.15, camera, box)
    solid = splatter.draw(positions, colours, 0.15, camera, box)
    assert clear[0, 0].tolist()[3] == 0
    assert clear[..., 3].max() == 255
    ground = (clear[..., 3] > 0) & (clear[..., :3] == 0).all(axis=2)
    assert ground.sum() > 100  # shadows and floor are black of little opacity
    alpha = clear[..., 3:] / 255
    over = linear_to_srgb(srgb_to_linear(clear[..., :3] / 255) * alpha + 1 - alpha) * 255
    assert np.abs(over - solid).max() <= 3


def test_spheres_far_away_are_nearer_to_the_background(splatter):
    box = ((-1, -1, -4), (1, 1, 4))
    camera = Camera((0, 0, 12), (0, 0, 0), orthographic_height=2.0)
    draw = [splatter.draw(np.array([[0, 0, z]]), np.array([RED]), 0.5, camera, box) for z in (3.0, -3.0)]
    near, far = (picture[HEIGHT // 2, WIDTH // 2].astype(int) for picture in draw)
    assert (far[1:] > near[1:] + 10).all()


def test_no_hidden_sphere_is_missed(splatter, monkeypatch):
    positions, colours = cloud(20000, seed=3)
    tiled = splatter.draw(positions, colours, 0.1, FRONT)
    monkeypatch.setattr(splat_kernels, "STRIDES", (1,))  # then nothing is hidden before all are drawn
    assert np.array_equal(tiled, splatter.draw(positions, colours, 0.1, FRONT))


def test_plane_positions_are_discs(splatter):
    camera = Camera.framing((0, 0), (3, 2), aspect=WIDTH / HEIGHT)
    picture = splatter.draw(np.array([[1.0, 0.5]]), np.array([BLUE]), 0.3, camera)
    rows, columns = np.nonzero(covered(picture))
    x, y, _ = camera.project(np.array([[1.0, 0.5]]), WIDTH, HEIGHT)[0]
    assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((x, y), abs=0.3)
    assert np.ptp(rows) == pytest.approx(0.6 * camera.focal_pixels(HEIGHT), abs=2)


def test_tables_are_inverse():
    values = np.linspace(0, 1, 256)
    assert np.allclose(linear_to_srgb(srgb_to_linear(values)), values, atol=1e-6)
    assert srgb_to_linear(0.5) == pytest.approx(0.21404, abs=1e-4)


@pytest.mark.parametrize(
    ("positions", "colours", "radius", "complaint"),
    [
        (np.zeros((3, 4)), np.zeros((3, 3)), 1.0, r"\(3, 4\)"),
        (np.zeros((3, 3)), np.zeros((2, 3)), 1.0, r"\(2, 3\)"),
        (np.zeros((3, 3)), np.zeros((3, 3)), 0.0, "radius = 0"),
    ],
)
def test_wrong_arrays_are_refused(splatter, positions, colours, radius, complaint):
    with pytest.raises(RenderError, match=complaint):
        splatter.draw(positions, colours, radius, FRONT)


def test_unknown_quality_is_refused():
    with pytest.raises(RenderError, match="'superb' is unknown: choose one of draft, good, best"):
        Splatter(64, 64, quality="superb")


def test_impossible_pictures_are_refused():
    with pytest.raises(RenderError, match="supersample = 9"):
        Splatter(64, 64, supersample=9)


@pytest.mark.parametrize("camera", [FRONT, Camera((4, 6, 9), (0, 0, 0), field_of_view=40.0)])
def test_samples_are_left_out_only_where_they_would_find_nothing(splatter, monkeypatch, camera):
    positions, colours = cloud(40)
    sum_tiles, marked, tiles = splat_kernels.sum_tiles, [], []

    def look(width, height, sums):
        sum_tiles(width, height, sums)
        marked.append(int(sums.to_numpy().max()))

    def mark_all(width, height, sums):
        across, down = (length // splat_kernels.BROAD + 1 for length in (width - 1, height - 1))
        sums.from_numpy(np.outer(np.arange(down + 1), np.arange(across + 1)).ravel().astype(np.int32))
        tiles.append(across * down)

    monkeypatch.setattr(splat_kernels, "sum_tiles", look)
    picture = splatter.draw(positions, colours, 0.1, camera, ((-4, -2, -4), (4, 2, 4)))
    monkeypatch.setattr(splat_kernels, "sum_tiles", mark_all)
    whole = splatter.draw(positions, colours, 0.1, camera, ((-4, -2, -4), (4, 2, 4)))
    assert len(marked) == len(tiles) == 2
    assert all(0 < few < total for few, total in zip(marked, tiles, strict=True))
    assert np.array_equal(picture, whole)


def test_few_spheres_are_drawn_in_one_pass_with_the_same_pixels(splatter, monkeypatch):
    positions, colours = cloud(300)
    picture = splatter.draw(positions, colours, 0.3, FRONT)
    monkeypatch.setattr(splat_kernels, "FEW", 0)
    assert np.array_equal(splatter.draw(positions, colours, 0.3, FRONT), picture)


def test_default_precision_of_the_run_does_not_matter(taichi_cpu, tmp_path):
    positions, colours = cloud(500)
    single = Splatter(WIDTH, HEIGHT).draw(positions, colours, 0.1, FRONT).astype(int)
    ti.reset()
    ti.init(arch=ti.cpu, default_fp=ti.f64, offline_cache_file_path=str(tmp_path), log_level=ti.ERROR)
    double = Splatter(WIDTH, HEIGHT).draw(positions, colours, 0.1, FRONT).astype(int)
    assert (np.abs(single - double).max(axis=2) > 2).mean() < 1e-3


def test_vulkan_draws_what_the_processor_draws(start_taichi):
    if not backend.vulkan_device_types():
        pytest.skip("no Vulkan driver on this machine")
    positions, colours = cloud(60)
    box, pictures = ((-1.5,) * 3, (1.5,) * 3), []
    for arch in ("cpu", "vulkan"):
        with start_taichi(arch):
            pictures.append(Splatter(WIDTH, HEIGHT).draw(positions, colours, 0.2, FRONT, box).astype(int))
    assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 2).mean() < 1e-3
