import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.rendering import live
from taichi_rts.rendering.painter import PictureOptions

BLOCK = rts.Block((0.2, 0.2), (0.4, 0.6))
SCENE = rts.Scene(domain=rts.Box((0, 0), (1, 1)), fluids=[BLOCK], spacing=0.04)


class Window:
    """A window that closes itself after two pictures."""

    paused = False

    def __init__(self, *_):
        self.pictures = []
        Window.last = self

    @property
    def running(self):
        return len(self.pictures) < 2

    def draw(self, positions, colours, radius, camera, outline, lines):
        self.pictures.append((colours, lines))

    def close(self):
        pass


@pytest.mark.parametrize("mode", ["step", "lead"])
def test_window_names_the_stepper_and_shows_every_mode(taichi_cpu_f64, monkeypatch, mode):
    monkeypatch.setattr(live, "LiveWindow", Window)
    stepper = rts.Asynchronous(levels=8, stagger=1)
    sim = live.watch(SCENE, stepper, PictureOptions(colour_by=mode), lambda: None)
    assert sim.time == pytest.approx(2 * 8 * sim.base_step)
    colours, lines = Window.last.pictures[1]
    assert colours.shape == (50, 3)
    assert np.isfinite(colours).all()
    assert lines[1].startswith("asynchronous steps, base step ")
