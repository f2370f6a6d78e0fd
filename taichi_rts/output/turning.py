"""Turning particles so that up is the axis that another tool takes for it: y in Houdini, z in Blender."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np

from taichi_rts.particle_files.frame import ParticleFrame, pad

UpAxis = Literal["y", "z"]
UP = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


def rotation_to(up: tuple[float, float, float], axis: UpAxis) -> np.ndarray:
    """Return the rotation, (3, 3), that turns the unit vector `up` to `axis` by the smallest angle.

    R = 1 + K + K^2 / (1 + cos), K being the cross product with up x axis (Rodrigues). Half a turn is about x.
    """
    start, end = np.asarray(up, float), UP[axis]
    cosine = float(start @ end)
    if cosine < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    a, b, c = np.cross(start, end)
    cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    turn = np.eye(3) + cross + cross @ cross / (1.0 + cosine)
    return turn + 0.0  # no -0.0


def turned(frame: ParticleFrame, rotation: np.ndarray) -> ParticleFrame:
    """Return `frame` with positions, vectors and origin turned; in two dimensions unless it leaves the plane."""
    flat = frame.dim == 2 and bool((rotation[2] == [0.0, 0.0, 1.0]).all())

    def turn(values: np.ndarray) -> np.ndarray:
        if values.ndim != 2 or values.shape[1] != frame.dim:
            return values
        result = pad(values) @ rotation.T.astype(values.dtype)
        return np.ascontiguousarray(result[:, :2] if flat else result)

    origin = None if frame.origin is None else tuple(turn(np.asarray([frame.origin], float))[0].tolist())
    attributes = {name: turn(values) for name, values in frame.attributes.items()}
    return dataclasses.replace(frame, positions=turn(frame.positions), attributes=attributes, origin=origin)
