import numpy as np
import pytest

from taichi_rts.errors import RenderError
from taichi_rts.readings.levels import octaves
from taichi_rts.rendering.colours import (
    COLORMAPS,
    PALETTES,
    PLAIN,
    Scale,
    colour_by,
    fluid_colours,
    level_colours,
    scalar_colours,
)


def cielab(colours):
    """CIE L*a*b* (D65) of sRGB rows."""
    colours = np.asarray(colours, float)
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(linear @ to_xyz.T / (0.9505, 1.0, 1.089)).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


@pytest.mark.parametrize("palette", list(PALETTES))
def test_colours_of_a_palette_are_far_apart(palette):
    lab = cielab(level_colours(np.arange(1, 17), palette))
    distance = np.linalg.norm(lab[:, None] - lab[None], axis=-1) + 1e9 * np.eye(16)
    assert distance[:3, :3].min() > 54
    assert distance[:5, :5].min() > 35
    assert distance.min() > 14


def test_first_levels_and_the_ends_of_the_palette():
    codes = np.rint(255 * level_colours([1, 2, 3])).astype(int)
    assert codes.tolist() == [[0xD5, 0x5E, 0x00], [0x7F, 0xD8, 0xB8], [0x00, 0x72, 0xB2]]
    red, green, blue = level_colours([1, 2, 3], "paper")
    assert red.argmax() == 0
    assert green.argmax() == 1
    assert blue.argmax() == 2
    assert np.array_equal(level_colours([99, 0]), level_colours([16, 1]))
    assert level_colours([1]).dtype == np.float32


def test_octaves_share_a_colour_where_levels_double():
    assert octaves([1, 2, 3, 4, 7, 8, 1023, 1024]).tolist() == [1, 2, 2, 3, 3, 4, 10, 11]
    doubling = level_colours([1, 2, 3, 4, 8, 1024], doubling=True)
    assert np.array_equal(doubling, level_colours([1, 2, 2, 3, 4, 11]))
    lab = cielab(level_colours(2 ** np.arange(11), doubling=True))
    assert (np.linalg.norm(lab[:, None] - lab[None], axis=-1) + 1e9 * np.eye(11)).min() > 14
    assert np.array_equal(colour_by("level", [3, 4], Scale(doubling=True)), level_colours([2, 3]))


def test_lightness_of_the_speed_map_rises_steadily():
    lightness = cielab(scalar_colours(np.linspace(0, 1, 200), 0, 1))[:, 0]
    assert np.all(np.diff(lightness) > -0.05)
    assert np.ptp(lightness) > 70


def test_scalar_colours_clip_and_mark_what_is_not_finite():
    got = scalar_colours(np.array([-5.0, 0.0, 2.0, 9.0, np.nan, np.inf]), 0.0, 2.0)
    assert np.allclose(got[[0, 1]], COLORMAPS["lagoon"][0], atol=2e-3)
    assert np.allclose(got[[2, 3]], COLORMAPS["lagoon"][-1], atol=2e-3)
    assert got[4].tolist() == got[5].tolist() == [1, 0, 1]


def test_modes():
    speeds, levels = np.array([0.0, 1.0, 2.0]), np.array([3, 2, 1])
    assert np.array_equal(colour_by("level", levels), level_colours(levels))
    assert np.array_equal(colour_by("level", levels, Scale("paper")), level_colours(levels, "paper"))
    assert np.array_equal(colour_by("speed", speeds), scalar_colours(speeds, 0, 2))
    assert np.array_equal(colour_by("speed", speeds, Scale(tops={"speed": 4.0})), scalar_colours(speeds, 0, 4))
    steps = np.array([0.001, 0.002, 0.004])
    scale = Scale(tops={"step": 0.008, "speed": 0.0}, rest_density=900.0)
    assert np.array_equal(colour_by("step", steps, scale), scalar_colours(steps, 0, 0.008))
    assert np.array_equal(colour_by("lead", steps, scale), scalar_colours(steps, 0, 0.004))
    assert scale.ends("step", steps) == (0, 0.008)
    assert scale.ends("lead", [0.001, np.nan, np.inf]) == (0, 0.001)
    assert scale.ends("lead", []) == (0, 1)
    assert scale.ends("speed") == (0, 1e-12)
    assert scale.ends("density") == (855, 945)
    assert np.allclose(colour_by("density", [900.0], scale), 0xF2 / 255, atol=5e-3)
    tints = fluid_colours(["#102030", None])
    assert np.allclose(tints, [[16 / 255, 32 / 255, 48 / 255], level_colours([2])[0]])
    scale = Scale(fluid_names=("#102030", None))
    assert np.array_equal(colour_by("fluid", [1, 0, 1], scale), tints[[1, 0, 1]])
    plain = colour_by("plain", levels)
    assert plain.shape == (3, 3)
    assert np.allclose(plain, PLAIN)


def test_unknown_names_list_the_choices():
    with pytest.raises(
        RenderError, match=r"'vorticity'.*level, step, lead, speed, density, sound, fluid, pressure, plain"
    ):
        colour_by("vorticity", [1])
    with pytest.raises(RenderError, match="default, paper"):
        level_colours([1], "nature")
