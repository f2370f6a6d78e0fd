"""Text in DejaVu Sans, which comes with the package (`fonts/`): the same on every machine, and it has Greek letters.

`_b` after a letter, and before the end of its word, is a subscript.
"""

import functools
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

REFERENCE_HEIGHT = 720  # of a picture whose text is 18 pixels high
FONT = Path(__file__).with_name("fonts") / "DejaVuSans.ttf"


def font_size(image_height: int) -> int:
    """Return the text size [pixels] that suits a picture: 18 for 720 rows."""
    return max(round(18 * image_height / REFERENCE_HEIGHT), 7)


@functools.lru_cache(maxsize=16)
def _font(size: int) -> ImageFont.FreeTypeFont:
    # Pillow's own layout: the other one, where it is installed, would place letters differently.
    return ImageFont.truetype(str(FONT), size, layout_engine=ImageFont.Layout.BASIC)


def _runs(text: str, size: int):
    """Split a text into (piece, font, drop [pixels]): subscripts are smaller and lower."""
    piece, k = "", 0
    while k < len(text):
        alone = text[k + 1 : k + 2].isalnum() and not text[k + 2 : k + 3].isalnum()  # not so in dam_break_2d
        if text[k] == "_" and alone and k > 0 and text[k - 1] != " ":
            if piece:
                yield piece, _font(max(size, 5)), 0.0
            yield text[k + 1], _font(max(round(0.72 * size), 5)), 0.34 * size
            piece, k = "", k + 2
            continue
        piece += text[k]
        k += 1
    if piece:
        yield piece, _font(max(size, 5)), 0.0


def text_width(text: str, size: int) -> float:
    """Return the width of a text [pixels]."""
    return sum(font.getlength(piece) for piece, font, _ in _runs(text, size))


def draw_text(canvas: ImageDraw.ImageDraw, place, text: str, size: int, fill) -> None:
    """Draw a text whose line box of height `size` has its upper left corner at `place`."""
    x, y = place
    for piece, font, drop in _runs(text, size):
        canvas.text((x, y + 0.82 * size + drop), piece, font=font, fill=fill, anchor="ls")
        x += font.getlength(piece)


def panel_of(image, box, alpha: int = 225):
    """Return (Pillow image, canvas) of a picture, RGB or RGBA, with a white panel of rounded corners at `box`."""
    picture = Image.fromarray(image).copy()
    x, y = box[:2]
    place = (x, y, box[2] + 1, box[3] + 1)  # all that the panel changes
    under = picture.crop(place).convert("RGBA")
    sheet = Image.new("RGBA", under.size, (255, 255, 255, 0))
    ImageDraw.Draw(sheet).rounded_rectangle(
        (0, 0, box[2] - x, box[3] - y),
        max(round(0.012 * picture.size[1]), 2),
        fill=(255, 255, 255, alpha),
        outline=(120, 125, 135, 200),
        width=max(picture.size[1] // 720, 1),
    )
    picture.paste(Image.alpha_composite(under, sheet).convert(picture.mode), place)
    return picture, ImageDraw.Draw(picture)
