"""Pictures and a live window by Taichi's GGUI; needs Vulkan, and the window needs a display."""

import contextlib
import os
import socket
import sys
from pathlib import Path
from typing import Any

import numpy as np
import taichi as ti

from taichi_rts.errors import RenderError
from taichi_rts.rendering.camera import Camera, box_corners, box_edges
from taichi_rts.rendering.splatter import checked_arrays
from taichi_rts.rendering.x_keys import XKeys

WAY_OUT = "use --renderer splatter, or install Vulkan: apt-get install libvulkan1 mesa-vulkan-drivers"
NO_DISPLAY = (
    "run from a desktop session or under xvfb-run (apt-get install xvfb libvulkan1 mesa-vulkan-drivers), "
    "or leave out --gui and use --renderer splatter"
)


def require_display() -> None:
    """Raise `RenderError` where no window can open: GLFW would end the process, past any `except`."""
    if not sys.platform.startswith("linux") or os.environ.get("WAYLAND_DISPLAY"):
        return
    display = os.environ.get("DISPLAY")
    if not display:
        raise RenderError(f"a window needs a display, and neither DISPLAY nor WAYLAND_DISPLAY is set: {NO_DISPLAY}")
    if not _answers(display):
        raise RenderError(f"a window needs a display, and DISPLAY {display!r} does not answer: {NO_DISPLAY}")


def _answers(display: str) -> bool:
    """Whether an X server listens at `display`, such as ":0" or "host:10.0"."""
    host, _, rest = display.rpartition(":")
    number = rest.partition(".")[0]
    if not number.isdigit():
        return False
    path = f"/tmp/.X11-unix/X{number}"
    places: list[tuple[int, Any]] = [(socket.AF_UNIX, path), (socket.AF_UNIX, "\0" + path)]
    if host not in ("", "unix"):
        places = [(socket.AF_INET, (host, 6000 + int(number)))]
    for family, place in places:
        with contextlib.suppress(OSError), socket.socket(family) as link:
            link.settimeout(2.0)
            link.connect(place)
            return True
    return False


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
    """An interactive window: drag with the left button to orbit, the right one to pan, the middle one to zoom.

    The first camera given to `draw` is where the orbit starts; afterwards the user steers. Drags that begin in `panel`,
    the shares of the window's width and height that the panel at the upper left has, belong to it.
    """

    def __init__(self, width: int = 1280, height: int = 720, title: str = "taichi_rts"):
        """Open the window; without a display or without Vulkan this is a RenderError."""
        require_display()
        self.width, self.height = width, height
        self.panel = (0.0, 0.0)
        self._layout = Path("imgui.ini").absolute()  # which ImGui leaves behind
        self._had_layout = self._layout.exists()
        self._window = _open(title, width, height, visible=True)
        self._overlay = _Overlay()
        self._signs = XKeys(title)
        self.camera: Camera | None = None
        self._cursor: tuple[float, float] | None = None
        self._dragging = False

    @property
    def running(self) -> bool:
        """False once the user closed the window."""
        return self._window.running

    def pressed(self) -> list[str]:
        """Return the keys pressed since the last call, by GGUI's names; digits and signs by themselves (`XKeys`)."""
        return [event.key for event in self._window.get_events(ti.ui.PRESS)] + self._signs.pressed()

    def draw(self, positions, colours, radius: float, camera: Camera, outline=None, panel=None, triangles=None) -> None:
        """Show one frame, and follow the user's mouse.

        `panel(gui)` fills the panel. `triangles` lie over the picture: their corners, (3 K, 2), in shares of the window from
        its lower left, and the corners' colours, (3 K, 3).
        """
        self.camera = self._follow_mouse(self.camera or camera)
        size = (self.width, self.height)
        _compose(self._window, positions, colours, radius, self.camera, outline, (1.0, 1.0, 1.0), size)
        if triangles is not None:
            self._overlay.draw(self._window.get_canvas(), *triangles)
        if panel is not None:
            panel(self._window.get_gui())
        self._window.show()

    def _follow_mouse(self, camera: Camera) -> Camera:
        """Return the camera after the mouse's and the zoom keys' move since the last frame."""
        window, cursor = self._window, self._window.get_cursor_pos()
        last, self._cursor = self._cursor or cursor, cursor
        dx, dy = cursor[0] - last[0], cursor[1] - last[1]
        button = next((b for b in (ti.ui.LMB, ti.ui.RMB, ti.ui.MMB) if window.is_pressed(b)), None)
        if button is None:
            self._dragging = not (cursor[0] < self.panel[0] and cursor[1] > 1.0 - self.panel[1])
        elif self._dragging:
            if button == ti.ui.LMB:
                camera = camera.orbited(-240.0 * dx, -180.0 * dy)
            elif button == ti.ui.RMB:
                camera = camera.panned(-dx * self.width / self.height, -dy)
            else:
                camera = camera.zoomed(2.0 ** (-3.0 * dy))
        closer = window.is_pressed(ti.ui.UP) - window.is_pressed(ti.ui.DOWN)
        return camera.zoomed(0.97**closer) if closer else camera

    def close(self) -> None:
        """Close the window."""
        self._signs.close()
        self._window.destroy()
        if not self._had_layout:
            self._layout.unlink(missing_ok=True)


class _Overlay:
    """Triangles over a picture: a canvas takes no arrays, and compiles a kernel for every field it is given."""

    def __init__(self) -> None:
        self._reserve(1 << 12)

    def _reserve(self, count: int) -> None:
        self.count = count
        self.corners, self.colours = ti.Vector.field(2, ti.f32, count), ti.Vector.field(3, ti.f32, count)

    def draw(self, canvas, corners: np.ndarray, colours: np.ndarray) -> None:
        """Draw them; arrays as in `LiveWindow.draw`."""
        if len(corners) > self.count:
            self._reserve(2 * len(corners))
        rest = ((0, self.count - len(corners)), (0, 0))  # triangles without area
        self.corners.from_numpy(np.pad(corners, rest).astype(np.float32))
        self.colours.from_numpy(np.pad(colours, rest).astype(np.float32))
        canvas.triangles(self.corners, per_vertex_color=self.colours)
