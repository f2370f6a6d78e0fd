"""Keys that GGUI does not report: it knows letters and named keys, but neither digits nor signs."""

from __future__ import annotations

import importlib.util
from typing import Any

SILENT = ".123[]/?=-"
"""The keys of these signs, which come from the X server instead, through python-xlib (extra `gui`)."""

KEY_PRESS = 2  # X.KeyPress


class XKeys:
    """Listens, beside GGUI, for the `SILENT` keys of the X window with this title; without python-xlib or X it hears none."""

    def __init__(self, title: str) -> None:
        self.display: Any = None
        if importlib.util.find_spec("Xlib") is None:
            return
        from Xlib import X, display
        from Xlib.error import DisplayError

        try:
            self.display = display.Display()
        except (DisplayError, OSError):  # Wayland without X
            return
        found = [each for each in _windows(self.display.screen().root) if _name(each) == title]
        for window in found:
            window.change_attributes(event_mask=X.KeyPressMask)
        self.display.sync()

    def pressed(self) -> list[str]:
        """Return the signs pressed since the last call."""
        found = []
        while self.display is not None and self.display.pending_events():
            event = self.display.next_event()
            if event.type != KEY_PRESS:  # changes of the keyboard's layout come unasked
                continue
            keysym = self.display.keycode_to_keysym(event.detail, event.state & 1)  # 1: Shift
            if 0 < keysym < 128 and chr(keysym) in SILENT:
                found.append(chr(keysym))
        return found

    def close(self) -> None:
        """End the connection."""
        if self.display is not None:
            self.display.close()


def _windows(root: Any) -> list[Any]:
    """All windows below `root`; those that go meanwhile are left out."""
    from Xlib.error import XError

    try:
        children = root.query_tree().children
    except XError:
        return []
    return [each for child in children for each in (child, *_windows(child))]


def _name(window: Any) -> str | None:
    from Xlib.error import XError

    try:
        return window.get_wm_name()
    except XError:
        return None
