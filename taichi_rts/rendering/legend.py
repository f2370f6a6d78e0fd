"""Legends, colour bars and side-by-side pictures: NumPy images in, NumPy images out."""

import numpy as np
from PIL import Image, ImageDraw

from taichi_rts.errors import RenderError
from taichi_rts.rendering.text import draw_text, font_size, panel_of, text_width

INK = (32, 34, 40)
FAINT = (226, 228, 232)


def _bytes(colour) -> tuple[int, int, int]:
    red, green, blue = (round(255 * float(np.clip(c, 0, 1))) for c in colour)
    return red, green, blue


def _size_in(image: np.ndarray) -> int:
    """Return the text size [pixels] that suits a picture: as high as its height asks for, less in one that is narrow."""
    return font_size(min(image.shape[0], 2 * image.shape[1]))


def _place(image: np.ndarray, width: float, height: float, position: str) -> tuple[int, int]:
    """Return the upper left corner of a panel of a given size."""
    margin = round(0.02 * image.shape[0])
    right, bottom = image.shape[1] - margin - width, image.shape[0] - margin - height
    places = {
        "top-left": (margin, margin),
        "top-right": (right, margin),
        "bottom-left": (margin, bottom),
        "bottom-right": (right, bottom),
    }
    if position not in places:
        raise RenderError(f"position {position!r} of a panel is unknown: choose one of {', '.join(places)}")
    x, y = places[position]
    return max(round(x), 0), max(round(y), 0)


def draw_legend(image: np.ndarray, title: str, entries, lines=(), position: str = "top-left") -> np.ndarray:
    """Return a copy of the picture with a panel: a title, entries with chip and share, and lines of text.

    `entries` are (label, (r, g, b) in 0 to 1, share in 0 to 1 or None); text is as large as the
    picture's height asks for.
    """
    size = _size_in(image)
    step, pad, chip = round(1.5 * size), round(0.75 * size), size
    label = max((text_width(name, size) for name, _, _ in entries), default=0.0)
    shares = any(share is not None for _, _, share in entries)
    bar, percent = (round(5.5 * size), text_width("100.0 %", size)) if shares else (0, 0.0)
    gap = round(0.6 * size)
    row = chip + gap + label + (2 * gap + bar + percent if shares else 0)
    inner = max([row if entries else 0, text_width(title, size), *(text_width(line, size) for line in lines)])
    rows = bool(title) + len(entries) + len(lines)
    space = round(0.4 * size) if entries and lines else 0
    width, height = round(inner + 2 * pad), rows * step + space + 2 * pad - (step - size)
    x, y = _place(image, width, height, position)
    picture, canvas = panel_of(image, (x, y, x + width - 1, y + height - 1))
    left, top = x + pad, y + pad
    if title:
        draw_text(canvas, (left, top), title, size, INK)
        top += step
    for name, colour, share in entries:
        canvas.rectangle((left, top, left + chip - 1, top + chip - 1), fill=_bytes(colour))
        draw_text(canvas, (left + chip + gap, top), name, size, INK)
        if share is not None:
            start, end = round(left + chip + 2 * gap + label), round(x + width - pad - percent - gap)
            canvas.rectangle((start, top + size // 5, end, top + size - size // 5), fill=FAINT)
            filled = start + round((end - start) * float(np.clip(share, 0, 1)))
            if filled > start:
                canvas.rectangle((start, top + size // 5, filled, top + size - size // 5), fill=_bytes(colour))
            number = f"{100 * share:.1f} %"
            draw_text(canvas, (x + width - pad - text_width(number, size), top), number, size, INK)
        top += step
    top += space
    for line in lines:
        draw_text(canvas, (left, top), line, size, INK)
        top += step
    return np.asarray(picture)


def draw_colour_bar(
    image: np.ndarray,
    title: str,
    lower: float,
    upper: float,
    unit: str,
    colours,
    position: str = "top-right",
) -> np.ndarray:
    """Return a copy of the picture with a colour bar; `colours` (K, 3) run from `lower` to `upper`."""
    size = _size_in(image)
    pad, length = round(0.75 * size), round(14 * size)
    heading = f"{title} [{unit}]" if unit else title
    width = round(max(length, text_width(heading, size)) + 2 * pad)
    height = round(2 * pad + 4.1 * size)
    x, y = _place(image, width, height, position)
    picture, canvas = panel_of(image, (x, y, x + width - 1, y + height - 1))
    draw_text(canvas, (x + pad, y + pad), heading, size, INK)
    table = np.asarray(colours, float)
    place = np.linspace(0, len(table) - 1, length)
    strip = np.stack([np.interp(place, np.arange(len(table)), table[:, k]) for k in range(3)], axis=1)
    strip = np.rint(255 * np.clip(strip, 0, 1)).astype(np.uint8)
    picture.paste(
        Image.fromarray(np.ascontiguousarray(np.broadcast_to(strip, (size, length, 3)))),
        (x + pad, round(y + pad + 1.5 * size)),
    )
    for share in (0.0, 0.5, 1.0):
        number = f"{lower + share * (upper - lower):.4g}"
        start = x + pad + share * (length - text_width(number, size))
        draw_text(canvas, (start, y + pad + 2.9 * size), number, size, INK)
    return np.asarray(picture)


def _captioned(image: np.ndarray, caption: str) -> np.ndarray:
    """Return the picture with a white strip above it that holds the caption, centred."""
    if not caption:
        return image
    size = _size_in(image)
    mode = Image.fromarray(image).mode
    strip = Image.new(mode, (image.shape[1], round(2 * size)), (255,) * len(mode))
    start = 0.5 * (image.shape[1] - text_width(caption, size))
    draw_text(ImageDraw.Draw(strip), (max(start, 0), 0.5 * size), caption, size, INK)
    return np.concatenate([np.asarray(strip), image])


def rule_thickness(height: int) -> int:
    """Return the thickness [pixels] of the line between two pictures of a height [pixels]."""
    return max(height // 180, 2)


def _panels(images, captions, axis: int) -> np.ndarray:
    captions = list(captions) if captions is not None else [""] * len(images)
    if len(images) == 0 or len(captions) != len(images):
        raise RenderError(
            f"{len(images)} pictures with {len(captions)} captions: give at least one picture, and a caption for each"
        )
    other = 1 - axis
    sides = {image.shape[other] for image in images}
    if len(sides) > 1:
        raise RenderError(
            f"the pictures' {('heights', 'widths')[other]} {sorted(sides)} differ, and must agree: "
            "render all panels at one size"
        )
    if any(captions):  # an empty caption among others keeps its strip, or the panels would not line up
        captions = [caption or " " for caption in captions]
    panels = [_captioned(image, caption) for image, caption in zip(images, captions, strict=True)]
    thickness = rule_thickness(images[0].shape[0])
    shape = list(panels[0].shape)
    shape[axis] = thickness
    rule = np.full(shape, 205, np.uint8)
    rule[..., 3:] = 255
    pieces = [piece for panel in panels for piece in (rule, panel)][1:]
    return np.concatenate(pieces, axis=axis)


def hstack_panels(images, captions=None) -> np.ndarray:
    """Return pictures of equal height side by side, each with its caption above."""
    return _panels(images, captions, axis=1)


def vstack_panels(images, captions=None) -> np.ndarray:
    """Return pictures of equal width below each other, each with its caption above."""
    return _panels(images, captions, axis=0)
