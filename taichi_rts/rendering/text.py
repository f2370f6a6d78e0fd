"""Text with Pillow's embedded font, which is the same on every machine but lacks Greek letters.

`_b` after a letter is a subscript and Δ is drawn as a triangle; a few other signs are spelled out.
"""

from PIL import Image, ImageDraw, ImageFont

REFERENCE_HEIGHT = 720  # of a picture whose text is 18 pixels high
_SPELLED = {
    "λ": "lambda",
    "ρ": "rho",
    "²": "^2",
    "³": "^3",
    "×": "x",
    "–": "-",
    "→": "->",
    "·": ".",
    "ε": "eps",
    "−": "-",
}


def font_size(image_height: int) -> int:
    """Return the text size [pixels] that suits a picture: 18 for 720 rows."""
    return max(round(18 * image_height / REFERENCE_HEIGHT), 7)


def _font(size: float):
    return ImageFont.load_default(size=max(round(size), 5))


def _runs(text: str, size: int):
    """Split a text into (piece, size, drop): subscripts are smaller and lower, Δ stands alone."""
    for sign, spelled in _SPELLED.items():
        text = text.replace(sign, spelled)
    piece, k = "", 0
    while k < len(text):
        subscript = text[k] == "_" and k > 0 and text[k - 1] != " " and k + 1 < len(text) and text[k + 1].isalnum()
        if not subscript and text[k] != "Δ":
            piece += text[k]
            k += 1
            continue
        if piece:
            yield piece, size, 0.0
            piece = ""
        yield (text[k + 1], 0.72 * size, 0.34 * size) if subscript else ("Δ", size, 0.0)
        k += 2 if subscript else 1
    if piece:
        yield piece, size, 0.0


def text_width(text: str, size: int) -> float:
    """Return the width of a text [pixels]."""
    return sum(0.74 * run if piece == "Δ" else _font(run).getlength(piece) for piece, run, _ in _runs(text, size))


def draw_text(canvas: ImageDraw.ImageDraw, place, text: str, size: int, fill) -> None:
    """Draw a text whose line box of height `size` has its upper left corner at `place`."""
    x, y = place
    base = y + 0.82 * size
    for piece, run, drop in _runs(text, size):
        if piece == "Δ":
            cap, wide = 0.68 * run, 0.62 * run
            corners = [
                (x + 0.05 * run, base),
                (x + 0.05 * run + wide / 2, base - cap),
                (x + 0.05 * run + wide, base),
            ]
            canvas.line([*corners, corners[0], corners[1]], fill=fill, width=max(round(0.085 * run), 1))
            x += 0.74 * run
            continue
        canvas.text((x, base + drop), piece, font=_font(run), fill=fill, anchor="ls")
        x += _font(run).getlength(piece)


def panel_of(image, box, alpha: int = 225):
    """Return (Pillow image, canvas) of a picture, RGB or RGBA, with a white panel of rounded corners at `box`."""
    source = Image.fromarray(image)
    picture = source.convert("RGBA")
    sheet = Image.new("RGBA", picture.size, (255, 255, 255, 0))
    corner = max(round(0.012 * picture.size[1]), 2)
    ImageDraw.Draw(sheet).rounded_rectangle(
        box,
        corner,
        fill=(255, 255, 255, alpha),
        outline=(120, 125, 135, 200),
        width=max(picture.size[1] // 720, 1),
    )
    picture = Image.alpha_composite(picture, sheet).convert(source.mode)
    return picture, ImageDraw.Draw(picture)
