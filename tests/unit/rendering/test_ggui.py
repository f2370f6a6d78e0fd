import sys

import numpy as np
import pytest

from taichi_rts.errors import RenderError
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.ggui import GguiRenderer
from taichi_rts.window.window import LiveWindow

RED = (0.9, 0.1, 0.1)


def reddish(picture):
    picture = picture.astype(int)
    return (picture[..., 0] > 60) & (picture[..., 0] > 2 * picture[..., 2])


@pytest.fixture
def renderer(taichi_cpu):
    try:
        renderer = GguiRenderer(320, 240)
    except RenderError as error:
        pytest.skip(f"no Vulkan here: {error}")
    yield renderer
    renderer.close()


@pytest.mark.parametrize("dim", [2, 3])
def test_offscreen_picture_has_the_particles_where_the_camera_says(renderer, dim):
    lower, upper = (0, 0, 0)[:dim], (2, 1, 1)[:dim]
    camera = Camera.framing(lower, upper, aspect=320 / 240)
    place = np.array([[0.5, 0.3, 0.5][:dim]])
    for _ in range(2):  # reading a picture consumes it: the second must not be empty
        picture = renderer.draw(place, np.array([RED]), 0.2, camera, (lower, upper))
        assert picture.shape == (240, 320, 3)
        assert picture.dtype == np.uint8
        rows, columns = np.nonzero(reddish(picture))
        x, y, _ = camera.project(place, 320, 240)[0]
        assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((x, y), abs=4)
    assert not reddish(renderer.draw(place[:0], np.zeros((0, 3)), 0.2, camera, (lower, upper))).any()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems always have a display")
def test_window_without_a_display_names_the_way_out(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(RenderError, match=r"neither DISPLAY nor.*xvfb-run.*apt-get install xvfb.*--renderer splatter"):
        LiveWindow(64, 48)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems always have a display")
@pytest.mark.parametrize("display", [":54321", "nonsense", "127.0.0.1:54321"])
def test_a_display_that_does_not_answer_is_an_error_and_not_the_end(monkeypatch, display):
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(RenderError, match=f"DISPLAY '{display}' does not answer: run from a desktop session"):
        LiveWindow(64, 48)
