"""The splatter's spheres for software Vulkan: one parallel loop over all pixels of all spheres, and none in it.

Mesa's lavapipe (22.3.6) leaves a loop in a kernel after the first atomic in it: a sphere would have two pixels. Nothing here is
fast; devices in hardware and other arches take `splat_kernels`.
"""

from taichi_rts.device.backend import ti
from taichi_rts.rendering.splat_kernels import Ints, Vectors4, enter, first_pixel, metres_per_pixel, vec4

MOST = 2**28  # pixels in a call: their number is 32-bit


@ti.func
def visit(sprite, i, n, m, lens, width, height, depth: ti.template(), nearest: ti.template(), naming: ti.template()):
    """Visit one pixel of the square around sphere i, in row n and column m, if it is the sphere's."""
    x = first_pixel(sprite[0], sprite[3]) + m
    y = first_pixel(sprite[1], sprite[3]) + n
    dx = ti.cast(x, ti.f32) + ti.f32(0.5) - sprite[0]
    dy = ti.cast(y, ti.f32) + ti.f32(0.5) - sprite[1]
    if dx * dx + dy * dy < sprite[3] * sprite[3] and x < width and y < height:
        enter(sprite, i, x, y, metres_per_pixel(sprite[2], lens), width, depth, nearest, naming)


@ti.kernel
def splat_depths(
    sprites: Vectors4,
    first: ti.i32,
    last: ti.i32,
    side: ti.i32,
    lens: vec4,
    width: ti.i32,
    height: ti.i32,
    depth: Ints,
):
    """Enter the least depth of the spheres from `first` to before `last`, none wider than `side` pixels."""
    for k, n, m in ti.ndrange(last - first, side, side):
        visit(sprites[first + k], first + k, n, m, lens, width, height, depth, depth, False)


@ti.kernel
def splat_numbers(
    sprites: Vectors4,
    first: ti.i32,
    last: ti.i32,
    side: ti.i32,
    lens: vec4,
    width: ti.i32,
    height: ti.i32,
    depth: Ints,
    nearest: Ints,
):
    """Enter the number of the nearest sphere, likewise."""
    for k, n, m in ti.ndrange(last - first, side, side):
        visit(sprites[first + k], first + k, n, m, lens, width, height, depth, nearest, True)
