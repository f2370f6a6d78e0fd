"""Light, ground and haze of a picture as plain numbers, in NumPy only; the kernels do the rest.

Boxes are pairs of corners [m], (3,) each. View coordinates are along right, up and forward of the camera, from its eye.
"""

import numpy as np

from taichi_rts.rendering.camera import Camera, box_corners

HAZE = 0.07  # share of the background at the far end of the box, in linear light: more would bend the colours


def bounds(positions: np.ndarray, outline) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the picture: the outline if there is one, so that light stays steady."""
    if outline is not None:
        corners = box_corners(*outline)
        return corners.min(axis=0), corners.max(axis=0)
    if len(positions) == 0:
        return np.zeros(3), np.ones(3)
    return positions.min(axis=0).astype(float), positions.max(axis=0).astype(float)


def light_direction(camera: Camera, basis: np.ndarray) -> np.ndarray:
    """Return the unit vector to the light: high, over the viewer's left shoulder."""
    upward = np.asarray(camera.up, float) / np.linalg.norm(camera.up)
    light = 1.1 * upward - 0.55 * basis[0] - 0.6 * basis[2] + 0.3 * basis[1]
    return light / np.linalg.norm(light)


def light_view(light: np.ndarray, box, radius: float, size: int):
    """Return basis, origin and lens of the light's parallel view of the whole box, `size` x `size` pixels."""
    middle = 0.5 * (box[0] + box[1])
    reach = 0.5 * float(np.linalg.norm(box[1] - box[0])) + 2 * radius
    view = Camera(tuple(middle + light * (reach + 2 * radius)), tuple(middle), tuple(np.roll(light, 1)))
    return (
        np.array(view.basis()),
        np.array(view.eye),
        (size / (2 * reach), 0.0, size / 2, size / 2),
    )


def ground_plane(camera: Camera, basis: np.ndarray, box, extent: float, wanted: bool):
    """Return the plane under the box in view coordinates, and how deep it reaches; height 0 for none."""
    upward = np.asarray(camera.up, float) / np.linalg.norm(camera.up)
    corners = box_corners(*box)
    level = float(np.min(corners @ upward))
    above = float(np.dot(camera.eye, upward)) - level
    reach = float(np.max(corners @ basis[2] - np.dot(camera.eye, basis[2]))) + extent
    return (*(basis @ upward), above if wanted and above > 0 else 0.0), reach


def floor_frame(camera: Camera, basis: np.ndarray, box):
    """Return the box's floor in view coordinates: a corner [m], and its two sides a as a / |a|^2 [1/m].

    A box that stands askew has no floor: its sides are then such that nothing is on it.
    """
    upward = np.asarray(camera.up, float) / np.linalg.norm(camera.up)
    lower, upper = np.asarray(box[0], float), np.asarray(box[1], float)
    corner = lower if upward.sum() > 0 else upper
    sides = [side for side in np.diag(upper - lower) if np.any(side) and abs(side @ upward) < 1e-6 * np.abs(side).max()]
    if len(sides) != 2:
        return np.zeros(3), np.zeros(3), np.zeros(3)
    signs = 1.0 if corner is lower else -1.0
    return basis @ (corner - np.asarray(camera.eye, float)), *(signs * (basis @ side) / (side @ side) for side in sides)


def haze(camera: Camera, basis: np.ndarray, box) -> tuple[float, float, float]:
    """Return the depth [m] where the box begins, 1 / its depth [1/m], and the share of the background at its end."""
    depth = box_corners(*box) @ basis[2] - np.dot(camera.eye, basis[2])
    return float(depth.min()), 1.0 / max(float(np.ptp(depth)), 1e-9), HAZE
