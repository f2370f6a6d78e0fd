"""The default renderer: spheres splatted in software by Taichi kernels, on any arch, without a display.

The nearest depth per pixel is an integer minimum and ties go to the lowest index, so that the same arrays
give the same bits on one arch, whatever the threads did.
"""

from typing import NamedTuple

import numpy as np

from taichi_rts.device.backend import has_vulkan_hardware, ti
from taichi_rts.errors import RenderError
from taichi_rts.rendering import flat_kernels, lighting, shade_kernels, splat_kernels
from taichi_rts.rendering.buffers import Buffer
from taichi_rts.rendering.camera import Camera, box_corners, box_edges

LINE_COLOUR = (0.16, 0.17, 0.20)
GROUND_SHADE = 0.5  # opacity of the darkest shadow on the ground
FLOOR_SHADE = 0.08  # opacity of the floor of the outline, in linear light


class Quality(NamedTuple):
    """What a picture may cost: samples per pixel and axis, samples for occlusion and light, pixels of the shadow map."""

    supersample: int
    pairs: int
    taps: int
    shadow_size: int


QUALITIES = {
    "draft": Quality(1, 0, 0, 1),
    "good": Quality(2, 8, 8, 1024),
    "best": Quality(4, 24, 24, 4096),
}


def srgb_to_linear(values) -> np.ndarray:
    """Return linear light of sRGB values in 0 to 1 (IEC 61966-2-1)."""
    values = np.asarray(values, float)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).astype(np.float32)


def linear_to_srgb(values) -> np.ndarray:
    """Return sRGB values of linear light in 0 to 1 (IEC 61966-2-1)."""
    values = np.asarray(values, float)
    return np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)


def checked_arrays(positions, colours, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (N, 3) float32 positions and colours without the rows that are not finite."""
    positions = np.asarray(positions, np.float32)
    colours = np.asarray(colours, np.float32)
    if positions.ndim != 2 or positions.shape[1] not in (2, 3):
        raise RenderError(f"positions have shape {positions.shape}, must be (N, 2) or (N, 3): pass one row a particle")
    if colours.shape != (len(positions), 3):
        raise RenderError(
            f"colours have shape {colours.shape}, must be ({len(positions)}, 3): pass one RGB row for each position"
        )
    if not radius > 0:
        raise RenderError(f"radius = {radius} m must be above 0: half the particle spacing is a good choice")
    if positions.shape[1] == 2:
        positions = np.pad(positions, ((0, 0), (0, 1)))
    if not np.isfinite(positions).all():
        kept = np.isfinite(positions).all(axis=1)
        positions, colours = positions[kept], colours[kept]
    return np.ascontiguousarray(positions), np.ascontiguousarray(colours)


class Splatter:
    """Draws particles as lit spheres into a NumPy image; call after `ti.init`."""

    def __init__(
        self,
        width: int = 1280,
        height: int = 720,
        supersample: int | None = None,
        background=(1, 1, 1),
        shadows: bool = True,
        *,
        quality: str = "good",
        transparent: bool = False,
    ):
        """Allocate the buffers; `background` is sRGB, `supersample` the samples per pixel and axis if not the quality's.

        `quality` is one of `QUALITIES`; `transparent` pictures have an alpha channel and only shadows for a background.
        Raises `RenderError` for an unknown quality and for too many samples.
        """
        if quality not in QUALITIES:
            raise RenderError(f"quality {quality!r} is unknown: choose one of {', '.join(QUALITIES)}")
        self.quality = QUALITIES[quality]
        supersample = self.quality.supersample if supersample is None else supersample
        if min(width, height) < 1 or not 1 <= supersample <= 8 or width * height * supersample**2 > 2**29:
            raise RenderError(
                f"picture of {width} x {height} pixels with supersample = {supersample} is impossible: "
                "sides must be at least 1, supersample 1 to 8, all samples at most 2^29: lower one of them, or the quality"
            )
        self.width, self.height, self.supersample, self.transparent = width, height, supersample, transparent
        self.shadows = shadows and self.quality.taps > 0
        self._background = srgb_to_linear(background)
        self._fine = (width * supersample, height * supersample)
        samples, pixels = self._fine[0] * self._fine[1], width * height
        self._depth, self._nearest, self._lines = (Buffer(ti.i32, samples) for _ in range(3))
        self._tiles = Buffer(ti.i32, _tile_count(*self._fine))
        self._shadow_depth = Buffer(ti.i32, self.quality.shadow_size**2)
        self._shadow_tiles = Buffer(ti.i32, _tile_count(self.quality.shadow_size, self.quality.shadow_size))
        self._spheres = Buffer(ti.i32, _sums_count(*self._fine))
        self._shaded = Buffer(ti.i32, _sums_count(self.quality.shadow_size, self.quality.shadow_size))
        self._veil, self._smooth_veil = (ti.Vector.ndarray(3, ti.f32, pixels) for _ in range(2))
        self._linear = Buffer(ti.f32, 255 * 4 + 1)  # 8-bit colours fall on entries
        self._linear.from_numpy(srgb_to_linear(np.linspace(0, 1, 255 * 4 + 1)))
        self._encode = Buffer(ti.i32, 4096)  # entry k is linear light (k / 4095)^2
        self._encode.from_numpy(np.rint(255 * linear_to_srgb(np.linspace(0, 1, 4096) ** 2)).astype(np.int32))
        pattern = shade_kernels.sampling_pattern(self.quality.pairs, self.quality.taps)
        self._pattern = ti.Vector.ndarray(3, ti.f32, max(len(pattern), 1))
        if len(pattern):
            self._pattern.from_numpy(pattern)
        self._flat = ti.cfg.arch == ti.vulkan and not has_vulkan_hardware()
        self._capacity = 0
        self._reserve(1)

    def _reserve(self, count: int) -> None:
        """Make room for `count` particles; it doubles, so that a growing count allocates seldom."""
        if count <= self._capacity:
            return
        self._capacity = max(count, 2 * self._capacity)
        self._points, self._tints = (ti.Vector.ndarray(3, ti.f32, self._capacity) for _ in range(2))
        self._sprites = ti.Vector.ndarray(4, ti.f32, self._capacity)

    def draw(
        self, positions, colours, radius: float, camera: Camera, outline=None, *, box: bool = True, floor: bool = True
    ) -> np.ndarray:
        """Return the picture, (height, width, 3) uint8, or 4 if `transparent`.

        `positions` (N, 2 or 3) [m] and `radius` [m] are in the scene's units, `colours` (N, 3) are
        sRGB in 0 to 1; `outline` is (lower, upper) of a box to draw as a wireframe,
        whose floor then catches the shadows; without `box` its edges are left out, without `floor` the shadows on it.
        """
        flat = np.ndim(positions) == 2 and np.shape(positions)[1] == 2
        positions, colours = checked_arrays(positions, colours, radius)
        count = len(positions)
        self._reserve(count)
        if count:
            splat_kernels.upload_points(positions, colours, self._linear, count, self._points, self._tints)
        basis = np.array(camera.basis())
        eye = np.asarray(camera.eye, float)
        width, height = self._fine
        perspective = camera.orthographic_height is None
        lens = (camera.focal_pixels(height), float(perspective), width / 2, height / 2)
        bounds = lighting.bounds(positions, outline)
        light = lighting.light_direction(camera, basis)
        size = self.quality.shadow_size
        light_basis, light_eye, light_lens = lighting.light_view(light, bounds, radius, size)

        clear = splat_kernels.clear_buffer
        clear(self._shadow_depth, splat_kernels.FAR)
        clear(self._depth, splat_kernels.FAR)
        clear(self._nearest, splat_kernels.NO_PARTICLE)
        clear(self._lines, 0)
        clear(self._spheres, 0)
        clear(self._shaded, 0)
        if self.shadows and not flat and count:
            self._project(count, radius, light_eye, light_basis, light_lens)
            self._splat(count, light_lens, (size, size), self._shadow_tiles, self._shaded, self._shadow_depth)
        if count:
            self._project(count, radius, eye, basis, lens)
            self._splat(count, lens, self._fine, self._tiles, self._spheres, self._depth, self._nearest)
        if outline is not None and box:
            self._trace(outline, camera, lens, radius)
        extent = float(np.linalg.norm(bounds[1] - bounds[0]))
        ground = lighting.ground_plane(
            camera, basis, bounds, extent, self.shadows and outline is not None and floor and not flat
        )
        reach = max(5 * radius, 0.03 * extent)
        texel = 1.0 / light_lens[0]
        softness = max(0.012 * extent / texel, 1.5)
        light_frame = (basis @ (light_eye - eye), *(light_basis @ basis.T))
        size_and_samples = (width, height, self.supersample, self.quality.pairs, self.quality.taps)
        shade_kernels.count_samples(
            self._depth,
            self._spheres,
            self._shaded,
            lens,
            *ground,
            *light_frame[:3],
            light_lens,
            size,
            softness,
            reach,
            *size_and_samples,
            self._veil,
        )
        shade_kernels.measure_veil(
            self._depth,
            self._shadow_depth,
            lens,
            *ground,
            *light_frame,
            light_lens,
            size,
            softness,
            3 * radius + (softness + 1) * texel,
            reach,
            *size_and_samples,
            self._pattern,
            self._veil,
        )
        shade_kernels.smooth_veil(
            self._veil, max(4 * radius, 0.01 * extent), self.width, self.height, self._smooth_veil
        )
        picture = np.empty(self.width * self.height, np.int32)
        shade_kernels.shade_picture(
            self._sprites,
            self._tints,
            self._depth,
            self._nearest,
            self._lines,
            self._smooth_veil,
            self._encode,
            lens,
            basis @ light,
            basis @ (np.asarray(camera.up, float) / np.linalg.norm(camera.up)),
            self._background,
            int(not self.transparent),
            *ground,
            GROUND_SHADE if ground[0][3] > 0 else 0.0,
            FLOOR_SHADE,
            *lighting.floor_frame(camera, basis, bounds),
            (0.0, 0.0, 0.0) if flat or outline is None else lighting.haze(camera, basis, bounds),
            srgb_to_linear(LINE_COLOUR),
            radius,
            width,
            height,
            self.supersample,
            picture,
        )
        channels = picture.view(np.uint8).reshape(self.height, self.width, 4)
        return channels if self.transparent else np.ascontiguousarray(channels[:, :, :3])

    def _project(self, count: int, radius: float, eye, basis, lens) -> None:
        splat_kernels.project_points(self._points, count, radius, eye, *basis, lens, self._sprites)

    def _splat(self, count: int, lens, size: tuple[int, int], tiles, sums, depth, nearest=None) -> None:
        """Enter the least depths, and what is nearest: few spheres first, then always more that those do not hide.

        `sums` then tells where there are any at all.
        """
        splat_kernels.mark_tiles(self._sprites, count, *size, sums)
        splat_kernels.sum_tiles(*size, sums)
        if self._flat:
            self._splat_flat(count, lens, size, depth, nearest)
            return
        splat_kernels.clear_buffer(tiles, splat_kernels.FAR)
        strides = splat_kernels.STRIDES if count > splat_kernels.FEW else (1,)
        for stride in strides:
            splat_kernels.splat_depths(self._sprites, count, stride, lens, *size, tiles, depth)
            if len(strides) > 1:
                splat_kernels.measure_tiles(depth, *size, tiles)
        if nearest is not None:
            splat_kernels.splat_numbers(self._sprites, count, lens, *size, tiles, depth, nearest)

    def _splat_flat(self, count: int, lens, size: tuple[int, int], depth, nearest) -> None:
        side = 2 * int(np.ceil(self._sprites.to_numpy()[:count, 3].max())) + 1
        chunk = max(flat_kernels.MOST // side**2, 1)
        for first in range(0, count, chunk):
            last = min(first + chunk, count)
            flat_kernels.splat_depths(self._sprites, first, last, side, lens, *size, depth)
        for first in range(0, count if nearest is not None else 0, chunk):
            last = min(first + chunk, count)
            flat_kernels.splat_numbers(self._sprites, first, last, side, lens, *size, depth, nearest)

    def _trace(self, outline, camera: Camera, lens, radius: float) -> None:
        """Draw the wireframe of a box into the line buffer; its edges end at the camera's near plane."""
        width, height = self._fine
        corners = box_corners(*outline)
        ends = camera.project(corners, width, height)
        near = 1e-3 * float(np.max(np.abs(ends[:, 2])))
        segments = []
        for a, b in box_edges(len(outline[0])):
            pair, depths = corners[[a, b]], ends[[a, b], 2]
            if depths.max() <= near:
                continue
            if depths.min() < near:
                cut = (near - depths[0]) / (depths[1] - depths[0])
                pair[int(depths[1] < near)] = corners[a] + cut * (corners[b] - corners[a])
            segments.append(camera.project(pair, width, height).ravel())
        if not segments:
            return
        table = np.array(segments, np.float32)
        longest = float(np.max(np.abs(table[:, :2] - table[:, 3:5])))
        steps = int(min(longest + 2, 1e5))
        half_width = 0.5 * self.supersample * max(self.height / 720, 1.0)
        splat_kernels.trace_lines(
            table, steps, half_width, lens, width, height, 2 * radius, 200, 45, self._depth, self._lines
        )


def _tile_count(width: int, height: int) -> int:
    side = splat_kernels.TILE
    return -(-width // side) * -(-height // side)


def _sums_count(width: int, height: int) -> int:
    side = splat_kernels.BROAD
    return (-(-width // side) + 1) * (-(-height // side) + 1)
