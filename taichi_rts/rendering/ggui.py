"""Pictures by Taichi's GGUI; needs Vulkan."""

from typing import Any

import numpy as np

from taichi_rts.device.backend import FORK, ti
from taichi_rts.device.forks import VARIABLE
from taichi_rts.errors import RenderError
from taichi_rts.rendering.camera import Camera, box_corners, box_edges
from taichi_rts.rendering.splatter import checked_arrays

WAY_OUT = "use --renderer splatter, or install Vulkan: apt-get install libvulkan1 mesa-vulkan-drivers"


def open_window(title: str, width: int, height: int, visible: bool) -> Any:
    """Open a window of GGUI; raises `RenderError` where there is no Vulkan, and with a fork of Taichi that has no GGUI."""
    if not hasattr(ti, "ui"):
        raise RenderError(
            f"{FORK.module} has no GGUI, which windows and --renderer ggui need: use --renderer splatter without --gui, or "
            f"set {VARIABLE} to taichi or taichi_forge in the environment"
        )
    try:
        return ti.ui.Window(title, (width, height), vsync=visible, show_window=visible)
    except Exception as error:  # RuntimeError without Vulkan, another type in wheels without GGUI
        raise RenderError(
            f"GGUI cannot open a {width} x {height} picture; it needs Vulkan ({error}): {WAY_OUT}"
        ) from error


def _ggui_camera(camera: Camera, aspect: float, reach: float) -> Any:
    """Translate the camera; `reach` [m] is how far it must see."""
    view = ti.ui.Camera()
    view.position(*map(float, camera.eye))
    view.lookat(*map(float, camera.target))
    view.up(*map(float, camera.basis()[1]))
    view.z_near(1e-3 * reach)
    view.z_far(2.0 * reach)
    if camera.orthographic_height is None:
        view.fov(float(camera.field_of_view))
        return view
    half = 0.5 * camera.orthographic_height
    view.projection_mode(ti.ui.ProjectionMode.Orthogonal)
    view.left(-half * aspect)
    view.right(half * aspect)
    view.bottom(half)  # GGUI's parallel projection counts downward
    view.top(-half)
    return view


def compose(window, positions, colours, radius: float, camera: Camera, outline, background, size) -> None:
    """Put particles, outline and light of one frame on the window's canvas."""
    positions, colours = checked_arrays(positions, colours, radius)
    canvas, scene = window.get_canvas(), window.get_scene()
    canvas.set_background_color(tuple(background))
    seen = [positions] if len(positions) else []
    if outline is not None:
        seen.append(box_corners(*outline).astype(np.float32))
    eye = np.asarray(camera.eye, float)
    away = [np.linalg.norm(np.abs(points - eye).max(axis=0)) for points in seen]
    scene.set_camera(_ggui_camera(camera, size[0] / size[1], float(max(away, default=1.0)) + radius))
    right, up, forward = camera.basis()
    scene.ambient_light((0.45, 0.45, 0.45))
    lamp = eye + 3.0 * float(np.linalg.norm(eye - camera.target)) * (0.8 * up - 0.5 * right - 0.2 * forward)
    scene.point_light(tuple(map(float, lamp)), (0.75, 0.75, 0.75))
    if len(positions):
        scene.particles(positions, radius, per_vertex_color=colours)
    if outline is not None:
        corners = seen[-1]
        ends = np.ascontiguousarray(corners[box_edges(len(outline[0])).ravel()])
        scene.lines(ends, max(1.5 * size[1] / 720, 1.0), color=(0.3, 0.3, 0.33))
    canvas.scene(scene)


class GguiRenderer:
    """Draws frames offscreen with GGUI; needs Vulkan, no display. Call after `ti.init`."""

    def __init__(self, width: int = 1280, height: int = 720, background=(1, 1, 1)):
        """Open an invisible window of `width` x `height` pixels."""
        self.width, self.height, self.background = width, height, background
        self._window = open_window("taichi_rts", width, height, visible=False)

    def draw(
        self, positions, colours, radius: float, camera: Camera, outline=None, *, box: bool = True, floor: bool = True
    ) -> np.ndarray:
        """Return the picture, (height, width, 3) uint8; arguments as in `Splatter.draw`. There are no shadows on a floor."""
        outline = outline if box else None
        size = (self.width, self.height)
        compose(self._window, positions, colours, radius, camera, outline, self.background, size)
        buffer = self._window.get_image_buffer_as_numpy()  # (width, height, 4), upward; it consumes the frame
        picture = np.swapaxes(buffer, 0, 1)[::-1, :, :3]
        return np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8)

    def close(self) -> None:
        """Free the window."""
        self._window.destroy()
