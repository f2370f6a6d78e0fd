"""Watch a run in a window, and steer it: a thin window around `LiveSession`."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from taichi_rts.rendering import colours
from taichi_rts.rendering.painter import PictureOptions, make_camera, seen_by
from taichi_rts.scene.placing import at_origin
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation
from taichi_rts.solver.stepping.steppers import STEPPERS
from taichi_rts.window.session import HISTORY, LiveSession
from taichi_rts.window.window import LiveWindow

MOST_LEVELS = 16  # that the slider offers
MOST_COURANT = 1.5
PANEL_WIDTH, KEYS_WIDTH = 290.0, 270.0  # [pixels]
CONTROLS = 7  # sliders and buttons
MESSAGE_LINES, MESSAGE_WIDTH = 5, 38  # room for messages [rows, letters]
LINE = 18.0  # height of a row of ImGui's [pixels], whose text has one size in windows of any size
SLIDER = 23.0
PLOT_WIDTH, PLOT_HEIGHT, PLOT_EDGE = 260.0, 80.0, 12.0  # of the plot of level shares [pixels]
BAR_BOTTOM, BAR_HEIGHT, BAR_TEXT = (
    108.0,
    16.0,
    56.0,
)  # of the bar of colours above it, and of the panel with its numbers
BACKGROUND = (0.85, 0.86, 0.88)
KEY_LINES = (
    "Space   pause, go on",
    ". or n  one base step",
    "r       back to the start",
    *(f"{number} or {kind.key}  {name} steps" for number, (name, kind) in enumerate(STEPPERS.items(), 1)),
    "Return  apply the sliders",
    "c       next colours",
    "p       other palette",
    "x       clip plane, [ ] move it",
    "s l     save, load the state",
    "v       record, stop",
    "h or ?  these keys",
    "Esc     quit",
    "drag left orbit, right pan,",
    "middle or arrows zoom",
)


def watch(
    scene: Scene, stepper: Any, options: PictureOptions, start: Callable[[], object], folder: Path | None = None
) -> Simulation:
    """Run `scene` in a window until its end time, then keep showing it until the window is closed.

    `start` initialises Taichi. Keys write states and recordings into FOLDER/window, by default out/SCENE/window. Raises
    `RenderError` without a display or Vulkan.
    """
    start()
    window = LiveWindow(options.width, options.height, f"taichi_rts: {scene.name}")
    session = LiveSession(scene, stepper, options, folder or Path("out") / scene.name)
    free = max(64, options.width - round(PANEL_WIDTH))
    aside = 0.5 * (options.width - free) / options.height  # by which the scene is moved out from under the panel
    local = at_origin(scene)
    seen = at_origin(seen_by(scene, options))
    camera = make_camera(seen, dataclasses.replace(options, width=free)).panned(-aside, 0.0)
    outline = (local.domain.lower, local.domain.upper)
    while window.running and not session.over:
        for key in window.pressed():
            session.press(key)
        session.advance()
        view, entries, lines = session.view(), [*session.entries(), *session.fluid_entries()], session.lines()
        panel = Panel(session, entries, lines, options.width, options.height)
        window.panel = (panel.width, panel.height)
        window.draw(*view, camera, outline, panel, overlay(session, options.width, options.height))
        session.capture((window.camera or camera).panned(aside, 0.0), outline, lines)
    session.close()
    window.close()
    return session.sim


class Panel:
    """The panel at the upper left: live numbers, shares of levels, sliders. `width` and `height` are shares of the window."""

    def __init__(self, session: LiveSession, entries: list[Any], lines: list[str], columns: int, rows: int) -> None:
        self.session = session
        self.entries = entries
        self.lines = lines
        self.size = np.array([columns, rows], float)
        text = len(lines) + len(entries) + MESSAGE_LINES
        self.width, self.height = self._shares(PANEL_WIDTH, LINE * text + SLIDER * CONTROLS + 50.0)

    def _shares(self, width: float, height: float) -> tuple[float, float]:
        """Return a size [pixels] in shares of the window's."""
        return min(0.97, width / self.size[0]), min(0.97, height / self.size[1])

    def __call__(self, gui: Any) -> None:
        """Draw it, and take over the sliders' values."""
        session = self.session
        with gui.sub_window("run", 0.01, 0.01, self.width, self.height) as panel:
            for line in self.lines:
                panel.text(line)
            for label, tint, share in self.entries:
                panel.text(f"{label.replace('–', '-'):<12} {share:6.1%}", color=_readable(tint))
            wanted = session.wanted
            levels = panel.slider_int("levels", wanted.levels, 1, max(MOST_LEVELS, wanted.levels))
            courant = panel.slider_float("lambda", wanted.courant, 0.05, MOST_COURANT)
            viscosity = panel.slider_float("nu m2/s", wanted.viscosity, 0.0, session.thickest)
            session.scale = panel.slider_float("radius", session.scale, 0.3, 2.0)
            session.clip_share = panel.slider_float("clip", session.clip_share, 0.0, 1.0)
            session.wanted = dataclasses.replace(wanted, levels=levels, courant=courant, viscosity=viscosity)
            if panel.button("apply (Return)"):
                session.press("Return")
            if panel.button(f"palette: {session.options.palette}"):
                session.press("p")
            panel.text("lower right: shares over time")
            for line in _wrapped(session.message):
                panel.text(line)
        if bar := session.bar():
            width, height = self._shares(PLOT_WIDTH, BAR_TEXT)
            top = 1.0 - (BAR_BOTTOM + BAR_HEIGHT + BAR_TEXT + 4.0) / self.size[1]
            left = 1.0 - (PLOT_WIDTH + PLOT_EDGE) / self.size[0]
            with gui.sub_window("colours", max(left, 0.0), max(top, 0.0), width, height) as text:
                text.text(f"{bar.title} [{bar.unit}]")
                middle = 0.5 * (bar.lower + bar.upper)
                text.text(f"{bar.lower:<12.4g}{middle:^12.4g}{bar.upper:>11.4g}")
        if session.helps:
            width, height = self._shares(KEYS_WIDTH, LINE * len(KEY_LINES) + 40.0)
            with gui.sub_window("keys", 0.99 - width, 0.01, width, height) as keys:
                for line in KEY_LINES:
                    keys.text(line)


def overlay(session: LiveSession, columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of what lies over the picture: the plot of shares, and a bar of colours where the mode has one."""
    parts = [share_plot(session, columns, rows)]
    if bar := session.bar():
        parts.append(bar_plot(bar.colours, columns, rows))
    corners, shades = zip(*parts, strict=True)
    return np.concatenate(corners), np.concatenate(shades)


def bar_plot(tints: np.ndarray, columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of a bar of colours, (K, 3), above the plot of shares; as `share_plot`."""
    scale, count = np.array([columns, rows], float), len(tints)
    start = np.array([columns - PLOT_WIDTH - PLOT_EDGE, BAR_BOTTOM])
    left = start + np.stack([PLOT_WIDTH / count * np.arange(count), np.zeros(count)], axis=1)
    return _boxes(left / scale, (left + np.array([PLOT_WIDTH / count, BAR_HEIGHT])) / scale), np.repeat(
        tints, 6, axis=0
    )


def share_plot(session: LiveSession, columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of a small plot at the lower right: shares of the levels at the last frames, stacked.

    Corners, (3 K, 2), in shares of a window of `columns` x `rows` pixels from its lower left, and their colours, (3 K, 3).
    """
    scale = np.array([columns, rows], float)
    lower = np.array([columns - PLOT_WIDTH - PLOT_EDGE, PLOT_EDGE]) / scale
    size = np.array([PLOT_WIDTH, PLOT_HEIGHT]) / scale
    corners = [_boxes(lower[None] - 3.0 / scale, (lower + size)[None] + 3.0 / scale)]
    shades = [np.tile(BACKGROUND, (len(corners[0]), 1))]
    classes = session.classes()
    doubling = session.sim.schedule.levels_double
    tints = colours.level_colours([each.first for each in classes], session.options.palette, doubling=doubling)
    shares = np.array([each for each in session.history if len(each) == len(classes)]).reshape(-1, len(classes))
    tops = np.cumsum(shares, axis=1)
    left = HISTORY - len(shares) + np.arange(len(shares))
    for k, tint in enumerate(tints):
        low = np.stack([left / HISTORY, tops[:, k] - shares[:, k]], axis=1)
        high = np.stack([(left + 1) / HISTORY, tops[:, k]], axis=1)
        corners.append(_boxes(lower + size * low, lower + size * high))
        shades.append(np.tile(tint, (len(corners[-1]), 1)))
    return np.concatenate(corners), np.concatenate(shades)


def _boxes(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Two triangles for each of the rectangles between corners `low` and `high`, (K, 2): (6 K, 2)."""
    (x, y), (u, v) = low.T, high.T
    return np.stack(
        [np.stack(pair, axis=1) for pair in ((x, y), (u, y), (u, v), (x, y), (u, v), (x, v))], axis=1
    ).reshape(-1, 2)


def _readable(tint: Any) -> tuple[float, ...]:
    """Return a colour that can be read on the panel's dark ground."""
    return tuple(float(0.6 * part + 0.4) for part in tint)


def _wrapped(text: str) -> list[str]:
    """Cut a message into lines."""
    return textwrap.wrap(text, MESSAGE_WIDTH)
