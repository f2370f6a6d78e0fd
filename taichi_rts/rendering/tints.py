"""From a reading to the colours of its particles, and to what legends say of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from taichi_rts.readings.levels import level_classes
from taichi_rts.readings.reading import Reading
from taichi_rts.rendering import colours
from taichi_rts.rendering.colours import Scale, colour_by
from taichi_rts.scene.scene import Scene

BAR_STEPS = 64
LEGEND_ROWS = 8  # with more levels than that the legend leaves out those that no particle has
Entry = tuple[str, Any, float]
"""Text, colour and share of particles, as legends have them."""


class ColourBar(NamedTuple):
    """A bar of `colours`, (K, 3), that run from `lower` to `upper`, in `unit`; arguments of `legend.draw_colour_bar`."""

    title: str
    lower: float
    upper: float
    unit: str
    colours: np.ndarray


SHOWN: dict[str, Callable[[Reading], np.ndarray]] = {
    "level": lambda now: now.levels,
    "step": lambda now: now.steps,
    "lead": lambda now: now.leads,
    "speed": lambda now: now.speeds,
    "density": lambda now: now.densities,
    "sound": lambda now: now.sound_speeds,
    "fluid": lambda now: now.fluids,
    "pressure": lambda now: now.pressures,
    "plain": lambda now: now.levels,
}
"""What each mode shows of a reading, as `colours.colour_by` takes it."""


class Tints:
    """Colours of the particles of a scene's runs, by any mode; ends of ranges that only depend on the scene are kept.

    Attributes:
        top_speed, top_pressure: the largest expected speed [m/s], and half of its square times rest density [Pa].
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.top_speed = scene.estimate_max_speed()
        self.top_pressure = 0.5 * scene.rest_density * self.top_speed**2

    def scale(self, now: Reading, palette: str) -> Scale:
        """Return the scale that shows a reading."""
        tops = {
            "step": now.longest_step,
            "lead": now.longest_lead,
            "speed": self.top_speed,
            "sound": self.scene.viscous_wave_speed,
            "pressure": self.top_pressure,
        }
        return Scale(palette, now.levels_double, tops, self.scene.rest_density, self.scene.fluid_colours)

    def of(self, now: Reading, mode: str, palette: str) -> np.ndarray:
        """Return the colours, (N, 3), of the particles of a reading."""
        return colour_by(mode, SHOWN[mode](now), self.scale(now, palette))

    def entries(self, now: Reading, mode: str, palette: str) -> list[Entry]:
        """One entry a colour of levels or fluids, with the share of particles that have it now; none in other modes."""
        if mode == "fluid":
            tints = colours.fluid_colours(self.scene.fluid_colours, palette)
            counts = np.bincount(now.fluids, minlength=len(tints)) / max(1, now.count)
            return [
                (name, tuple(t), share) for name, t, share in zip(self.scene.fluid_names, tints, counts, strict=True)
            ]
        if mode != "level":
            return []
        classes = level_classes(now.level_shares, now.levels_double)
        if now.levels_double and len(classes) > LEGEND_ROWS:
            classes = [each for each in classes if each.share > 0.0]
        tints = colours.level_colours([each.first for each in classes], palette, doubling=now.levels_double)
        return [
            (f"level {each}: {each} Δt_b" if each.last > 1 else "level 1: Δt_b", tuple(tint), each.share)
            for each, tint in zip(classes, tints, strict=True)
        ]

    def bar(self, now: Reading, mode: str, palette: str) -> ColourBar | None:
        """What a bar of the mode's colours shows; None for modes that have none."""
        if mode not in BARS:
            return None
        title, unit, factor = BARS[mode]
        scale = self.scale(now, palette)
        lower, upper = scale.ends(mode)
        tints = colour_by(mode, np.linspace(lower, upper, BAR_STEPS), scale)
        upper = upper if upper > colours.LEAST_TOP else 0.0
        return ColourBar(title, factor * lower, factor * upper, unit, tints)


BARS: dict[str, tuple[str, str, float]] = {
    "step": ("step", "ms", 1e3),
    "lead": ("ahead of the youngest", "ms", 1e3),
    "speed": ("speed", "m/s", 1.0),
    "density": ("density", "kg/m^3", 1.0),
    "sound": ("sound speed", "m/s", 1.0),
    "pressure": ("pressure", "kPa", 1e-3),
}
"""Modes that have a bar of colours: its title, its unit, and how many of them the SI unit is."""
