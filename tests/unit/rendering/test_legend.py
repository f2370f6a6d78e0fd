import numpy as np
import pytest
from PIL import Image, ImageDraw

from taichi_rts.errors import RenderError
from taichi_rts.rendering.legend import draw_colour_bar, draw_legend, hstack_panels, vstack_panels
from taichi_rts.rendering.text import font_size, panel_of, text_width

ENTRIES = [("level 1", (1.0, 0.0, 0.0), 0.25), ("level 2", (0.0, 0.0, 1.0), 0.75)]
LINES = ["t = 0.500 s", "Δt_b = 0.54 ms"]


def blank(height=360):
    return np.full((height, height * 16 // 9, 3), 90, np.uint8)


def changed(picture):
    rows, columns = np.nonzero((picture != 90).any(axis=2))
    return rows.min(), rows.max(), columns.min(), columns.max()


@pytest.mark.parametrize("position", ["top-left", "top-right", "bottom-left", "bottom-right"])
def test_only_the_panel_changes(position):
    source = blank()
    picture = draw_legend(source, "Dam break", ENTRIES, LINES, position)
    assert picture.shape == source.shape
    assert picture.dtype == np.uint8
    assert (source == 90).all()
    top, bottom, left, right = changed(picture)
    assert bottom - top < 0.5 * 360
    assert right - left < 0.4 * 640
    assert (top > 180) == position.startswith("bottom")
    assert (left > 320) == position.endswith("right")


def test_bars_are_as_long_as_the_shares():
    picture = draw_legend(blank(720), "", ENTRIES).astype(int)
    red = (picture[..., 0] > 200) & (picture[..., 1] < 60)
    blue = (picture[..., 2] > 200) & (picture[..., 1] < 60)
    size = font_size(720)
    lengths = [mask.sum(axis=1).max() - size for mask in (red, blue)]  # less the chip
    assert lengths[1] / lengths[0] == pytest.approx(3, rel=0.1)
    no_share = draw_legend(blank(720), "", [("water", (1.0, 0.0, 0.0), None)]).astype(int)
    assert ((no_share[..., 0] > 200) & (no_share[..., 1] < 60)).sum() == pytest.approx(size**2, rel=0.1)


def test_panel_grows_with_the_picture():
    small, large = (changed(draw_legend(blank(h), "Dam break", ENTRIES, LINES)) for h in (720, 2160))
    assert (large[1] - large[0]) / (small[1] - small[0]) == pytest.approx(3, rel=0.03)
    assert (large[3] - large[2]) / (small[3] - small[2]) == pytest.approx(3, rel=0.05)
    assert font_size(720) == 18
    assert font_size(2160) == 54


@pytest.mark.parametrize("sign", "αβγδεζηθλμνρσφωΔΣΩ²³×·–−→√≤∞")
def test_greek_letters_and_signs_leave_no_empty_box(sign):
    ink = draw_legend(blank(720), "", [], [sign])
    tofu = draw_legend(blank(720), "", [], ["\uffff"])
    assert not np.array_equal(ink, tofu)
    assert (ink.max(axis=2) < 200).sum() > 5


def test_one_letter_after_an_underscore_is_a_subscript():
    assert text_width("t_b", 18) < text_width("tb", 18)
    assert text_width("dam_break_2d", 18) > text_width("dambreak2d", 18)  # a name is not


def test_colour_bar_shows_its_colours_in_order():
    picture = draw_colour_bar(blank(), "speed", 0.0, 4.5, "m/s", [(1, 0, 0), (0, 1, 0)], "bottom-right").astype(int)
    rows, columns = np.nonzero((picture[..., 2] < 5) & (np.ptp(picture, axis=2) > 100))
    row = np.bincount(rows).argmax()
    line = picture[row, columns[rows == row]]
    assert line[0, 0] > 250
    assert line[-1, 1] > 250
    assert np.all(np.diff(line[:, 1]) >= 0)
    assert changed(picture)[0] > 180


def test_panels_keep_the_pictures_and_add_captions():
    left, right = np.full((90, 160, 3), 10, np.uint8), np.full((90, 120, 3), 20, np.uint8)
    row = hstack_panels([left, right])
    assert row.shape == (90, 160 + 120 + 2, 3)
    assert np.array_equal(row[:, :160], left)
    assert np.array_equal(row[:, -120:], right)
    captioned = hstack_panels([left, right], ["regional", "uniform"])
    strip = len(captioned) - 90
    assert 0 < strip < 30
    assert captioned[:strip, :160].min() < 100
    column = vstack_panels([left, left], ["a", ""])
    assert column.shape == (2 * (90 + strip) + 2, 160, 3)


def test_misfits_are_refused():
    with pytest.raises(RenderError, match="heights"):
        hstack_panels([np.zeros((9, 9, 3), np.uint8), np.zeros((8, 9, 3), np.uint8)])
    with pytest.raises(RenderError, match="1 pictures with 2 captions"):
        vstack_panels([np.zeros((9, 9, 3), np.uint8)], ["a", "b"])
    with pytest.raises(RenderError, match="top-left"):
        draw_legend(blank(), "x", [], [], "middle")


@pytest.mark.parametrize("channels", [3, 4])
def test_a_panel_is_laid_over_the_picture(channels):
    image = np.random.default_rng(0).integers(0, 256, (90, 160, channels), np.uint8)
    box = (11, 7, 80, 60)
    found, _ = panel_of(image, box)
    sheet = Image.new("RGBA", (160, 90), (255, 255, 255, 0))
    ImageDraw.Draw(sheet).rounded_rectangle(box, 2, fill=(255, 255, 255, 225), outline=(120, 125, 135, 200), width=1)
    source = Image.fromarray(image)
    assert np.array_equal(found, Image.alpha_composite(source.convert("RGBA"), sheet).convert(source.mode))
