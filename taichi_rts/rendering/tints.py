"""From a reading to the colours of its particles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from taichi_rts.readings.reading import Reading
from taichi_rts.rendering.colours import Scale, colour_by
from taichi_rts.scene.scene import Scene

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
