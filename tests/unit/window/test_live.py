"""The live window's session, without a window: keys in, state and messages out."""

from dataclasses import replace

import imageio.v3 as imageio
import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.painter import PictureOptions
from taichi_rts.window import film, live
from taichi_rts.window.session import LiveSession

BLOCK = rts.Block((0.2, 0.0), (0.4, 0.6))
SCENE = rts.Scene(domain=rts.Box((0, 0), (1, 1)), fluids=[BLOCK], spacing=0.04, end_time=0.1)
PAPER = rts.Regional(preset="paper")
OPTIONS = PictureOptions(width=160, height=120)
OUTLINE = (SCENE.domain.lower, SCENE.domain.upper)


@pytest.fixture
def session(taichi_cpu_f64, tmp_path):
    return LiveSession(SCENE, PAPER, OPTIONS, tmp_path)


def press(session, *keys):
    for key in keys:
        session.press(key)


def test_keys_pause_step_reset_colour_and_clip(session, tmp_path):
    step, start = session.sim.base_step, session.sim.positions()
    session.advance()
    assert session.sim.time == pytest.approx(4 * step)
    assert 0.0 < session.active <= 1.0
    press(session, " ")
    session.advance()
    press(session, ".", ".", "n")
    assert session.sim.time == pytest.approx(7 * step)
    assert session.lines()[0].endswith("paused")
    assert len(session.history) == 5  # the start, one frame, three steps
    np.testing.assert_allclose([shares.sum() for shares in session.history], 1.0)
    assert [label for label, _, _ in session.entries()] == ["level 1", "level 2", "level 3"]
    before = session.view()
    assert len(before.positions) == 75
    seen = [session.mode]
    for _ in range(9):
        press(session, "c")
        assert np.isfinite(session.view().colours).all()
        seen.append(session.mode)
    assert seen[0] == seen[9] == "level"
    assert len(set(seen)) == 9
    press(session, "p")
    assert session.options.palette == "paper"
    press(session, "x", "[", "[", "[", "[", "[")  # at 0.25: of five columns one is left
    left = session.view().positions
    assert len(left) == 15
    assert left[:, 0].max() <= 0.25
    press(session, "x", "x")
    assert len(session.view().positions) == 75
    press(session, "r", "~")
    assert session.sim.time == 0.0
    np.testing.assert_array_equal(session.sim.positions(), start)
    assert not list(tmp_path.iterdir())  # nothing is written unasked


@pytest.mark.slow
def test_states_are_saved_and_loaded_and_a_run_may_take_them(session, tmp_path):
    press(session, "l")
    assert "holds no saved state; s saves one" in session.message
    session.advance()
    press(session, "s")
    saved, time = session.sim.positions(), session.sim.time
    path = next((tmp_path / "window" / "states").iterdir())
    assert session.message == f"saved {path}"
    session.advance()
    assert session.sim.time > time
    press(session, "l")
    assert session.sim.time == time
    np.testing.assert_array_equal(session.sim.positions(), saved)
    np.testing.assert_array_equal(rts.load_checkpoint(path).positions(), saved)
    other = LiveSession.__new__(LiveSession)
    vars(other).update(vars(session) | {"scene": SCENE.replace(rest_density=900.0)})
    press(other, "l")
    assert "is of another scene: rest_density 1000.0 there and 900.0 here" in other.message
    path.write_bytes(path.read_bytes()[:-100])
    press(session, "l")
    assert str(path) in session.message
    assert session.sim.time == time  # and goes on


@pytest.mark.slow
def test_steppers_and_sliders_change_the_run_and_not_the_fluid(session):
    session.advance()
    press(session, "1")
    assert session.message == "compiling uniform steps ..."
    regional, x = session.sim, session.sim.positions()
    session.advance()  # which shows the message
    assert session.sim is regional
    session.paused = True
    session.advance()
    uniform = session.sim
    assert uniform.stepper == rts.Uniform()
    assert regional.time == uniform.time
    np.testing.assert_allclose(uniform.positions(), x, atol=0.02 * SCENE.spacing)
    assert session.settings.levels == 1
    session.wanted = replace(session.settings, courant=0.2, viscosity=0.01)
    press(session, "Return")
    session.advance()
    session.advance()
    assert session.sim.stepper == rts.Uniform(courant=0.2)
    assert session.sim.scene.kinematic_viscosity == 0.01
    press(session, "2")
    session.advance()
    session.advance()
    assert session.sim.stepper == PAPER  # the run's own, not the default
    session.wanted = replace(session.settings, levels=2)
    stepper = session.stepper_for(session.wanted, session.settings)
    assert stepper == replace(PAPER, levels=2)
    session.wanted = replace(session.settings, courant=0.9)
    assert session.stepper_for(session.wanted, session.settings).courant == pytest.approx(0.3)  # of three levels
    asynchronous = replace(session.settings, stepper="asynchronous", levels=5)
    assert session.stepper_for(asynchronous, session.settings).levels == 4  # a power of two


def test_recordings_are_numbered_and_end_with_a_film_the_plot_follows_and_a_blow_up_pauses(
    session, tmp_path, monkeypatch
):
    camera = Camera.framing(*OUTLINE, aspect=4 / 3)
    press(session, "v")
    for _ in range(3):
        session.advance()
        for _ in range(2):  # without a step nothing is added
            session.capture(camera, OUTLINE, session.lines())
    check_that_the_plot_stacks_shares_of_levels(session)
    press(session, "v")
    folder = tmp_path / "window" / "recording-001"
    assert session.message.startswith(f"3 frames in {folder}")
    assert sorted(path.name for path in folder.glob("*.png")) == ["000000.png", "000001.png", "000002.png"]
    image = imageio.imread(folder / "000002.png")
    assert image.shape == (120, 160, 3)
    assert (image.std(axis=2) > 20).sum() > 100  # coloured pixels
    if session.film is None and not session.message.endswith(")"):
        assert (folder / "video.mp4").stat().st_size > 1000

    def missing():
        raise rts.OutputError("--video needs the package imageio-ffmpeg")

    monkeypatch.setattr(film, "require_video", missing)
    press(session, "v", "v")
    assert "0 frames in" in session.message
    assert session.message.endswith("recording-002; no video: --video needs the package imageio-ffmpeg")
    check_that_a_blow_up_pauses_and_says_why(session, monkeypatch)


def test_a_recording_has_the_legend_of_what_it_colours(session, monkeypatch):
    drawn = []
    monkeypatch.setattr(film.legend, "draw_legend", lambda image, title, entries, lines: drawn.append(entries) or image)
    monkeypatch.setattr(film.legend, "draw_colour_bar", lambda image, *bar: drawn.append(bar[:4]) or image)
    camera = Camera.framing(*OUTLINE, aspect=4 / 3)
    press(session, "v")
    for mode in ("level", "fluid", "pressure"):
        session._paint(colour_by=mode)
        session.film.time = -1.0
        session.capture(camera, OUTLINE, session.lines())
    levels, fluids, none, bar = drawn
    assert [name for name, _, _ in levels] == ["level 1", "level 2", "level 3"]
    assert [(name, share) for name, _, share in fluids] == [("fluid 1", 1.0)]
    assert none == []
    top = 0.5e-3 * 1000.0 * SCENE.estimate_max_speed() ** 2
    assert bar == ("pressure", 0.0, pytest.approx(top), "kPa")
    corners, shades = live.bar_plot(session.bar().colours, 400, 300)
    assert corners.shape == (6 * 64, 2) == (len(shades), 2)
    assert np.ptp(corners, axis=0) * [400, 300] == pytest.approx([live.PLOT_WIDTH, live.BAR_HEIGHT])
    assert corners.min() > 0.0
    np.testing.assert_array_equal(live.overlay(session, 400, 300)[0][-len(corners) :], corners)


def check_that_the_plot_stacks_shares_of_levels(session):
    """After three frames."""
    corners, shades = live.share_plot(session, 400, 300)
    assert corners.shape == (6 * (1 + 3 * 4), 2) == (len(shades), 2)  # a ground, and 3 levels at 4 times
    assert corners.min() > 0.0
    assert corners.max() < 1.0
    sides = corners.reshape(-1, 6, 2)
    areas = (np.ptp(sides[..., 0], axis=1) * np.ptp(sides[..., 1], axis=1))[1:]
    whole = 4 / 96 * live.PLOT_WIDTH * live.PLOT_HEIGHT / (400 * 300)
    assert areas.sum() == pytest.approx(whole)
    assert areas.reshape(3, 4).sum(axis=1) / whole == pytest.approx(np.mean(list(session.history), axis=0))


def check_that_a_blow_up_pauses_and_says_why(session, monkeypatch):
    def burst(time):
        raise rts.SimulationDivergedError("3 particle states are no longer finite; use a smaller courant")

    monkeypatch.setattr(session.sim, "advance_to", burst)
    session.advance()
    assert session.paused
    assert "use a smaller courant" in session.message


class Window:
    """A window that presses keys, then Esc."""

    camera = None
    running = True

    def __init__(self, *_):
        self.left = [[], ["v"], ["h", "x"], [" "], ["Escape"]]
        self.seen = []
        Window.last = self

    def pressed(self):
        return self.left.pop(0)

    def draw(self, positions, colours, radius, camera, outline, panel, triangles):
        gui = Gui()
        panel(gui)
        self.seen.append((colours, gui.texts))

    def close(self):
        self.closed = True


class Gui:
    """Notes what a panel shows, and leaves the sliders alone."""

    def __init__(self):
        self.texts = []

    def sub_window(self, *place):
        assert all(0.0 < share < 1.0 for share in place[1:])
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def text(self, text, color=None):
        self.texts.append(text)

    def button(self, text):
        return False

    def slider_int(self, text, value, low, high):
        assert low <= value <= high
        return value

    slider_float = slider_int


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["step", "lead"])
def test_window_names_the_stepper_and_shows_every_mode(taichi_cpu_f64, monkeypatch, tmp_path, mode):
    monkeypatch.setattr(live, "LiveWindow", Window)
    stepper = rts.Asynchronous(levels=8, stagger=1)
    options = PictureOptions(width=640, height=480, colour_by=mode)
    sim = live.watch(SCENE, stepper, options, lambda: None, tmp_path)
    assert sim.time == pytest.approx(3 * 8 * sim.base_step)  # the fourth frame is paused
    assert Window.last.closed
    colours, texts = Window.last.seen[0]
    assert colours.shape == (75, 3)
    assert np.isfinite(colours).all()
    assert texts[1].startswith("asynchronous, dt_b = ")
    assert any(text.startswith("Space") for text in Window.last.seen[2][1])
    assert len(list((tmp_path / "window" / "recording-001").glob("*.png"))) == 2
