"""From a simulation to a finished picture: colours, renderer, legend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from taichi_rts.errors import RenderError
from taichi_rts.readings.levels import level_classes, longest_lead, longest_step, milliseconds
from taichi_rts.rendering import colours, legend
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.obstacles import ObstaclePoints
from taichi_rts.rendering.splatter import Splatter
from taichi_rts.scene.placing import at_origin
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation

Mode = Literal["level", "step", "lead", "speed", "density", "sound", "fluid", "pressure", "plain"]
View = Literal["scene", "front", "side", "top"]
VIEWS: dict[str, tuple[float, float]] = {"front": (0.0, 0.0), "side": (90.0, 0.0), "top": (0.0, 89.99)}
"""Azimuth and elevation [degrees] of the views without perspective; straight down, there would be no right."""
MOST_VIEWS = 4
BAR_STEPS = 64
LEGEND_ROWS = 8  # with more levels than that the legend leaves out those that nobody has


@dataclass(frozen=True)
class PictureOptions:
    """How pictures look; None for `azimuth` and `elevation` [degrees] takes the scene's own view.

    Several `views` stand side by side in a picture of `width` x `height` pixels; "scene", in perspective, is what no views
    give. Raises `RenderError` for more than four, and for what the renderer cannot do.
    """

    width: int = 1280
    height: int = 720
    renderer: Literal["splatter", "ggui"] = "splatter"
    colour_by: Mode = "level"
    palette: Literal["default", "paper"] = "default"
    azimuth: float | None = None
    elevation: float | None = None
    legend: bool = True
    quality: Literal["draft", "good", "best"] = "good"
    transparent: bool = False
    views: tuple[View, ...] = ()

    def __post_init__(self) -> None:
        if self.renderer == "ggui" and (self.transparent or self.quality != "good"):
            raise RenderError(
                "--transparent and --quality are the splatter's; leave them out, or give --renderer splatter"
            )
        if len(self.views) > MOST_VIEWS:
            raise RenderError(f"{len(self.views)} views in one picture; at most {MOST_VIEWS} can be told apart")

    @property
    def view_size(self) -> tuple[int, int]:
        """Width and height [pixels] of one view."""
        count = max(len(self.views), 1)
        return (self.width - (count - 1) * legend.rule_thickness(self.height)) // count, self.height


def make_renderer(options: PictureOptions) -> Any:
    """Return the renderer that the options name; both have the same `draw`."""
    if options.renderer == "ggui":
        from taichi_rts.rendering.ggui import GguiRenderer  # only here, because it needs Vulkan

        return GguiRenderer(*options.view_size)
    return Splatter(*options.view_size, quality=options.quality, transparent=options.transparent)


def make_cameras(scene: Scene, options: PictureOptions) -> list[Camera]:
    """Return the camera of each view; raises `RenderError` for views that the scene does not have, or angles besides."""
    if options.views and scene.dim == 2:
        raise RenderError(
            f"--views {' '.join(options.views)}: a scene in two dimensions has one view only; leave it out"
        )
    if options.views and "scene" not in options.views and (options.azimuth, options.elevation) != (None, None):
        raise RenderError(
            f"--views {' '.join(options.views)} have angles of their own; leave out --azimuth and --elevation"
        )
    return [make_camera(scene, options, view) for view in options.views or ("scene",)]


def make_camera(scene: Scene, options: PictureOptions, name: View = "scene") -> Camera:
    """Return the camera of a view that frames the domain; "scene" is the scene's own, with the options' angles."""
    width, height = options.view_size
    if name in VIEWS:
        azimuth, elevation = VIEWS[name]
        box = scene.domain.lower, scene.domain.upper
        return Camera.framing(*box, azimuth, elevation, width / height, perspective=False)
    view = scene.view
    if view.eye is not None and view.target is not None and options.azimuth is None and options.elevation is None:
        return Camera(view.eye, view.target)
    camera = Camera.framing(
        scene.domain.lower,
        scene.domain.upper,
        azimuth=view.azimuth if options.azimuth is None else options.azimuth,
        elevation=view.elevation if options.elevation is None else options.elevation,
        aspect=width / height,
    )
    return camera.zoomed(1.0 / view.zoom) if view.zoom != 1.0 else camera


class Painter:
    """Paints one simulation's present state again and again with the same options."""

    def __init__(self, scene: Scene, options: PictureOptions, title: str = "", renderer: Any = None) -> None:
        self.scene = scene = at_origin(scene)  # pictures are drawn in single precision
        self.options = options
        self.title = title
        self.renderer = renderer if renderer is not None else make_renderer(options)
        self.cameras = make_cameras(scene, options)
        self.obstacles = ObstaclePoints(scene, 0.5 * scene.spacing)
        self.top_speed = scene.estimate_max_speed()
        self.top_pressure = 0.5 * scene.rest_density * self.top_speed**2

    def paint(self, sim: Simulation) -> np.ndarray:
        """Return the picture of `sim` at its present time, (height, width, 3) uint8, or 4 if it is transparent."""
        x, v, rho, level = sim.local_state()
        tints = self.colours(sim, v, rho, level)
        outline = (self.scene.domain.lower, self.scene.domain.upper)
        x, tints = self.obstacles.add(x, tints, sim.time)
        images = [self.renderer.draw(x, tints, 0.5 * self.scene.spacing, each, outline) for each in self.cameras]
        image = self._joined(images) if len(images) > 1 else images[0]
        return self._label(image, sim, level) if self.options.legend else image

    def _joined(self, images: list[np.ndarray]) -> np.ndarray:
        """Return all views in one picture, each with its name."""
        if self.options.legend:
            named = zip(images, self.options.views, strict=True)
            images = [legend.draw_legend(image, name, [], position="bottom-left") for image, name in named]
        return legend.hstack_panels(images)

    def colours(self, sim: Simulation, v: np.ndarray, rho: np.ndarray, level: np.ndarray) -> np.ndarray:
        """Colours (N, 3) of the particles of `sim`, whose velocities `v`, densities `rho` and levels these are."""
        mode = self.options.colour_by
        return colours.colour_by(
            mode,
            levels=level,
            speeds=np.linalg.norm(v, axis=1),
            densities=rho,
            steps=sim.steps() if mode == "step" else None,
            leads=sim.leads() if mode == "lead" else None,
            sounds=sim.sound_speeds() if mode == "sound" else None,
            fluids=sim.fluids() if mode == "fluid" else None,
            fluid_tints=self._fluid_tints() if mode == "fluid" else None,
            pressures=sim.medium.equation_of_state.pressure_numpy(rho) if mode == "pressure" else None,
            rest_density=self.scene.rest_density,
            max_speed=self.top_speed,
            longest_step=longest_lead(sim) if mode == "lead" else longest_step(sim),
            top_sound=self.scene.viscous_wave_speed,
            top_pressure=self.top_pressure,
            palette=self.options.palette,
            doubling=sim.schedule.levels_double,
        )

    def _fluid_tints(self) -> np.ndarray:
        return colours.fluid_colours(self.scene.fluid_colours, self.options.palette)

    def _label(self, image: np.ndarray, sim: Simulation, level: np.ndarray) -> np.ndarray:
        lines = [f"t = {sim.time:.3f} s", f"Δt_b = {milliseconds(sim.base_step)} ms", f"{sim.count:,} particles"]
        entries = self._entries(sim, level) if self.options.colour_by in ("level", "fluid") else []
        image = legend.draw_legend(image, self.title, entries, lines)
        bar = _BARS.get(self.options.colour_by)
        return bar(self, image, sim) if bar else image

    def _entries(self, sim: Simulation, level: np.ndarray) -> list[tuple[str, Any, float]]:
        """One entry a colour of levels or fluids, with the share of particles that have it now."""
        if self.options.colour_by == "fluid":
            tints = self._fluid_tints()
            counts = np.bincount(sim.fluids(), minlength=len(tints)) / max(1, sim.count)
            return [
                (name, tuple(t), share) for name, t, share in zip(self.scene.fluid_names, tints, counts, strict=True)
            ]
        shares = np.bincount(level, minlength=sim.schedule.levels + 1)[1:] / max(1, len(level))
        classes = level_classes(shares, sim.schedule.levels_double)
        if sim.schedule.levels_double and len(classes) > LEGEND_ROWS:
            classes = [each for each in classes if each.share > 0.0]
        tints = colours.level_colours(
            [each.first for each in classes], self.options.palette, doubling=sim.schedule.levels_double
        )
        return [
            (f"level {each}: {each} Δt_b" if each.last > 1 else "level 1: Δt_b", tuple(tint), each.share)
            for each, tint in zip(classes, tints, strict=True)
        ]

    def _step_bar(self, image: np.ndarray, sim: Simulation) -> np.ndarray:
        return self._milliseconds_bar(image, "step", longest_step(sim))

    def _lead_bar(self, image: np.ndarray, sim: Simulation) -> np.ndarray:
        return self._milliseconds_bar(image, "ahead of the youngest", longest_lead(sim))

    def _milliseconds_bar(self, image: np.ndarray, title: str, longest: float) -> np.ndarray:
        lower, upper = colours.step_range([], longest)
        values = np.linspace(lower, upper, BAR_STEPS)
        tints = colours.colour_by("step", steps=values, longest_step=upper)
        return legend.draw_colour_bar(image, title, 1e3 * lower, 1e3 * upper, "ms", tints)

    def _speed_bar(self, image: np.ndarray, sim: Simulation) -> np.ndarray:
        values = np.linspace(0.0, self.top_speed, BAR_STEPS)
        tints = colours.colour_by("speed", speeds=values, max_speed=self.top_speed)
        return legend.draw_colour_bar(image, "speed", 0.0, self.top_speed, "m/s", tints)

    def _sound_bar(self, image: np.ndarray, sim: Simulation) -> np.ndarray:
        lower, upper = colours.sound_range([], self.scene.viscous_wave_speed)
        values = np.linspace(lower, upper, BAR_STEPS)
        tints = colours.colour_by("sound", sounds=values, top_sound=upper)
        return legend.draw_colour_bar(image, "sound speed", lower, upper, "m/s", tints)

    def _pressure_bar(self, image: np.ndarray, sim: Simulation) -> np.ndarray:
        lower, upper = colours.pressure_range([], self.top_pressure)
        values = np.linspace(lower, upper, BAR_STEPS)
        tints = colours.colour_by("pressure", pressures=values, top_pressure=upper)
        return legend.draw_colour_bar(image, "pressure", 1e-3 * lower, 1e-3 * upper, "kPa", tints)

    def _density_bar(self, image: np.ndarray, sim: Simulation) -> np.ndarray:
        lower, upper = colours.density_range(self.scene.rest_density)
        values = np.linspace(lower, upper, BAR_STEPS)
        tints = colours.colour_by("density", densities=values, rest_density=self.scene.rest_density)
        return legend.draw_colour_bar(image, "density", lower, upper, "kg/m^3", tints)


_BARS = {
    "step": Painter._step_bar,
    "lead": Painter._lead_bar,
    "speed": Painter._speed_bar,
    "density": Painter._density_bar,
    "sound": Painter._sound_bar,
    "pressure": Painter._pressure_bar,
}
