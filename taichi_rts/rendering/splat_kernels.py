"""Taichi kernels of the splatter: from points to nearest depth and nearest particle per pixel.

They are module-level functions, so several splatters share one compilation. Literals are cast to f32, since a
literal has the run's default precision, which may be f64. Buffers are flat: y * width + x.

A lens is (pixels per metre at unit depth, 1 if perspective else 0, width / 2, height / 2).
"""

from typing import Any

from taichi_rts.device.backend import ti

vec3: Any = ti.types.vector(3, ti.f32)
vec4: Any = ti.types.vector(4, ti.f32)
Floats: Any = ti.types.ndarray(dtype=ti.f32, ndim=1)
Ints: Any = ti.types.ndarray(dtype=ti.i32, ndim=1)
Vectors3: Any = ti.types.ndarray(dtype=vec3, ndim=1)
Vectors4: Any = ti.types.ndarray(dtype=vec4, ndim=1)
Table: Any = ti.types.ndarray(dtype=ti.f32, ndim=2)

FAR = 0x7F000000  # bit pattern of a depth no particle has (1.7e38 m)
NO_PARTICLE = 0x7FFFFFFF
SLACK = 1e-3  # radii by which two kernels' depths may differ: near a silhouette, Vulkan rounds the same root that differently
SMALLEST = 0.71  # [pixels] radius below which a sphere could fall between pixel centres and vanish
TILE = 8  # [pixels] side of the tiles that hidden spheres are found by
FEW = 10_000  # spheres up to which looking for hidden ones takes longer than drawing them
BROAD = 32  # [pixels] side of the tiles by which empty parts of a picture are found
STRIDES = (16, 4, 2, 1)  # one of so many spheres is drawn at first, which hides most of the others


@ti.kernel
def upload_points(positions: Table, colours: Table, linear: Floats, count: ti.i32, points: Vectors3, tints: Vectors3):
    """Copy the frame's arrays to the device; colours go from sRGB to linear light by table."""
    steps = linear.shape[0] - 1
    for i in range(count):
        for k in ti.static(range(3)):
            points[i][k] = positions[i, k]
            place = ti.round(colours[i, k] * ti.cast(steps, ti.f32), ti.i32)
            tints[i][k] = linear[ti.min(ti.max(place, 0), steps)]


@ti.func
def metres_per_pixel(z, lens):
    """Size of a pixel at depth z."""
    return ti.select(lens[1] > 0, z, ti.f32(1.0)) / lens[0]


@ti.kernel
def project_points(
    points: Vectors3,
    count: ti.i32,
    radius: ti.f32,
    eye: vec3,
    right: vec3,
    up: vec3,
    forward: vec3,
    lens: vec4,
    sprites: Vectors4,
):
    """Write pixel x, pixel y, depth and radius in pixels; radius 0 marks what is out of sight."""
    for i in range(count):
        offset = points[i] - eye
        z = offset.dot(forward)
        sprite = vec4(0, 0, 0, 0)
        if z > radius:
            scale = ti.f32(1.0) / metres_per_pixel(z, lens)
            x = lens[2] + scale * offset.dot(right)
            y = lens[3] - scale * offset.dot(up)
            size = ti.max(radius * scale, ti.f32(SMALLEST))
            if ti.abs(x - lens[2]) < lens[2] + size and ti.abs(y - lens[3]) < lens[3] + size:
                sprite = vec4(x, y, z, size)
        sprites[i] = sprite


@ti.kernel
def clear_buffer(buffer: Ints, value: ti.i32):
    """Set every entry to one value."""
    for p in range(buffer.shape[0]):
        buffer[p] = value


@ti.func
def enter(sprite, number, x, y, unit, width, depth: ti.template(), nearest: ti.template(), naming: ti.template()):
    """Enter the depth of one sphere in one of its pixels, or its number where it is the nearest."""
    dx = ti.cast(x, ti.f32) + ti.f32(0.5) - sprite[0]
    dy = ti.cast(y, ti.f32) + ti.f32(0.5) - sprite[1]
    z = sprite[2] - unit * ti.sqrt(ti.max(sprite[3] * sprite[3] - dy * dy - dx * dx, ti.f32(0.0)))
    p = y * width + x
    if ti.static(naming):
        if z - ti.f32(SLACK) * sprite[3] * unit <= ti.bit_cast(depth[p], ti.f32):
            ti.atomic_min(nearest[p], number)
    else:
        bits = ti.bit_cast(z, ti.i32)  # floats above zero order like integers
        if bits < depth[p]:  # a plain read first spares most of the atomics
            ti.atomic_min(depth[p], bits)


@ti.func
def first_pixel(middle, reach):
    """First pixel of a row or column whose centre is within `reach` of the middle."""
    return ti.ceil(ti.max(middle - reach - ti.f32(0.5), ti.f32(0.0)), ti.i32)


@ti.func
def splat(sprite, number, lens, width, height, depth: ti.template(), nearest: ti.template(), naming: ti.template()):
    """Visit the pixels of one sphere."""
    half = ti.f32(0.5)
    size = sprite[3]
    unit = metres_per_pixel(sprite[2], lens)
    bottom = ti.floor(ti.min(sprite[1] + size + half, ti.cast(height, ti.f32)), ti.i32)
    for y in range(first_pixel(sprite[1], size), bottom):
        dy = ti.cast(y, ti.f32) + half - sprite[1]
        reach = ti.sqrt(ti.max(size * size - dy * dy, ti.f32(0.0)))
        last = ti.floor(ti.min(sprite[0] + reach + half, ti.cast(width, ti.f32)), ti.i32)
        for x in range(first_pixel(sprite[0], reach), last):
            enter(sprite, number, x, y, unit, width, depth, nearest, naming)


@ti.func
def touched_tiles(sprite, width, height, side: ti.template()):
    """First and last column and row of the tiles of side x side pixels that a sphere's square touches in the picture."""
    left = ti.max(ti.cast(sprite[0] - sprite[3], ti.i32), 0) // side
    right = ti.min(ti.cast(sprite[0] + sprite[3], ti.i32), width - 1) // side
    top = ti.max(ti.cast(sprite[1] - sprite[3], ti.i32), 0) // side
    bottom = ti.min(ti.cast(sprite[1] + sprite[3], ti.i32), height - 1) // side
    return left, right, top, bottom


@ti.func
def may_be_seen(sprite, lens, width, height, tiles: ti.template()):
    """Whether a sphere's nearest point is in front of the farthest depth of a tile that it touches."""
    seen = False
    if sprite[3] > 0:
        size = sprite[3] * metres_per_pixel(sprite[2], lens)
        front = ti.bit_cast(sprite[2] - ti.f32(1 + SLACK) * size, ti.i32)
        columns = (width + TILE - 1) // TILE
        left, right, top, bottom = touched_tiles(sprite, width, height, TILE)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                if front <= tiles[row * columns + column]:
                    seen = True
    return seen


@ti.kernel
def measure_tiles(depth: Ints, width: ti.i32, height: ti.i32, tiles: Ints):
    """Enter the farthest depth of every tile of TILE x TILE pixels."""
    columns = (width + TILE - 1) // TILE
    for t in range(tiles.shape[0]):
        row = t // columns * TILE
        column = t % columns * TILE
        farthest = 0
        for y in range(row, ti.min(row + TILE, height)):
            for x in range(column, ti.min(column + TILE, width)):
                farthest = ti.max(farthest, depth[y * width + x])
        tiles[t] = farthest


@ti.kernel
def mark_tiles(sprites: Vectors4, count: ti.i32, width: ti.i32, height: ti.i32, sums: Ints):
    """Set the entry of every broad tile that a sphere touches to 1; see `sum_tiles` for their places."""
    columns = tiles_across(width) + 1
    for i in range(count):
        sprite = sprites[i]
        if sprite[3] > 0:
            left, right, top, bottom = touched_tiles(sprite, width, height, BROAD)
            for row in range(top, bottom + 1):
                for column in range(left, right + 1):
                    sums[(row + 1) * columns + column + 1] = 1


@ti.kernel
def sum_tiles(width: ti.i32, height: ti.i32, sums: Ints):
    """Sum over rows and columns: entry (n, m) then counts the marked tiles in the first n rows and m columns."""
    columns = tiles_across(width) + 1
    rows = tiles_across(height) + 1
    for row in range(rows):
        for column in range(1, columns):
            k = row * columns + column
            sums[k] = sums[k] + sums[k - 1]  # `+=` would be atomic
    for column in range(columns):
        for row in range(1, rows):
            k = row * columns + column
            sums[k] = sums[k] + sums[k - columns]


@ti.func
def tiles_across(length):
    """Number of broad tiles along a side of `length` [pixels]."""
    return (length + BROAD - 1) // BROAD


@ti.func
def is_marked(x, y, reach, width, height, sums: ti.template()):
    """Whether any pixel within `reach` [pixels] of (x, y) along both axes lies in a marked tile."""
    columns = tiles_across(width) + 1
    left = ti.cast(ti.max(x - reach, ti.f32(0.0)), ti.i32) // BROAD
    right = ti.cast(ti.min(x + reach, ti.cast(width - 1, ti.f32)), ti.i32) // BROAD + 1
    top = ti.cast(ti.max(y - reach, ti.f32(0.0)), ti.i32) // BROAD
    bottom = ti.cast(ti.min(y + reach, ti.cast(height - 1, ti.f32)), ti.i32) // BROAD + 1
    found = False
    if left < right and top < bottom:
        upper = sums[top * columns + right] - sums[top * columns + left]
        found = sums[bottom * columns + right] - sums[bottom * columns + left] > upper
    return found


@ti.kernel
def splat_depths(
    sprites: Vectors4,
    count: ti.i32,
    stride: ti.i32,
    lens: vec4,
    width: ti.i32,
    height: ti.i32,
    tiles: Ints,
    depth: Ints,
):
    """Enter the least depth of all spheres, or of one in each `stride` of them, in every pixel."""
    for k in range((count + stride - 1) // stride):
        # which one is scattered, since every n-th of a lattice could be one plane of it
        i = k * stride + ((k * 747796405 >> 8) & 0xFFFF) % stride
        if i < count:
            if may_be_seen(sprites[i], lens, width, height, tiles):
                splat(sprites[i], i, lens, width, height, depth, depth, False)


@ti.kernel
def splat_numbers(
    sprites: Vectors4,
    count: ti.i32,
    lens: vec4,
    width: ti.i32,
    height: ti.i32,
    tiles: Ints,
    depth: Ints,
    nearest: Ints,
):
    """Enter the number of the nearest sphere in every pixel; of several at one depth, the lowest number."""
    for i in range(count):
        if may_be_seen(sprites[i], lens, width, height, tiles):
            splat(sprites[i], i, lens, width, height, depth, nearest, True)


@ti.kernel
def trace_lines(
    ends: Table,
    steps: ti.i32,
    half_width: ti.f32,
    lens: vec4,
    width: ti.i32,
    height: ti.i32,
    bias: ti.f32,
    seen: ti.i32,
    hidden: ti.i32,
    depth: Ints,
    lines: Ints,
):
    """Draw segments (x, y, z of both ends) with strength `seen` in front of all spheres, else `hidden`."""
    border = ti.ceil(half_width, ti.i32) + 1
    wide = 2 * border + 1
    # not a loop in a loop: some drivers leave one after an atomic (`flat_kernels`)
    for edge, step, n, m in ti.ndrange(ends.shape[0], steps + 1, wide, wide):
        t = ti.cast(step, ti.f32) / ti.cast(steps, ti.f32)
        s = ti.f32(1.0) - t
        run = ends[edge, 3] - ends[edge, 0]
        rise = ends[edge, 4] - ends[edge, 1]
        length = ti.max(ti.sqrt(run * run + rise * rise), ti.f32(1e-6))
        x = ends[edge, 0] + t * run
        y = ends[edge, 1] + t * rise
        near = ends[edge, 2]
        far = ends[edge, 5]
        # along a straight line in the picture, 1/z is linear under perspective and z without it
        z = ti.select(lens[1] > 0, near * far / ti.max(s * far + t * near, ti.f32(1e-30)), s * near + t * far)
        u = ti.floor(x, ti.i32) + m - border
        v = ti.floor(y, ti.i32) + n - border
        seen_at_all = ti.abs(x - lens[2]) < lens[2] and ti.abs(y - lens[3]) < lens[3]
        if seen_at_all and u >= 0 and u < width and v >= 0 and v < height:
            limit = ti.bit_cast(ti.max(z - bias, ti.f32(0.0)), ti.i32)
            dx = ti.cast(u, ti.f32) + ti.f32(0.5) - x
            dy = ti.cast(v, ti.f32) + ti.f32(0.5) - y
            off = ti.abs(dx * rise - dy * run) / length
            cover = ti.min(ti.max(half_width + ti.f32(0.5) - off, ti.f32(0.0)), ti.f32(1.0))
            p = v * width + u
            full = ti.select(limit <= depth[p], seen, hidden)
            ti.atomic_max(lines[p], ti.cast(cover * ti.cast(full, ti.f32), ti.i32))
