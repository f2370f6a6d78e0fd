"""The live window, by Taichi's GGUI: mouse, keys and triangles over the picture; needs Vulkan and a display."""

import contextlib
import os
import socket
import sys
from pathlib import Path
from typing import Any

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.errors import RenderError
from taichi_rts.rendering.camera import Camera
from taichi_rts.rendering.ggui import compose, open_window
from taichi_rts.window.x_keys import XKeys

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
        self._window = open_window(title, width, height, visible=True)
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
        compose(self._window, positions, colours, radius, self.camera, outline, (1.0, 1.0, 1.0), size)
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
