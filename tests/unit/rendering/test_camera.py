import numpy as np
import pytest

from taichi_rts.errors import RenderError
from taichi_rts.rendering.camera import Camera, box_corners, box_edges


@pytest.mark.parametrize("azimuth", [-120, -35, 0, 28, 90, 200])
@pytest.mark.parametrize("elevation", [-10, 0, 22, 60, 90])
@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1)])
def test_framed_box_fits_and_fills_the_picture(azimuth, elevation, up):
    lower, upper = (-1, 0, 0.5), (2, 2, 1)
    camera = Camera.framing(lower, upper, azimuth=azimuth, elevation=elevation, up=up)
    pixels = camera.project(box_corners(lower, upper), 1280, 720)
    assert np.all(pixels[:, 2] > 0)
    assert pixels[:, 0].min() >= 0
    assert pixels[:, 0].max() <= 1280
    assert pixels[:, 1].min() >= 0
    assert pixels[:, 1].max() <= 720
    filled = np.ptp(pixels[:, :2], axis=0) / (1280, 720)
    assert filled.max() > 0.88


def test_two_dimensional_box_is_seen_from_the_front():
    camera = Camera.framing((0, 0), (3, 2))
    pixels = camera.project(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0]]), 1280, 720)
    assert pixels[0, 1] > pixels[2, 1]  # up is up
    assert pixels[0, 0] < pixels[1, 0]
    sides = pixels[1, 0] - pixels[0, 0], pixels[1, 1] - pixels[2, 1]
    assert sides[0] / sides[1] == pytest.approx(1.5)
    assert 0.9 * 720 < sides[1] < 720


def test_projection_of_a_known_point():
    camera = Camera((0, 0, 5), (0, 0, 0), field_of_view=90.0)
    x, y, depth = camera.project(np.array([[1.0, 2.0, 0.0]]), 800, 600)[0]
    assert (x, y, depth) == pytest.approx((400 + 300 / 5, 300 - 2 * 300 / 5, 5))
    assert np.isnan(camera.project(np.array([[0.0, 0.0, 6.0]]), 800, 600)[0, :2]).all()


def test_basis_is_orthonormal_even_when_looking_along_up():
    for eye in ((3, 1, 2), (0, 4, 0), (0, -4, 0)):
        basis = np.array(Camera(eye, (0, 0, 0)).basis())
        assert np.allclose(basis @ basis.T, np.eye(3), atol=1e-12)


def test_orbit_pan_and_zoom():
    camera = Camera((0, 0, 5), (0, 0, 0))
    assert np.allclose(camera.orbited(90, 0).eye, (5, 0, 0))
    assert np.allclose(camera.orbited(0, 30).eye, (0, 2.5, 5 * np.cos(np.pi / 6)))
    assert np.allclose(camera.zoomed(0.5).eye, (0, 0, 2.5))
    moved = camera.panned(0.5, 0.0)
    assert np.allclose(moved.target, (0.5 * camera.view_height(), 0, 0))
    assert np.allclose(np.subtract(moved.eye, moved.target), (0, 0, 5))


def test_edges_join_corners_that_differ_in_one_component():
    corners = box_corners((0, 0, 0), (1, 2, 3))
    lengths = [np.abs(corners[a] - corners[b]) for a, b in box_edges(3)]
    assert len(lengths) == 12
    assert sorted(np.sum(lengths, axis=1)) == [1] * 4 + [2] * 4 + [3] * 4


@pytest.mark.parametrize(
    "arguments",
    [
        {"field_of_view": 0.0},
        {"orthographic_height": -1.0},
        {"eye": (0, 0, 0)},
    ],
)
def test_impossible_cameras_are_refused(arguments):
    with pytest.raises(RenderError):
        Camera(**{"eye": (0, 0, 1), "target": (0, 0, 0), **arguments})


@pytest.mark.parametrize(("angles", "across", "upward"), [((0, 0), 0, 1), ((90, 0), 2, 1), ((0, 89.99), 0, 2)])
def test_views_without_perspective_are_to_scale(angles, across, upward):
    lower, upper = np.array([0, 0, 0.0]), np.array([3, 1, 2.0])
    camera = Camera.framing(lower, upper, *angles, aspect=2.0, perspective=False)
    flat = camera.project(np.stack([lower, upper]), 800, 400)
    size = np.abs(np.diff(flat[:, :2], axis=0)[0])
    scale = camera.focal_pixels(400)
    assert size == pytest.approx([scale * (upper - lower)[across], scale * (upper - lower)[upward]], rel=1e-3)
    assert flat[:, :2].min() >= 0
    assert (flat[:, :2].max(axis=0) <= (800, 400)).all()
    assert (flat[:, 2] > 0).all()


def test_a_flat_box_is_framed_with_its_own_up():
    camera = Camera.framing((0, 0), (2, 3), aspect=1.5, up=(1.0, 0.0, 0.0))
    corners = camera.project(box_corners((0, 0), (2, 3)), 300, 200)
    assert np.all((corners[:, :2] > 0) & (corners[:, :2] < [300, 200]))
    low, high = corners[0], corners[1]  # (0, 0) and (2, 0)
    assert low[0] == pytest.approx(high[0])
    assert low[1] - high[1] == pytest.approx(0.93 * 200)  # x is upward, and fills the height
