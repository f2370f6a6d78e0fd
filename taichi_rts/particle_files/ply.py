"""PLY, binary and little-endian: a vertex for each particle, a property for each number, and faces for a surface.

G. Turk, "The PLY Polygon File Format" (1994). Reals are single precision, the only kind that every reader takes; positions are
double precision where single is too coarse for them.
"""

from __future__ import annotations

import re

import numpy as np

from taichi_rts.particle_files.frame import AXES, ParticleFrame, from_columns

NAMES = {
    "f4": "float",
    "f8": "double",
    "i4": "int",
    "u4": "uint",
    "i2": "short",
    "u2": "ushort",
    "i1": "char",
    "u1": "uchar",
}
ALIASES = {
    "float32": "f4",
    "float64": "f8",
    "int32": "i4",
    "uint32": "u4",
    "int16": "i2",
    "uint16": "u2",
    "int8": "i1",
    "uint8": "u1",
}
CODES = {name: code for code, name in NAMES.items()} | ALIASES
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def write_ply(frame: ParticleFrame, triangles: np.ndarray | None = None) -> bytes:
    """Return `frame` as a PLY file; `triangles`, (T, 3), join its particles to a surface."""
    columns = frame.columns()
    kinds = {name: "i4" if values.dtype.kind in "iu" else "f4" for name, values in columns.items()}
    if frame.needs_double:
        kinds |= dict.fromkeys(AXES, "f8")
    head = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment time {frame.time!r}",
        f"element vertex {len(frame.positions)}",
        *(f"property {NAMES[kind]} {name}" for name, kind in kinds.items()),
    ]
    body = pack(columns, {name: "<" + kind for name, kind in kinds.items()})
    if triangles is not None:
        head += [f"element face {len(triangles)}", "property list uchar int vertex_indices"]
        corners = {"count": np.full(len(triangles), 3), "indices": triangles}
        body += pack(corners, {"count": "u1", "indices": "(3,)<i4"})
    return "\n".join([*head, "end_header", ""]).encode() + body


def pack(columns: dict[str, np.ndarray], kinds: dict[str, str]) -> bytes:
    """Return rows of all columns, one behind the other."""
    rows = np.empty(len(next(iter(columns.values()))), list(kinds.items()))
    for name, values in columns.items():
        rows[name] = values
    return rows.tobytes()


def read_ply(data: bytes) -> ParticleFrame:
    """Read the vertices of a PLY file, binary or text; raises `ValueError` if it is none."""
    head, body = (*re.split(rb"end_header\r?\n", data, maxsplit=1), None)[:2]
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()] if head else []
    if body is None or lines[:1] != [["ply"]]:
        raise ValueError("it does not begin as a PLY file does")
    kinds: list[tuple[str, str]] = []
    count, element, order, time = 0, "", "", 0.0
    for words in lines[1:]:
        if words[:1] == ["format"]:
            order = words[1]
        elif words[:2] == ["comment", "time"]:
            time = float(words[2])
        elif words[:1] == ["element"]:
            element = words[1]
            if element == "vertex":
                count = int(words[2])
            elif not kinds:
                raise ValueError(f"its first element is {element}, not vertex")
        elif words[:1] == ["property"] and element == "vertex":
            if words[1] not in CODES:
                raise ValueError(f"property {words[-1]} of its vertices is a {words[1]}, not a number")
            kinds.append((words[2], CODES[words[1]]))
    if order in ORDERS:
        rows = np.frombuffer(body, [(name, ORDERS[order] + kind) for name, kind in kinds], count)
        columns = {name: rows[name].astype(kind) for name, kind in kinds}
    elif order == "ascii":
        table = np.loadtxt(body.decode("ascii").splitlines()[:count], ndmin=2)
        columns = {name: table[:, k].astype(kind) for k, (name, kind) in enumerate(kinds)}
    else:
        raise ValueError(f"its format {order!r} is unknown")
    frame = from_columns(columns)
    return ParticleFrame(frame.positions, frame.attributes, time)
