"""Particles of a running simulation into files for other tools, one a frame (`particle_files` knows the formats)."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from taichi_rts.errors import OutputError, did_you_mean
from taichi_rts.files.writing import write_bytes
from taichi_rts.output.turning import UP, UpAxis, rotation_to, turned
from taichi_rts.particle_files.formats import FORMATS, require_format
from taichi_rts.particle_files.frame import ParticleFrame
from taichi_rts.particle_files.vtu import collection
from taichi_rts.readings.reading import Readable, Reading
from taichi_rts.scene.rows import fit_rows

ATTRIBUTES: dict[str, Callable[[Reading], np.ndarray]] = {
    "id": lambda now: now.ids,
    "velocity": lambda now: now.velocities,
    "density": lambda now: now.densities,
    "pressure": lambda now: now.pressures,
    "level": lambda now: now.levels,
    "step": lambda now: now.steps,
    "cell_time": lambda now: now.cell_times,
    "sound_speed": lambda now: now.sound_speeds,
    "fluid": lambda now: now.fluids,
}
"""What can be known of a particle, by name: to add one, write a function of a `Reading`."""
DEFAULT_ATTRIBUTES = ("id", "velocity", "density", "pressure", "level")


def require_attributes(names: Sequence[str]) -> None:
    """Raise `OutputError` for a name that is no attribute."""
    for name in names:
        if name not in ATTRIBUTES:
            hint = did_you_mean(name, ATTRIBUTES)
            raise OutputError(f"--attributes {name!r} is no attribute; choose from {', '.join(ATTRIBUTES)}{hint}")


def capture(state: Readable, attributes: Sequence[str] = DEFAULT_ATTRIBUTES) -> ParticleFrame:
    """Return the particles of a `Reading`, or of a `Simulation` at its present time.

    Reals are of the run's precision, positions as `Simulation.state` says.
    """
    require_attributes(attributes)
    now = state.read()
    found = {name: ATTRIBUTES[name](now) for name in attributes}
    precision = now.velocities.dtype
    reals = {name: values.astype(precision, copy=False) for name, values in found.items() if values.dtype.kind == "f"}
    return ParticleFrame(now.positions, found | reals, now.time, fit_rows(now.scene).spacing, now.origin)


def write_particles(path: str | Path, frame: ParticleFrame) -> None:
    """Write `frame` to a vtu, ply, npz, bgeo or vtkhdf file, by its suffix; raises `OutputError`."""
    path = Path(path)
    each = require_format(path.suffix[1:].lower(), frame.dim)
    assert each.write is not None  # for mypy
    warn_of_offset(path.suffix[1:].lower(), frame)
    write_bytes(path, each.write(frame))


def warn_of_offset(name: str, frame: ParticleFrame) -> None:
    """Warn if a file of the format `name` holds the positions of `frame` less an offset."""
    if FORMATS[name].single and frame.offset.any():
        warnings.warn(
            f"{name} holds single precision, too coarse for positions {np.abs(frame.positions).max():g} m from 0: they are "
            f"written less {tuple(frame.offset.tolist())}, which each point has as the attribute 'offset'; vtu, npz and ply hold "
            "double precision",
            stacklevel=3,
        )


class Exporter:
    """Writes the particles of a simulation each time it is called, to FOLDER/particles/000000.vtu and so on.

    Surfaces go to FOLDER/surface. With "vtu" FOLDER/particles/particles.pvd lists the frames with their times. Files of the
    same name are replaced. With an axis `up` all is turned so that this axis is against gravity (`Scene.up`). Raises
    `OutputError` at once for a format, an attribute or an axis that cannot be had.
    """

    def __init__(
        self,
        folder: str | Path,
        formats: Sequence[str] = ("vtu",),
        attributes: Sequence[str] = DEFAULT_ATTRIBUTES,
        *,
        dim: int | None = None,
        up: UpAxis | None = None,
    ) -> None:
        if up is not None and up not in UP:
            raise OutputError(
                f"--up {up!r} is no axis that points up in other tools; choose y (Houdini) or z (Blender)"
            )
        self.folder = Path(folder)
        self.formats = {name: require_format(name, dim) for name in dict.fromkeys(formats)}
        self.attributes = tuple(dict.fromkeys(attributes))
        require_attributes(self.attributes)
        self.times: list[float] = []
        """Times [s] of the frames written."""
        self.up = up
        self.offsets: dict[str, list[float]] = {}
        """Formats that hold positions less an offset, which is this [m]."""

    def take_up(self, times: Sequence[float]) -> None:
        """Go on behind the frames of `times` [s], which an earlier run has written."""
        self.times = list(times)

    def __call__(self, state: Readable) -> None:
        """Write the next frame: a `Reading`, or the present state of a `Simulation`."""
        if not self.formats:
            return
        frame = capture(state, self.attributes)
        for name in self.formats:
            require_format(name, frame.dim)
        if self.up is not None:
            frame = turned(frame, rotation_to(state.read().scene.up, self.up))
        self.times.append(frame.time)
        for name in self.formats:
            if FORMATS[name].single and frame.offset.any() and name not in self.offsets:
                warn_of_offset(name, frame)
                self.offsets[name] = frame.offset.tolist()
        for each in self.formats.values():
            assert each.write is not None  # for mypy
            write_bytes(self.folder / each.folder / f"{len(self.times) - 1:06d}{each.suffix}", each.write(frame))
        if "vtu" in self.formats:
            particles = self.folder / "particles"
            names = [(time, f"{number:06d}.vtu") for number, time in enumerate(self.times)]
            write_bytes(
                particles / "particles.pvd", collection([each for each in names if (particles / each[1]).exists()])
            )

    @property
    def files(self) -> dict[str, Any]:
        """Where the files are, below the folder, by format: NNNNNN stands for the number of the frame; and offsets [m]."""
        found: dict[str, Any] = {name: f"{each.folder}/NNNNNN{each.suffix}" for name, each in self.formats.items()}
        found |= {f"{name}_offset": offset for name, offset in self.offsets.items()}
        return found | ({"pvd": "particles/particles.pvd"} if "vtu" in self.formats else {})
