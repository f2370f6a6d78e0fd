"""Pictures and a live window by Taichi's GGUI; needs Vulkan, and the window needs a display."""

import os
import sys

import numpy as np
import taichi as ti

from taichi_rts.errors import RenderError
from taichi_rts.rendering.camera import Camera, box_corners, box_edges
from taichi_rts.rendering.splatter import checked_arrays

WAY_OUT = "use --renderer splatter, or install Vulkan: apt-get install libvulkan1 mesa-vulkan-drivers"


def _open(title: str, width: int, height: int, visible: bool) -> ti.ui.Window:
    try:
        return ti.ui.Window(title, (width, height), vsync=visible, show_window=visible)
    except Exception as error:  # RuntimeError without Vulkan, another type in wheels without GGUI
        raise RenderError(
            f"GGUI cannot open a {width} x {height} picture; it needs Vulkan ({error}): {WAY_OUT}"
        ) from error


def _ggui_camera(camera: Camera, aspect: float, reach: float) -> ti.ui.Camera:
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


def _compose(window, positions, colours, radius: float, camera: Camera, outline, background, size) -> None:
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
        self._window = _open("taichi_rts", width, height, visible=False)

    def draw(self, positions, colours, radius: float, camera: Camera, outline=None) -> np.ndarray:
        """Return the picture, (height, width, 3) uint8; arguments as in `Splatter.draw`."""
        size = (self.width, self.height)
        _compose(self._window, positions, colours, radius, camera, outline, self.background, size)
        buffer = self._window.get_image_buffer_as_numpy()  # (width, height, 4), upward; it consumes the frame
        picture = np.swapaxes(buffer, 0, 1)[::-1, :, :3]
        return np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8)

    def close(self) -> None:
        """Free the window."""
        self._window.destroy()


class LiveWindow:
    """An interactive window: drag to orbit (left), pan (right), W/S or Q/E to zoom, Space pauses, Esc quits.

    The first camera given to `draw` is where the orbit starts; afterwards the user steers.
    """

    def __init__(self, width: int = 1280, height: int = 720, title: str = "taichi_rts"):
        """Open the window; without a display or without Vulkan this is a RenderError."""
        if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise RenderError(
                "a window needs a display, but neither DISPLAY nor WAYLAND_DISPLAY is set: "
                f"run from a desktop session, or {WAY_OUT}"
            )
        self.width, self.height, self.paused = width, height, False
        self._window = _open(title, width, height, visible=True)
        self._orbit: Camera | None = None
        self._cursor: tuple[float, float] | None = None
        self._quit = False

    @property
    def running(self) -> bool:
        """False once the user closed the window or pressed Esc."""
        return not self._quit and self._window.running

    def draw(self, positions, colours, radius: float, camera: Camera, outline=None, lines=()) -> None:
        """Show one frame with `lines` of text, and follow the user's keys and mouse."""
        self._orbit = self._orbit or camera
        self._follow_keys()
        if not self.running:
            return
        self._orbit = self._follow_mouse(self._orbit)
        size = (self.width, self.height)
        _compose(self._window, positions, colours, radius, self._orbit, outline, (1.0, 1.0, 1.0), size)
        if lines:
            with self._window.get_gui().sub_window("Run", 0.01, 0.01, 0.3, 0.05 + 0.03 * len(lines)) as panel:
                for line in lines:
                    panel.text(line)
        self._window.show()

    def _follow_keys(self) -> None:
        for event in self._window.get_events(ti.ui.PRESS):
            if event.key == ti.ui.SPACE:
                self.paused = not self.paused
            elif event.key == ti.ui.ESCAPE:
                self._quit = True

    def _follow_mouse(self, camera: Camera) -> Camera:
        """Return the camera after the mouse's and the zoom keys' move since the last frame."""
        window, cursor = self._window, self._window.get_cursor_pos()
        last, self._cursor = self._cursor or cursor, cursor
        dx, dy = cursor[0] - last[0], cursor[1] - last[1]
        if window.is_pressed(ti.ui.LMB):
            camera = camera.orbited(-240.0 * dx, -180.0 * dy)
        elif window.is_pressed(ti.ui.RMB):
            camera = camera.panned(-dx * self.width / self.height, -dy)
        closer = window.is_pressed("w", "e") - window.is_pressed("s", "q")
        return camera.zoomed(0.97**closer) if closer else camera

    def close(self) -> None:
        """Close the window."""
        self._quit = True
        self._window.destroy()
