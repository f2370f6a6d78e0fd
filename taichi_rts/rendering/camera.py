"""Where the picture is taken from: a pinhole or orthographic camera, in NumPy only."""

from dataclasses import dataclass, replace

import numpy as np

from taichi_rts.errors import RenderError

MARGIN = 0.93  # share of the half picture that a framed box may fill


def box_corners(lower, upper) -> np.ndarray:
    """Return the corners of a box, (8, 3) in binary order; a 2D box gives (4, 3) with z = 0."""
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    if lower.shape != upper.shape or lower.shape not in ((2,), (3,)):
        raise RenderError(
            f"a box needs two corners of 2 or 3 components each, got shapes {lower.shape} and {upper.shape}: "
            "give lower and upper in the dimension of the scene"
        )
    dim = len(lower)
    bits = (np.arange(2**dim)[:, None] >> np.arange(dim)) & 1
    corners = np.where(bits == 1, upper, lower)
    return np.pad(corners, ((0, 0), (0, 3 - dim)))


def box_edges(dim: int) -> np.ndarray:
    """Return index pairs into `box_corners` of the box's edges: (12, 2), or (4, 2) in 2D."""
    pairs = [(a, a | (1 << k)) for a in range(2**dim) for k in range(dim) if not a & (1 << k)]
    return np.array(pairs)


@dataclass(frozen=True)
class Camera:
    """A camera at `eye` [m] that looks at `target` [m].

    `field_of_view` is the vertical angle [degrees]; with `orthographic_height` [m] the projection is
    parallel and the picture is that high.
    """

    eye: tuple
    target: tuple
    up: tuple = (0.0, 1.0, 0.0)
    field_of_view: float = 35.0
    orthographic_height: float | None = None

    def __post_init__(self):
        if not 1.0 <= self.field_of_view <= 170.0:
            raise RenderError(f"field_of_view = {self.field_of_view} degrees is outside 1 to 170: 35 suits most scenes")
        if self.orthographic_height is not None and not self.orthographic_height > 0:
            raise RenderError(
                f"orthographic_height = {self.orthographic_height} m must be above 0: "
                "give the height of the view, or None for perspective"
            )
        if np.allclose(self.eye, self.target, rtol=0, atol=1e-12):
            raise RenderError(
                f"eye and target are both {self.eye}; they must differ: move the eye away from the target"
            )

    @classmethod
    def framing(
        cls,
        lower,
        upper,
        azimuth: float = 28.0,
        elevation: float = 22.0,
        aspect: float = 16 / 9,
        up=(0.0, 1.0, 0.0),
        field_of_view: float = 35.0,
        *,
        perspective: bool = True,
    ) -> "Camera":
        """Return a camera that sees the whole box; a 2D box is seen from the front, and never in perspective.

        `azimuth` and `elevation` [degrees] turn the eye around `up` and above the ground; at azimuth 0
        the x axis runs to the right of the picture.
        """
        corners = box_corners(lower, upper)
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        extent = np.ptp(corners, axis=0)
        if len(corners) == 4:
            eye = centre + np.array([0.0, 0.0, np.max(extent) + 1.0])
            camera = cls(tuple(eye), tuple(centre), tuple(up))
            return replace(camera, orthographic_height=camera._height_of(corners, aspect))
        across, front, upward = _turntable(up)
        az, el = np.radians(azimuth), np.radians(elevation)
        outward = np.cos(el) * (np.sin(az) * across + np.cos(az) * front) + np.sin(el) * upward
        camera = cls(tuple(centre + outward), tuple(centre), tuple(up), field_of_view)
        if not perspective:
            eye = centre + float(np.linalg.norm(extent)) * outward
            return replace(camera, eye=tuple(eye), orthographic_height=camera._height_of(corners, aspect))
        half_height = np.tan(np.radians(field_of_view) / 2) * MARGIN
        for _ in range(6):  # perspective makes the near side larger: move the box to the middle of the picture
            camera, distance = _back_off(camera, corners, outward, half_height, aspect)
            right, above, _ = camera.basis()
            flat = camera.project(corners, 2, 2)[:, :2]
            middle = (0.5 * (flat.min(axis=0) + flat.max(axis=0)) - 1.0) * np.tan(np.radians(field_of_view) / 2)
            target = np.asarray(camera.target) + distance * (middle[0] * right - middle[1] * above)
            camera = replace(camera, eye=tuple(target + distance * outward), target=tuple(target))
        return _back_off(camera, corners, outward, half_height, aspect)[0]

    def _height_of(self, corners: np.ndarray, aspect: float) -> float:
        """Return the height [m] of a picture in parallel projection that holds the corners, (K, 3) [m]."""
        right, above, _ = self.basis()
        return float(max(np.ptp(corners @ above), np.ptp(corners @ right) / aspect)) / MARGIN

    def basis(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the unit vectors right, up and forward of the picture."""
        forward = np.subtract(self.target, self.eye, dtype=float)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, np.asarray(self.up, float))
        if np.linalg.norm(right) < 1e-6 * float(np.linalg.norm(self.up)):  # looking along `up`
            right = np.cross(forward, np.roll(np.asarray(self.up, float), 1))
        right = right / np.linalg.norm(right)
        return right, np.cross(right, forward), forward

    def orbited(self, azimuth: float, elevation: float) -> "Camera":
        """Return the camera turned around its target by angles [degrees]; it stops short of the poles."""
        across, front, upward = _turntable(self.up)
        offset = np.subtract(self.eye, self.target, dtype=float)
        distance = float(np.linalg.norm(offset))
        az = np.arctan2(offset @ across, offset @ front) + np.radians(azimuth)
        el = np.arcsin(np.clip(offset @ upward / distance, -1, 1)) + np.radians(elevation)
        el = np.clip(el, -1.55, 1.55)
        outward = np.cos(el) * (np.sin(az) * across + np.cos(az) * front) + np.sin(el) * upward
        return replace(self, eye=tuple(np.asarray(self.target) + distance * outward))

    def panned(self, right: float, up: float) -> "Camera":
        """Return the camera moved sideways by shares of the picture's height at the target."""
        across, above, _ = self.basis()
        shift = self.view_height() * (right * across + up * above)
        return replace(self, eye=tuple(self.eye + shift), target=tuple(self.target + shift))

    def zoomed(self, factor: float) -> "Camera":
        """Return the camera that sees `factor` times as much: below 1 is closer."""
        if self.orthographic_height is not None:
            return replace(self, orthographic_height=factor * self.orthographic_height)
        offset = np.subtract(self.eye, self.target, dtype=float)
        return replace(self, eye=tuple(np.asarray(self.target) + factor * offset))

    def view_height(self) -> float:
        """Return the height [m] of the picture at the target's distance."""
        distance = float(np.linalg.norm(np.subtract(self.eye, self.target, dtype=float)))
        height = 2 * distance * float(np.tan(np.radians(self.field_of_view) / 2))
        return height if self.orthographic_height is None else self.orthographic_height

    def focal_pixels(self, height: int) -> float:
        """Return pixels per metre at unit depth (perspective) or everywhere (orthographic)."""
        if self.orthographic_height is not None:
            return height / self.orthographic_height
        return 0.5 * height / float(np.tan(np.radians(self.field_of_view) / 2))

    def project(self, points, width: int, height: int) -> np.ndarray:
        """Return (N, 3): pixel x (to the right), pixel y (downward) and depth [m] along the view.

        What is not in front of a perspective camera (depth <= 0) has no pixel: x and y are NaN.
        """
        points = np.asarray(points, float)
        if points.shape[1] == 2:
            points = np.pad(points, ((0, 0), (0, 1)))
        right, up, forward = self.basis()
        offset = points - np.asarray(self.eye, float)
        depth = offset @ forward
        scale = np.full(len(points), self.focal_pixels(height))
        if self.orthographic_height is None:
            scale = np.where(depth > 0, scale / np.where(depth > 0, depth, 1.0), np.nan)
        x = 0.5 * width + scale * (offset @ right)
        y = 0.5 * height - scale * (offset @ up)
        return np.stack([x, y, depth], axis=1)


def _turntable(up) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the turntable's axes: across (where azimuth is 90 degrees), front (azimuth 0) and up."""
    upward = np.asarray(up, float) / np.linalg.norm(up)
    across = np.array([1.0, 0.0, 0.0]) if abs(upward[0]) < 0.9 else np.array([0.0, -1.0, 0.0])
    front = np.cross(across, upward)
    front = front / np.linalg.norm(front)
    return np.cross(upward, front), front, upward


def _back_off(camera: Camera, corners, outward, half_height: float, aspect: float) -> tuple[Camera, float]:
    """Move the eye along `outward` to the least distance at which every corner is in the picture."""
    right, up, _ = camera.basis()
    offset = corners - np.asarray(camera.target)
    toward = offset @ outward
    needed = np.maximum(np.abs(offset @ up), np.abs(offset @ right) / aspect) / half_height
    distance = float(np.max(toward + needed))
    return replace(camera, eye=tuple(np.asarray(camera.target) + distance * outward)), distance
