"""From levels and fields to colours (sRGB, 0 to 1), in NumPy only."""

import numpy as np
from PIL import ImageColor

from taichi_rts.errors import RenderError
from taichi_rts.readings.levels import octaves

PLAIN = (0.22, 0.50, 0.80)  # water


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


def _needed(mode: str, name: str, values):
    if values is None:
        raise RenderError(f"colour mode {mode!r} needs {name}, got None: pass {name}= or choose another mode")
    return np.asarray(values)


def _by_level(levels, palette, doubling, **_):
    return level_colours(_needed("level", "levels", levels), palette, doubling=doubling)


def _by_speed(speeds, max_speed, **_):
    speeds = _needed("speed", "speeds", speeds)
    return scalar_colours(speeds, *speed_range(speeds, max_speed))


def _by_density(densities, rest_density, **_):
    return scalar_colours(_needed("density", "densities", densities), *density_range(rest_density), "balance")


def _by_step(steps, longest_step, **_):
    steps = _needed("step", "steps", steps)
    return scalar_colours(steps, *step_range(steps, longest_step))


def _by_lead(leads, longest_step, **_):
    leads = _needed("lead", "leads", leads)
    return scalar_colours(leads, *step_range(leads, longest_step))


def _by_sound(sounds, top_sound, **_):
    sounds = _needed("sound", "sounds", sounds)
    return scalar_colours(sounds, *sound_range(sounds, top_sound))


def fluid_colours(names, palette: str = "default") -> np.ndarray:
    """Return (K, 3) colours of K fluids: by name, as HTML has it, or for None the palette's of the fluid's place."""
    own = level_colours(np.arange(1, len(names) + 1), palette)
    given = [None if name is None else np.array(ImageColor.getrgb(name)[:3], np.float32) / 255 for name in names]
    return np.array([one if chosen is None else chosen for one, chosen in zip(own, given, strict=True)])


def _by_fluid(fluids, fluid_tints, **_):
    return _needed("fluid", "fluid_tints", fluid_tints)[_needed("fluid", "fluids", fluids)]


def _by_pressure(pressures, top_pressure, **_):
    pressures = _needed("pressure", "pressures", pressures)
    return scalar_colours(pressures, *pressure_range(pressures, top_pressure))


def _plain(count, **_):
    return np.tile(np.asarray(PLAIN, np.float32), (count, 1))


_MODES = {
    "level": _by_level,
    "step": _by_step,
    "lead": _by_lead,
    "speed": _by_speed,
    "density": _by_density,
    "sound": _by_sound,
    "fluid": _by_fluid,
    "pressure": _by_pressure,
    "plain": _plain,
}
MODES = tuple(_MODES)


def speed_range(speeds, max_speed: float | None) -> tuple[float, float]:
    """Return the range that mode "speed" shows [m/s]."""
    return 0.0, _upper(speeds, max_speed)


def sound_range(sounds, top_sound: float | None) -> tuple[float, float]:
    """Return the range that mode "sound" shows [m/s]."""
    return 0.0, _upper(sounds, top_sound)


def pressure_range(pressures, top_pressure: float | None) -> tuple[float, float]:
    """Return the range that mode "pressure" shows [Pa]."""
    return 0.0, _upper(pressures, top_pressure)


def step_range(steps, longest_step: float | None) -> tuple[float, float]:
    """Return the range that modes "step" and "lead" show [s]."""
    return 0.0, _upper(steps, longest_step)


def _upper(values, given: float | None) -> float:
    """Upper end of a range from 0: as given, else the largest value."""
    if given is None:
        finite = np.asarray(values)[np.isfinite(values)]
        given = float(finite.max()) if finite.size else 1.0
    return max(float(given), 1e-12)


def density_range(rest_density: float) -> tuple[float, float]:
    """Return the range that mode "density" shows [kg/m^3]: 5 % on either side of rest."""
    return 0.95 * rest_density, 1.05 * rest_density


def colour_by(
    mode: str,
    *,
    levels=None,
    speeds=None,
    densities=None,
    steps=None,
    leads=None,
    sounds=None,
    fluids=None,
    fluid_tints=None,
    pressures=None,
    rest_density: float = 1000.0,
    max_speed: float | None = None,
    longest_step: float | None = None,
    top_sound: float | None = None,
    top_pressure: float | None = None,
    palette: str = "default",
    doubling: bool = False,
) -> np.ndarray:
    """Return (N, 3) float32 colours; `mode` is one of `MODES`.

    Units: speeds, sounds [m/s], densities [kg/m^3], steps, leads [s], pressures [Pa]. `fluids` are the places, (N,), of
    particles' colours in `fluid_tints`, (K, 3).
    """
    choose = _choose("colour mode", mode, _MODES)
    arrays = (levels, speeds, densities, steps, leads, sounds, fluids, pressures)
    given = [values for values in arrays if values is not None]
    if not given:
        raise RenderError(
            f"colour mode {mode!r} got no array, and needs at least one to know the number of particles: "
            "pass levels=, speeds=, densities=, steps=, leads=, sounds=, fluids= or pressures="
        )
    return choose(
        levels=levels,
        speeds=speeds,
        densities=densities,
        steps=steps,
        leads=leads,
        sounds=sounds,
        fluids=fluids,
        fluid_tints=fluid_tints,
        pressures=pressures,
        rest_density=rest_density,
        max_speed=max_speed,
        longest_step=longest_step,
        top_sound=top_sound,
        top_pressure=top_pressure,
        palette=palette,
        doubling=doubling,
        count=len(given[0]),
    )
