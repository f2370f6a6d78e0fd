"""From a reading to a finished picture: colours, renderer, legend."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal, TypedDict, get_args, get_origin, get_type_hints

import numpy as np

from taichi_rts.errors import RenderError, did_you_mean
from taichi_rts.readings.levels import milliseconds
from taichi_rts.readings.reading import Readable, Reading
from taichi_rts.rendering import legend
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.obstacles import ObstaclePoints
from taichi_rts.rendering.tints import Tints
from taichi_rts.scene.placing import at_origin
from taichi_rts.scene.scene import Scene

Mode = Literal["level", "step", "lead", "speed", "density", "sound", "fluid", "pressure", "plain"]
ViewName = Literal["scene", "front", "side", "top"]
VIEWS: dict[str, tuple[float, float]] = {"front": (0.0, 0.0), "side": (90.0, 0.0), "top": (0.0, 89.99)}
"""Azimuth and elevation [degrees] of the views without perspective; straight down, there would be no right."""
MOST_VIEWS = 4


@dataclass(frozen=True)
class PictureOptions:
    """How pictures look. `azimuth` and `elevation` [degrees] are the scene's own view if left out.

    Several `views` stand side by side in a picture of `width` x `height` pixels; "scene", in perspective, is what no views
    give. Raises `RenderError` for more than four, and for what the renderer cannot do.
    """

    width: int = 1280
    """Width of a frame [pixels]."""
    height: int = 720
    """Height of a frame [pixels]."""
    renderer: Literal["splatter", "ggui"] = "splatter"
    """splatter needs no Vulkan and no display; ggui is Taichi's own."""
    colour_by: Mode = "level"
    """What colours show."""
    palette: Literal["default", "paper"] = "default"
    """Colours of levels: safe for colour-blind readers, or the paper's red, green, blue."""
    azimuth: float | None = None
    """Camera angle around the vertical [degrees]."""
    elevation: float | None = None
    """Camera angle above the ground [degrees]."""
    eye: tuple[float, float, float] | None = None
    """Where the camera is [m], instead of the angles; goes with --target."""
    target: tuple[float, float, float] | None = None
    """What it looks at [m]."""
    zoom: float | None = None
    """How much larger than the whole domain would be, or than from the eye."""
    fov: float = 35.0
    """Vertical angle of view [degrees]."""
    legend: bool = True
    """Draw the legend, with time and scale."""
    box: bool = True
    """Draw the edges of the domain."""
    floor: bool = True
    """Splatter: draw the shadow on the floor of the domain."""
    quality: Literal["draft", "good", "best"] = "good"
    """Splatter: draft has no shadows, best four times the samples of good (docs/rendering.md)."""
    transparent: bool = False
    """Splatter: frames with an alpha channel instead of a white background; shadows stay."""
    views: tuple[ViewName, ...] = ()
    """Views side by side in each frame: any of scene, front, side and top; by default the scene's alone."""

    def __post_init__(self) -> None:
        if self.renderer == "ggui" and (self.transparent or self.quality != "good"):
            raise RenderError(
                "--transparent and --quality are the splatter's; leave them out, or give --renderer splatter"
            )
        if self.zoom is not None and not 0.0 < self.zoom < math.inf:
            raise RenderError(f"--zoom {self.zoom:g} must be above 0; 2 shows everything twice as large")
        if not 1.0 <= self.fov <= 170.0:
            raise RenderError(f"--fov {self.fov:g} degrees is outside 1 to 170: 35 suits most scenes")
        if (self.eye is None) != (self.target is None):
            raise RenderError("--eye and --target go together; give both, or --azimuth and --elevation instead")
        if self.eye is not None and (self.azimuth is not None or self.elevation is not None):
            raise RenderError("--eye and --target stand instead of --azimuth and --elevation; leave out these or those")
        if len(self.views) > MOST_VIEWS:
            raise RenderError(f"{len(self.views)} views in one picture; at most {MOST_VIEWS} can be told apart")

    @property
    def view_size(self) -> tuple[int, int]:
        """Width and height [pixels] of one view."""
        count = max(len(self.views), 1)
        return (self.width - (count - 1) * legend.rule_thickness(self.height)) // count, self.height


class PictureChoices(TypedDict, total=False):
    """The fields of `PictureOptions` as keywords, any of them."""

    width: int
    height: int
    renderer: Literal["splatter", "ggui"]
    colour_by: Mode
    palette: Literal["default", "paper"]
    azimuth: float | None
    elevation: float | None
    eye: tuple[float, float, float] | None
    target: tuple[float, float, float] | None
    zoom: float | None
    fov: float
    legend: bool
    box: bool
    floor: bool
    quality: Literal["draft", "good", "best"]
    transparent: bool
    views: tuple[ViewName, ...]


def picture_options(**options: Any) -> PictureOptions:
    """Return `PictureOptions(**options)`; raises `RenderError` for a keyword or a value that is none, with what is meant."""
    hints = get_type_hints(PictureOptions)
    for key, value in options.items():
        _require("picture option", key, hints)
        if get_origin(hints[key]) is Literal:
            _require(key, value, get_args(hints[key]))
    for view in options.get("views", ()):
        _require("view", view, get_args(ViewName))
    return PictureOptions(**options)


def _require(what: str, name: Any, known: Iterable[str]) -> None:
    known = list(known)
    if name not in known:
        hint = did_you_mean(name, known)
        raise RenderError(f"{what} {name!r} is unknown{hint} (known: {', '.join(known)})")


def make_renderer(options: PictureOptions) -> Any:
    """Return the renderer that the options name; both have the same `draw`."""
    if options.renderer == "ggui":
        from taichi_rts.rendering.ggui import GguiRenderer  # only here, because it needs Vulkan

        return GguiRenderer(*options.view_size)
    from taichi_rts.rendering.splatter import (
        Splatter,
    )  # only here: its kernels are a third of what pictures take to import

    return Splatter(*options.view_size, quality=options.quality, transparent=options.transparent)


def seen_by(scene: Scene, options: PictureOptions) -> Scene:
    """Return `scene` with the eye, target and zoom of the options, where they have them, as its own view.

    Raises `RenderError` for a scene in two dimensions, which is seen from the front.
    """
    if options.eye is not None and scene.dim == 2:
        raise RenderError("--eye and --target: a scene in two dimensions is seen from the front; leave them out")
    wanted: dict[str, Any] = {"eye": options.eye, "target": options.target, "zoom": options.zoom}
    wanted = {key: value for key, value in wanted.items() if value is not None}
    return scene.replace(view=replace(scene.view, **wanted)) if wanted else scene


def make_cameras(scene: Scene, options: PictureOptions) -> list[Camera]:
    """Return the camera of each view, in coordinates counted from `origin_of` the scene.

    Raises `RenderError` for views that the scene does not have, or angles besides.
    """
    scene = at_origin(seen_by(scene, options))
    if options.views and scene.dim == 2:
        raise RenderError(
            f"--views {' '.join(options.views)}: a scene in two dimensions has one view only; leave it out"
        )
    own = (options.azimuth, options.elevation, options.eye, options.zoom)
    if options.views and "scene" not in options.views and own != (None,) * 4:
        raise RenderError(
            f"--views {' '.join(options.views)} have angles of their own; "
            "leave out --azimuth, --elevation, --eye, --target and --zoom"
        )
    return [make_camera(scene, options, view) for view in options.views or ("scene",)]


def make_camera(scene: Scene, options: PictureOptions, name: ViewName = "scene") -> Camera:
    """Return the camera of a view that frames the domain, with `Scene.up` upwards.

    "scene" is the scene's own view, with the options' angles.
    """
    width, height = options.view_size
    if name in VIEWS:
        azimuth, elevation = VIEWS[name]
        box = scene.domain.lower, scene.domain.upper
        return Camera.framing(*box, azimuth, elevation, width / height, scene.up, perspective=False)
    view = scene.view
    if view.eye is not None and view.target is not None and options.azimuth is None and options.elevation is None:
        camera = Camera(view.eye, view.target, scene.up, options.fov)
        return camera.zoomed(1.0 / view.zoom) if view.zoom != 1.0 else camera
    camera = Camera.framing(
        scene.domain.lower,
        scene.domain.upper,
        azimuth=view.azimuth if options.azimuth is None else options.azimuth,
        elevation=view.elevation if options.elevation is None else options.elevation,
        aspect=width / height,
        up=scene.up,
        field_of_view=options.fov,
    )
    return camera.zoomed(1.0 / view.zoom) if view.zoom != 1.0 else camera


class Painter:
    """Paints states of one scene again and again with the same options."""

    def __init__(self, scene: Scene, options: PictureOptions, title: str = "", renderer: Any = None) -> None:
        self.scene = at_origin(scene)  # pictures are drawn in single precision
        self.options = options
        self.title = title
        self.renderer = renderer if renderer is not None else make_renderer(options)
        self.cameras = make_cameras(scene, options)
        self.obstacles = ObstaclePoints(self.scene, 0.5 * scene.spacing)
        self.tints = Tints(self.scene)

    def paint(self, state: Readable) -> np.ndarray:
        """Return the picture of a `Reading`, or of a `Simulation` as it is now.

        It is (height, width, 3) uint8, or (height, width, 4) if it is transparent.
        """
        now = state.read()
        tints = self.tints.of(now, self.options.colour_by, self.options.palette)
        outline = (self.scene.domain.lower, self.scene.domain.upper)
        x, tints = self.obstacles.add(now.local_positions, tints, now.time)
        shown = {"box": self.options.box, "floor": self.options.floor}
        images = [
            self.renderer.draw(x, tints, 0.5 * self.scene.spacing, each, outline, **shown) for each in self.cameras
        ]
        image = self._joined(images) if len(images) > 1 else images[0]
        return self.label(image, now) if self.options.legend else image

    def _joined(self, images: list[np.ndarray]) -> np.ndarray:
        """Return all views in one picture, each with its name."""
        if self.options.legend:
            named = zip(images, self.options.views, strict=True)
            images = [legend.draw_legend(image, name, [], position="bottom-left") for image, name in named]
        return legend.hstack_panels(images)

    def label(self, image: np.ndarray, now: Reading) -> np.ndarray:
        """Return a picture, (height, width, 3 or 4), with time, number of particles, legend and the bar of its colours."""
        mode, palette = self.options.colour_by, self.options.palette
        lines = [f"t = {now.time:.3f} s", f"Δt_b = {milliseconds(now.base_step)} ms", f"{now.count:,} particles"]
        image = legend.draw_legend(image, self.title, self.tints.entries(now, mode, palette), lines)
        bar = self.tints.bar(now, mode, palette)
        return legend.draw_colour_bar(image, *bar) if bar else image
