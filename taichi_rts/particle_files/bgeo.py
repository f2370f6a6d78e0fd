"""Houdini's classic BGEO, version 5, as Houdini, Partio and splashsurf read it: points only, no primitives.

"Documentation on the Public Domain Geometry Library (GPD), Version 5", SideFX: big-endian, every attribute 32 bits a
component. Points are x, y, z, w and then their attributes. Where single precision is too coarse for the positions, they are
written less an offset, which each point has as an attribute of that name.
"""

from __future__ import annotations

import struct

import numpy as np

from taichi_rts.files.unpacking import gunzip
from taichi_rts.particle_files.frame import ParticleFrame, from_arrays, pad

MAGIC = b"BgeoV"
VERSION = 5
END = b"\x00\xff"  # begin and end of the "extra" section, which is empty
FLOAT, INTEGER, INDEX, VECTOR = 0, 1, 4, 5  # kinds of attributes
OFFSET = "offset"
HOUDINI_NAMES = {"velocity": "v"}
OUR_NAMES = {name: ours for ours, name in HOUDINI_NAMES.items()}


def write_bgeo(frame: ParticleFrame) -> bytes:
    """Return `frame` as a BGEO file: velocity is `v`, as Houdini calls it, and `pscale` half the spacing."""
    arrays = frame.arrays()
    positions, offset = arrays.pop("position"), frame.offset
    count = len(positions)
    if offset.any():
        offset = pad(offset[None])
        positions = positions - offset
        arrays[OFFSET] = np.broadcast_to(offset.astype(np.float32), (count, 3))
    if frame.spacing is not None:
        arrays["pscale"] = np.full(count, 0.5 * frame.spacing, np.float32)
    head = [MAGIC, struct.pack(">9i", VERSION, count, 0, 0, 0, len(arrays), 0, 0, 0)]
    row: list[tuple[str, str]] = [("P", "(4,)>f4")]
    for name, values in arrays.items():
        size = values.shape[1] if values.ndim == 2 else 1
        whole = values.dtype.kind in "iu"
        kind = VECTOR if size == 3 and name != OFFSET else INTEGER if whole else FLOAT
        title = HOUDINI_NAMES.get(name, name).encode()
        head.append(struct.pack(">H", len(title)) + title + struct.pack(">Hi", size, kind) + bytes(4 * size))
        row.append((name, f"({size},)>{'i' if whole and kind == INTEGER else 'f'}4"))
    points = np.empty(count, row)
    points["P"][:, :3] = positions
    points["P"][:, 3] = 1.0
    for name, values in arrays.items():
        points[name] = values.reshape(count, -1)
    return b"".join([*head, points.tobytes(), END])


def read_bgeo(data: bytes) -> ParticleFrame:
    """Read the points of a BGEO file, gzipped or not; raises `ValueError` if it is none of version 5."""
    if data[:2] == b"\x1f\x8b":
        data = gunzip(data)
    if data[:5] != MAGIC:
        raise ValueError("it does not begin as a classic BGEO file does")
    version, count, _prims, _groups, _prim_groups, attributes, *_ = struct.unpack_from(">9i", data, 5)
    if version != VERSION:
        raise ValueError(f"it is BGEO version {version}; {VERSION} is needed")
    at = 5 + 9 * 4
    row: list[tuple[str, str]] = [("position", "(4,)>f4")]
    for _ in range(attributes):
        (length,) = struct.unpack_from(">H", data, at)
        name = data[at + 2 : at + 2 + length].decode()
        size, kind = struct.unpack_from(">Hi", data, at + 2 + length)
        at += 2 + length + 6
        if kind == INDEX:  # its default values are strings
            for _ in range(struct.unpack_from(">i", data, at)[0]):
                at += 2 + struct.unpack_from(">H", data, at + 4)[0]
            at += 4
        elif kind in (FLOAT, INTEGER, VECTOR):
            at += 4 * size
        else:
            raise ValueError(f"attribute {name} is of the unknown kind {kind}")
        row.append((OUR_NAMES.get(name, name), f"({size},)>{'i' if kind in (INTEGER, INDEX) else 'f'}4"))
    points = np.frombuffer(data, row, count, at)
    arrays = {name: points[name].astype(points[name].dtype.newbyteorder("=")) for name, _ in row}
    arrays = {name: values[:, 0] if values.shape[1] == 1 else values for name, values in arrays.items()}
    arrays["position"] = arrays["position"][:, :3]
    if OFFSET in arrays and arrays[OFFSET].shape == arrays["position"].shape:
        arrays["position"] = arrays["position"].astype(np.float64) + arrays.pop(OFFSET)
    return from_arrays(arrays)
