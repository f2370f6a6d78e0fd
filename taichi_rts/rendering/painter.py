"""From a simulation to a finished picture: colours, renderer, legend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from taichi_rts.rendering import colours, legend
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.splatter import Splatter
from taichi_rts.scene import Scene
from taichi_rts.simulation import Simulation

Mode = Literal["level", "speed", "density", "plain"]
BAR_STEPS = 64


@dataclass(frozen=True)
class PictureOptions:
    """How pictures look; None for `azimuth` and `elevation` [degrees] takes the scene's own view."""

    width: int = 1280
    height: int = 720
    renderer: Literal["splatter", "ggui"] = "splatter"
    colour_by: Mode = "level"
    palette: Literal["default", "paper"] = "default"
    azimuth: float | None = None
    elevation: float | None = None
    legend: bool = True


def make_renderer(options: PictureOptions) -> Any:
    """Return the renderer that the options name; both have the same `draw`."""
    if options.renderer == "ggui":
        from taichi_rts.rendering.ggui import GguiRenderer  # only here, because it needs Vulkan

        return GguiRenderer(options.width, options.height)
    return Splatter(options.width, options.height)


def make_camera(scene: Scene, options: PictureOptions) -> Camera:
    """Return the camera: the scene's view with the options' angles, framing the domain."""
    view = scene.view
    if view.eye is not None and view.target is not None and options.azimuth is None and options.elevation is None:
        return Camera(view.eye, view.target)
    camera = Camera.framing(
        scene.domain.lower,
        scene.domain.upper,
        azimuth=view.azimuth if options.azimuth is None else options.azimuth,
        elevation=view.elevation if options.elevation is None else options.elevation,
        aspect=options.width / options.height,
    )
    return camera.zoomed(1.0 / view.zoom) if view.zoom != 1.0 else camera


class Painter:
    """Paints one simulation's present state again and again with the same options."""

    def __init__(self, scene: Scene, options: PictureOptions, title: str = "", renderer: Any = None) -> None:
        self.scene = scene
        self.options = options
        self.title = title
        self.renderer = renderer if renderer is not None else make_renderer(options)
        self.camera = make_camera(scene, options)
        self.top_speed = scene.estimate_max_speed()

    def paint(self, sim: Simulation) -> np.ndarray:
        """Return the picture of `sim` at its present time, (height, width, 3) uint8."""
        x, v, rho, level = sim.state()
        tints = self.colours(v, rho, level)
        outline = (self.scene.domain.lower, self.scene.domain.upper)
        image = self.renderer.draw(x, tints, 0.5 * self.scene.spacing, self.camera, outline)
        return self._label(image, sim, level) if self.options.legend else image

    def colours(self, v: np.ndarray, rho: np.ndarray, level: np.ndarray) -> np.ndarray:
        """Colours (N, 3) of particles with velocities `v`, densities `rho` and levels."""
        return colours.colour_by(
            self.options.colour_by,
            levels=level,
            speeds=np.linalg.norm(v, axis=1),
            densities=rho,
            rest_density=self.scene.rest_density,
            max_speed=self.top_speed,
            palette=self.options.palette,
        )

    def _label(self, image: np.ndarray, sim: Simulation, level: np.ndarray) -> np.ndarray:
        lines = [f"t = {sim.time:.3f} s", f"Δt_b = {1e3 * sim.base_step:.3f} ms", f"{sim.count:,} particles"]
        entries = self._entries(sim, level) if self.options.colour_by == "level" else []
        image = legend.draw_legend(image, self.title, entries, lines)
        bar = _BARS.get(self.options.colour_by)
        return bar(self, image) if bar else image

    def _entries(self, sim: Simulation, level: np.ndarray) -> list[tuple[str, Any, float]]:
        """One entry a level, with the share of particles that have it now."""
        shares = np.bincount(level, minlength=sim.schedule.levels + 1)[1:] / max(1, len(level))
        tints = colours.level_colours(np.arange(1, len(shares) + 1), self.options.palette)
        names = [f"level {n}: {n} Δt_b" if n > 1 else "level 1: Δt_b" for n in range(1, len(shares) + 1)]
        return [(name, tuple(tint), float(share)) for name, tint, share in zip(names, tints, shares, strict=True)]

    def _speed_bar(self, image: np.ndarray) -> np.ndarray:
        values = np.linspace(0.0, self.top_speed, BAR_STEPS)
        tints = colours.colour_by("speed", speeds=values, max_speed=self.top_speed)
        return legend.draw_colour_bar(image, "speed", 0.0, self.top_speed, "m/s", tints)

    def _density_bar(self, image: np.ndarray) -> np.ndarray:
        lower, upper = colours.density_range(self.scene.rest_density)
        values = np.linspace(lower, upper, BAR_STEPS)
        tints = colours.colour_by("density", densities=values, rest_density=self.scene.rest_density)
        return legend.draw_colour_bar(image, "density", lower, upper, "kg/m^3", tints)


_BARS = {"speed": Painter._speed_bar, "density": Painter._density_bar}
