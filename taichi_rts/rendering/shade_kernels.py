"""Taichi kernels of the splatter: from nearest depths and particles to a lit picture.

Ambient occlusion and shadow are found once per final pixel (a `veil`: depth, openness to the sky, light),
then every supersample is lit on its own and the average goes from linear light to sRGB.
"""

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.rendering.splat_kernels import (
    FAR,
    NO_PARTICLE,
    Ints,
    Vectors3,
    Vectors4,
    is_marked,
    metres_per_pixel,
    vec3,
    vec4,
)

TURNS = 16  # sampling patterns, one for each pixel of a 4 x 4 tile
GOLDEN = np.pi * (3 - np.sqrt(5))
NOTHING = 1e30  # depth of a pixel that shows neither fluid nor ground


def sampling_pattern(pairs: int, taps: int) -> np.ndarray:
    """Return (TURNS * (pairs + taps), 3): direction and distance in units of the reach, on a golden-angle spiral.

    In each turn `pairs` are for occlusion, sampled densely close by, and `taps` for light, evenly over a disc.
    """
    turn = np.arange(TURNS)[:, None] / TURNS
    pair, tap = np.arange(pairs), np.arange(taps)
    angle = np.concatenate([GOLDEN * pair + np.pi * turn, GOLDEN * tap + 2 * np.pi * turn], axis=1)
    near = ((pair + turn + 0.5) / max(pairs, 1)) ** 2
    even = np.broadcast_to(np.sqrt((tap + 0.5) / max(taps, 1)), (TURNS, taps))
    distance = np.concatenate([near, even], axis=1)
    return np.stack([np.cos(angle), np.sin(angle), distance], axis=-1).reshape(-1, 3).astype(np.float32)


@ti.func
def view_offset(x, y, z, lens):
    """Position of pixel (x, y) at depth z from the eye, along right and up (pixels count downward)."""
    unit = metres_per_pixel(z, lens)
    return (x - lens[2]) * unit, (lens[3] - y) * unit


@ti.func
def ground_depth(x, y, lens, ground, ground_reach):
    """Depth at which the ray of a pixel meets the ground; NOTHING if it does not.

    `ground` is (components of its normal along right, up, forward; signed height of the eye above it).
    """
    side, above = view_offset(x, y, ti.f32(1.0), lens)
    z = ti.f32(NOTHING)
    if lens[1] > 0:
        slope = side * ground[0] + above * ground[1] + ground[2]
        if slope * ground_reach < -ground[3]:
            z = -ground[3] / slope
    else:
        if ground[2] < ti.f32(-1e-6):
            z = -(ground[3] + side * ground[0] + above * ground[1]) / ground[2]
    return ti.select(ti.min(ground[3], z) > 0, z, ti.f32(NOTHING))


@ti.func
def open_sky(x, y, z, first, pairs, reach, lens, width, height, pattern: ti.template(), depth: ti.template()):
    """Share of the sky that the depths around a pixel leave open.

    Opposite samples are taken in pairs and their slopes added, so that a plane, however tilted, hides
    nothing.
    """
    unit = metres_per_pixel(z, lens)
    widen = reach / unit
    blocked = ti.f32(0.0)
    for k in range(pairs):
        arm = pattern[first + k]
        span = ti.max(arm[2] * widen, ti.f32(2.0))  # [pixels]
        dx = arm[0] * span
        dy = arm[1] * span
        distance = span * unit
        slope = ti.f32(0.0)
        for side in ti.static((-1, 1)):
            u = ti.min(ti.max(ti.cast(x + side * dx, ti.i32), 0), width - 1)
            v = ti.min(ti.max(ti.cast(y + side * dy, ti.i32), 0), height - 1)
            bits = depth[v * width + u]
            rise = -distance  # nothing there: as open as a slope of 45 degrees away from the viewer
            if bits != FAR:
                rise = z - ti.bit_cast(bits, ti.f32)
                rise = ti.select(rise > ti.f32(4.0) * reach, ti.f32(0.0), rise)  # something far in front
            slope += ti.min(ti.max(rise / distance, ti.f32(-1.0)), ti.f32(2.0))
        blocked += ti.min(ti.max(slope * ti.f32(0.5), ti.f32(0.0)), ti.f32(1.0))
    return ti.f32(1.0) - blocked / ti.cast(ti.max(pairs, 1), ti.f32)


@ti.kernel
def count_samples(
    depth: Ints,
    spheres: Ints,
    shaded: Ints,
    lens: vec4,
    ground: vec4,
    ground_reach: ti.f32,
    light_origin: vec3,
    light_right: vec3,
    light_up: vec3,
    light_lens: vec4,
    shadow_size: ti.i32,
    softness: ti.f32,
    reach: ti.f32,
    width: ti.i32,
    height: ti.i32,
    supersample: ti.i32,
    pairs: ti.i32,
    taps: ti.i32,
    veil: Vectors3,
):
    """Enter depth, and how many samples each final pixel needs for openness and for light: none where they would find nothing.

    So it is on most of the ground, which is far from all spheres. `spheres` and `shaded` are the sums of the broad tiles of
    picture and shadow map that spheres touch (`sum_tiles`).
    """
    columns = width // supersample
    for p in range(veil.shape[0]):
        row = p // columns
        column = p - row * columns
        x = ti.cast(column * supersample + supersample // 2, ti.f32) + ti.f32(0.5)
        y = ti.cast(row * supersample + supersample // 2, ti.f32) + ti.f32(0.5)
        bits = depth[ti.cast(y, ti.i32) * width + ti.cast(x, ti.i32)]
        z = ti.bit_cast(bits, ti.f32)
        if bits == FAR:
            z = ground_depth(x, y, lens, ground, ground_reach)
        sky, light = 0, 0
        if z < ti.f32(NOTHING):
            around = ti.max(reach / metres_per_pixel(z, lens), ti.f32(2.0)) + ti.f32(1.0)
            if is_marked(x, y, around, width, height, spheres):
                sky = pairs
            side, above = view_offset(x, y, z, lens)
            spot = vec3(side, above, z) - light_origin
            u = light_lens[2] + light_lens[0] * spot.dot(light_right)
            v = light_lens[3] - light_lens[0] * spot.dot(light_up)
            if is_marked(u, v, softness + ti.f32(1.0), shadow_size, shadow_size, shaded):
                light = taps
        veil[p] = vec3(z, sky, light)


@ti.kernel
def measure_veil(
    depth: Ints,
    shadows: Ints,
    lens: vec4,
    ground: vec4,
    ground_reach: ti.f32,
    light_origin: vec3,
    light_right: vec3,
    light_up: vec3,
    light_forward: vec3,
    light_lens: vec4,
    shadow_size: ti.i32,
    softness: ti.f32,
    bias: ti.f32,
    reach: ti.f32,
    width: ti.i32,
    height: ti.i32,
    supersample: ti.i32,
    pairs: ti.i32,
    taps: ti.i32,
    pattern: Vectors3,
    veil: Vectors3,
):
    """Find depth, openness and light of each final pixel, with a pattern that turns from pixel to pixel.

    The pattern has `pairs` of samples for openness and `taps` for light; with none of them all is open, or lit.

    How many of these a pixel needs is what `count_samples` has put into `veil`.

    The light's frame is given in view coordinates (right, up, forward, from the eye).
    """
    columns = width // supersample
    for p in range(veil.shape[0]):
        needed = veil[p]
        if needed[1] + needed[2] == 0:
            veil[p] = vec3(needed[0], 1, 1)
            continue
        row = p // columns
        column = p - row * columns
        x = ti.cast(column * supersample + supersample // 2, ti.f32) + ti.f32(0.5)
        y = ti.cast(row * supersample + supersample // 2, ti.f32) + ti.f32(0.5)
        bits = depth[ti.cast(y, ti.i32) * width + ti.cast(x, ti.i32)]
        on_ground = bits == FAR
        z = ti.bit_cast(bits, ti.f32)
        if on_ground:
            z = ground_depth(x, y, lens, ground, ground_reach)
        result = vec3(NOTHING, 1, 1)
        if z < ti.f32(NOTHING):
            # 16 turns in a 4 x 4 tile, neighbours far apart; the blur over 4 x 4 pixels then sees each once
            turn = ((row & 3) * 4 + (column & 3)) * 7 % TURNS
            first = turn * (pairs + taps)
            openness = open_sky(x, y, z, first, ti.cast(needed[1], ti.i32), reach, lens, width, height, pattern, depth)
            side, above = view_offset(x, y, z, lens)
            spot = vec3(side, above, z) - light_origin
            u = light_lens[2] + light_lens[0] * spot.dot(light_right)
            v = light_lens[3] - light_lens[0] * spot.dot(light_up)
            limit = spot.dot(light_forward) - ti.select(on_ground, ti.f32(0.0), bias)
            samples = ti.cast(needed[2], ti.i32)
            lit = ti.cast(taps - samples, ti.f32)
            for k in range(samples):
                arm = pattern[first + pairs + k]
                i = ti.floor(u + softness * arm[2] * arm[0], ti.i32)
                j = ti.floor(v + softness * arm[2] * arm[1], ti.i32)
                clear = ti.f32(1.0)
                if i >= 0 and i < shadow_size and j >= 0 and j < shadow_size:
                    if ti.bit_cast(shadows[j * shadow_size + i], ti.f32) < limit:
                        clear = ti.f32(0.0)
                lit += clear
            result = vec3(z, openness, 1)
            if taps > 0:
                result[2] = lit / ti.cast(taps, ti.f32)
        veil[p] = result


@ti.kernel
def smooth_veil(veil: Vectors3, tolerance: ti.f32, columns: ti.i32, rows: ti.i32, smooth: Vectors3):
    """Average openness and light over 4 x 4 pixels of similar depth: the pattern's period."""
    for p in range(veil.shape[0]):
        middle = veil[p]
        if middle[0] < ti.f32(NOTHING):
            row = p // columns
            column = p - row * columns
            corner = ti.min(row + 1, rows - 1) * columns
            opposite = ti.max(row - 2, 0) * columns
            left = ti.max(column - 2, 0)
            right = ti.min(column + 1, columns - 1)
            least = ti.min(middle[1], middle[2])
            least = ti.min(least, veil[corner + left][1], veil[corner + left][2])
            least = ti.min(least, veil[corner + right][1], veil[corner + right][2])
            least = ti.min(least, veil[opposite + left][1], veil[opposite + left][2])
            least = ti.min(least, veil[opposite + right][1], veil[opposite + right][2])
            if least == ti.f32(1.0):  # open and lit all around, as most of the ground is
                smooth[p] = middle
                continue
            total = vec3(0, 0, 0)
            for v in range(ti.max(row - 2, 0), ti.min(row + 2, rows)):
                for u in range(ti.max(column - 2, 0), ti.min(column + 2, columns)):
                    other = veil[v * columns + u]
                    weight = ti.select(ti.abs(other[0] - middle[0]) < tolerance, ti.f32(1.0), ti.f32(0.0))
                    total += weight * vec3(other[1], other[2], 1)
            middle[1] = total[0] / total[2]
            middle[2] = total[1] / total[2]
        smooth[p] = middle


@ti.func
def veil_at(row, column, z, tolerance, columns, rows, veil: ti.template()):
    """Veil of a final pixel; where a silhouette crosses it, of the neighbour nearest in depth."""
    best = veil[row * columns + column]
    if ti.abs(best[0] - z) > tolerance:
        for v in range(ti.max(row - 1, 0), ti.min(row + 2, rows)):
            for u in range(ti.max(column - 1, 0), ti.min(column + 2, columns)):
                other = veil[v * columns + u]
                if ti.abs(other[0] - z) < ti.abs(best[0] - z):
                    best = other
    return best


@ti.func
def on_floor(side, above, z, floor_corner, floor_across, floor_along):
    """Whether a point in view coordinates is above the floor, a parallelogram with sides given as a / |a|^2."""
    spot = vec3(side, above, z) - floor_corner
    u = spot.dot(floor_across)
    v = spot.dot(floor_along)
    return ti.min(u, v) > 0 and ti.max(u, v) < 1


@ti.kernel
def shade_picture(
    sprites: Vectors4,
    tints: Vectors3,
    depth: Ints,
    nearest: Ints,
    lines: Ints,
    veil: Vectors3,
    encode: Ints,
    lens: vec4,
    light: vec3,
    sky: vec3,
    background: vec3,
    opaque: ti.i32,
    ground: vec4,
    ground_reach: ti.f32,
    ground_shade: ti.f32,
    floor_shade: ti.f32,
    floor_corner: vec3,
    floor_across: vec3,
    floor_along: vec3,
    haze: vec3,
    line_colour: vec3,
    radius: ti.f32,
    width: ti.i32,
    height: ti.i32,
    supersample: ti.i32,
    picture: Ints,
):
    """Light every supersample, average and pack sRGB bytes; directions are in view coordinates.

    `haze` is (depth where it begins, 1 / depth that it takes, share of the background at its end). Ground is black of some
    opacity over the background, so that without `opaque` shadows fall on whatever the picture is laid over.
    """
    columns = width // supersample
    rows = height // supersample
    tolerance = ti.f32(4.0) * radius
    one = ti.f32(1.0)
    top = encode.shape[0] - 1
    halfway = (light - vec3(0, 0, 1)).normalized()
    for p in range(picture.shape[0]):
        row = p // columns
        column = p - row * columns
        below = ti.f32(0.0)  # opacity of the ground
        if ground_shade > 0:
            air = veil[p]
            below = one - (one - ground_shade * (one - air[2])) * (one - ground_shade * (one - air[1]))
            x = (ti.cast(column, ti.f32) + ti.f32(0.5)) * ti.cast(supersample, ti.f32)
            y = (ti.cast(row, ti.f32) + ti.f32(0.5)) * ti.cast(supersample, ti.f32)
            z = ground_depth(x, y, lens, ground, ground_reach)
            if z < ti.f32(NOTHING):
                side, above = view_offset(x, y, z, lens)
                if on_floor(side, above, z, floor_corner, floor_across, floor_along):
                    below = one - (one - below) * (one - floor_shade)
        total = vec3(0, 0, 0)
        cover = ti.f32(0.0)
        for sub_row, sub_column in ti.ndrange(supersample, supersample):
            v = row * supersample + sub_row
            u = column * supersample + sub_column
            s = v * width + u
            number = nearest[s]
            colour = vec3(0, 0, 0)
            thick = below
            if number != NO_PARTICLE:
                thick = one
                sprite = sprites[number]
                x = (ti.cast(u, ti.f32) + ti.f32(0.5) - sprite[0]) / sprite[3]
                y = (sprite[1] - ti.cast(v, ti.f32) - ti.f32(0.5)) / sprite[3]
                normal = vec3(x, y, -ti.sqrt(ti.max(one - x * x - y * y, ti.f32(0.0))))
                z = ti.bit_cast(depth[s], ti.f32)
                air = veil_at(row, column, z, tolerance, columns, rows, veil)
                # half-Lambert: light wraps around, which keeps the hue readable on the dark side
                facing = ti.f32(0.5) + ti.f32(0.5) * normal.dot(light)
                direct = facing * facing * air[2]
                above = ti.f32(0.65) + ti.f32(0.35) * normal.dot(sky)
                shine = ti.max(normal.dot(halfway), ti.f32(0.0))
                shine = shine * shine * shine * shine
                shine = shine * shine * shine * shine
                # a silhouette against something far behind is drawn darker, which separates layers of fluid
                behind = ti.f32(0.0)
                for k in ti.static(range(4)):
                    i = ti.min(ti.max(u + supersample * (1 - k if k % 2 == 0 else 0), 0), width - 1)
                    j = ti.min(ti.max(v + supersample * (2 - k if k % 2 == 1 else 0), 0), height - 1)
                    gap = ti.bit_cast(depth[j * width + i], ti.f32) - z
                    behind = ti.max(behind, ti.min(gap / (ti.f32(8.0) * radius) - ti.f32(0.25), one))
                tint = tints[number]
                glow = ti.f32(0.50) * above * air[1] + ti.f32(0.95) * direct * (ti.f32(0.5) + ti.f32(0.5) * air[1])
                colour = tint * glow * (one - ti.f32(0.35) * behind)
                colour += ti.f32(0.10) * shine * air[2] * air[1]
                far = ti.min(ti.max((z - haze[0]) * haze[1], ti.f32(0.0)), one)
                colour += haze[2] * far * far * (background - colour)
            ink = ti.cast(lines[s], ti.f32) / ti.f32(255.0)
            total += colour * (one - ink) + line_colour * ink
            cover += thick + ink * (one - thick)
        samples = ti.cast(supersample * supersample, ti.f32)
        total /= samples
        cover /= samples
        if opaque == 1:
            total += background * (one - cover)
            cover = one
        else:
            total /= ti.max(cover, ti.f32(1e-6))
        code = ti.round(cover * ti.f32(255.0), ti.i32) << 24
        for k in ti.static(range(3)):
            place = ti.sqrt(ti.min(ti.max(total[k], ti.f32(0.0)), one)) * ti.cast(top, ti.f32)
            code |= encode[ti.round(place, ti.i32)] << (8 * k)
        picture[p] = code
