"""Tables of gravity as files: what an accelerometer on a sloshing tank has measured."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from taichi_rts.errors import SceneError

LARGEST_FILE = 64 << 20
"""Bytes that a table may have: about a million rows."""


def read_gravity_table(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a CSV file as the data of `GravityChange`: time [s], and 2 or 3 components of gravity [m/s^2].

    Lines that begin with a letter or `#` are headings. Raises `SceneError` for what is no such table.
    """
    try:
        with path.open(encoding="utf-8-sig") as file:
            text = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        raise SceneError(
            f"table of gravity {str(path)!r} cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from None
    if len(text) > LARGEST_FILE:
        raise SceneError(f"table of gravity {str(path)!r} is longer than {LARGEST_FILE} bytes; give fewer rows")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip(' "')[:1].isalpha()]
    try:
        rows = np.loadtxt(io.StringIO("\n".join(lines)), delimiter=",", ndmin=2) if lines else np.zeros((0, 0))
    except ValueError as error:
        raise SceneError(f"table of gravity {str(path)!r}: {error}; write rows such as 0.01, 0.2, -9.81") from None
    if not rows.size or rows.shape[1] not in (3, 4):
        raise SceneError(
            f"table of gravity {str(path)!r} has {rows.shape[1]} columns; write time [s] and 2 or 3 "
            "components [m/s^2], such as 0.01, 0.2, -9.81"
        )
    return [{"time": row[0], "gravity": row[1:]} for row in rows.tolist()]


def with_gravity_table(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return a scene's `data` with the rows of the table at `path`; a row at time 0 is the scene's `gravity`.

    Raises `SceneError` as `read_gravity_table`, and if gravity at time 0 is given twice.
    """
    rows = read_gravity_table(path)
    start = {}
    if rows[0]["time"] == 0.0:
        if "gravity" in data:
            raise SceneError(
                f"gravity {data['gravity']} and the row at time 0 of {str(path)!r} both say it for the start; leave gravity out"
            )
        start = {"gravity": rows.pop(0)["gravity"]}
    return data | start | {"gravity_changes": rows}
