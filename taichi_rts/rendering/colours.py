"""From levels and fields to colours (sRGB, 0 to 1), in NumPy only."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from PIL import ImageColor

from taichi_rts.errors import RenderError
from taichi_rts.readings.levels import octaves

PLAIN = (0.22, 0.50, 0.80)  # water
LEAST_TOP = 1e-12  # of a range from 0, where all is 0


def _rgb(*codes: str) -> np.ndarray:
    return np.array([[int(code[k : k + 2], 16) / 255 for k in (1, 3, 5)] for code in codes], np.float32)


# Row k is level k + 1. The first three (the paper's red, green, blue) stay apart for deutan and protan eyes;
# the later ones alternate in lightness, since levels that deep are seldom seen together.
_DEFAULT = _rgb(
    *("#D55E00", "#7FD8B8", "#0072B2", "#F0C929", "#7B2D8B", "#B8B8B8", "#4A2B12", "#F29BC1"),
    *("#1B6B3A", "#A9C7F5", "#8C1C3A", "#D9E87A", "#2B2F77", "#C98F4E", "#3F8F94", "#303030"),
)
PALETTES: dict[str, np.ndarray] = {
    "default": _DEFAULT,
    "paper": np.concatenate([_rgb("#E02020", "#20B020", "#2040E0"), _DEFAULT[3:]]),
}

# Evenly spaced anchors; lightness rises steadily in the first, and is highest in the middle of the second.
COLORMAPS: dict[str, np.ndarray] = {
    "lagoon": _rgb("#1A1450", "#25418C", "#20719A", "#2C9F8E", "#6CC76B", "#C6E04F", "#FFF3A0"),
    "balance": _rgb("#1B4F9C", "#6FA3D8", "#F2F2F2", "#E39A6C", "#A33A1A"),
}


def _choose(kind: str, name: str, choices: dict):
    if name not in choices:
        raise RenderError(f"{kind} {name!r} is unknown: choose one of {', '.join(choices)}")
    return choices[name]


def level_colours(levels, palette: str = "default", *, doubling: bool = False) -> np.ndarray:
    """Return (N, 3) colours of levels, counted from 1; levels beyond the palette take its last colour.

    With `doubling` an octave of levels shares a colour: the palette then reaches to level 65535.
    """
    table = _choose("palette", palette, PALETTES)
    places = octaves(levels) if doubling else np.asarray(levels, np.int64)
    return table[np.clip(places - 1, 0, len(table) - 1)]


def scalar_colours(values, lower: float, upper: float, colormap: str = "lagoon") -> np.ndarray:
    """Return (N, 3) colours of values, from `lower` to `upper`; what is not finite is magenta."""
    table = _choose("colormap", colormap, COLORMAPS)
    values = np.asarray(values, np.float32)
    span = upper - lower if upper > lower else 1.0
    with np.errstate(invalid="ignore"):
        place = np.clip((values - lower) / span, 0.0, 1.0)
    finite = np.isfinite(values)
    # 1024 steps are finer than 8 bits can show, and a look-up is faster than interpolating three channels.
    steps = np.linspace(0, len(table) - 1, 1024)
    fine = np.stack([np.interp(steps, np.arange(len(table)), table[:, k]) for k in range(3)], axis=1)
    colours = fine.astype(np.float32)[(np.where(finite, place, 0) * 1023 + 0.5).astype(np.int64)]
    colours[~finite] = (1.0, 0.0, 1.0)
    return colours


@dataclasses.dataclass(frozen=True)
class Scale:
    """What colours are chosen by besides the values themselves.

    Attributes:
        palette: of levels and fluids.
        doubling: whether an octave of levels shares a colour.
        tops: the upper end of a mode's range, by its name, in its unit; where there is none it is the largest value.
        rest_density: [kg/m^3], in the middle of mode "density".
        fluid_names: colours of the fluids, as `fluid_colours` takes them.
    """

    palette: str = "default"
    doubling: bool = False
    tops: Mapping[str, float] = dataclasses.field(default_factory=dict)
    rest_density: float = 1000.0
    fluid_names: tuple[str | None, ...] = ()

    def ends(self, mode: str, values=()) -> tuple[float, float]:
        """Return the range that a mode of scalars shows, in its unit: 5 % on either side of rest, or from 0."""
        if mode == "density":
            return 0.95 * self.rest_density, 1.05 * self.rest_density
        top = self.tops.get(mode)
        if top is None:
            finite = np.asarray(values)[np.isfinite(values)]
            top = float(finite.max()) if finite.size else 1.0
        return 0.0, max(float(top), LEAST_TOP)


def fluid_colours(names, palette: str = "default") -> np.ndarray:
    """Return (K, 3) colours of K fluids: by name, as HTML has it, or for None the palette's of the fluid's place."""
    own = level_colours(np.arange(1, len(names) + 1), palette)
    given = [None if name is None else np.array(ImageColor.getrgb(name)[:3], np.float32) / 255 for name in names]
    return np.array([one if chosen is None else chosen for one, chosen in zip(own, given, strict=True)])


def _by_level(values, scale: Scale) -> np.ndarray:
    return level_colours(values, scale.palette, doubling=scale.doubling)


def _by_fluid(values, scale: Scale) -> np.ndarray:
    return fluid_colours(scale.fluid_names, scale.palette)[values]


def _plain(values, scale: Scale) -> np.ndarray:
    return np.tile(np.asarray(PLAIN, np.float32), (len(values), 1))


def _scalar(mode: str, colormap: str = "lagoon") -> Callable[[Any, Scale], np.ndarray]:
    return lambda values, scale: scalar_colours(values, *scale.ends(mode, values), colormap)


_MODES: dict[str, Callable[[Any, Scale], np.ndarray]] = {
    "level": _by_level,
    "step": _scalar("step"),
    "lead": _scalar("lead"),
    "speed": _scalar("speed"),
    "density": _scalar("density", "balance"),
    "sound": _scalar("sound"),
    "fluid": _by_fluid,
    "pressure": _scalar("pressure"),
    "plain": _plain,
}
MODES = tuple(_MODES)


def colour_by(mode: str, values, scale: Scale = Scale()) -> np.ndarray:
    """Return (N, 3) float32 colours of `values`, (N,); `mode` is one of `MODES` and says what they are.

    Levels, steps and leads [s], speeds and sound speeds [m/s], densities [kg/m^3], pressures [Pa], places of fluids in the
    scene; for "plain" only their number counts. Raises `RenderError` for an unknown mode.
    """
    return _choose("colour mode", mode, _MODES)(np.asarray(values), scale)
