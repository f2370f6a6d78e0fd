"""Particles at one moment, as every file format takes and gives them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

AXES = ("x", "y", "z")
COARSEST = 1e-3
"""Share of the spacing by which single precision may round positions in files."""
COMPONENTS = {"velocity": ("vx", "vy", "vz")}
"""Columns of a vector in formats that know only scalars; another one's are NAME_x, NAME_y, NAME_z."""


@dataclass(frozen=True)
class ParticleFrame:
    """Particles at `time` [s], in order of their stable ids.

    Attributes:
        positions: [m], (N, dim).
        attributes: what else is known of each particle by name, (N,) or (N, dim) each.
        time: [s].
        spacing: initial particle spacing [m] of the scene they are from, None where a file does not say.
        origin: a point [m], (dim,), near them that is the same in all frames of a run, None: their own lower corner.
    """

    positions: np.ndarray
    attributes: dict[str, np.ndarray] = field(default_factory=dict)
    time: float = 0.0
    spacing: float | None = None
    origin: tuple[float, ...] | None = None

    @property
    def dim(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return int(self.positions.shape[1])

    @property
    def needs_double(self) -> bool:
        """Whether single precision rounds the positions by more than `COARSEST` of the spacing."""
        return self.positions.dtype == np.float64 and len(self.positions) > 0 and self._rounds(self.positions)

    @property
    def offset(self) -> np.ndarray:
        """A point [m], (dim,), near `origin` that single precision holds, as it then holds the rest; 0 where it needs none."""
        found = np.zeros(self.dim)
        if self.origin is not None:
            found = np.asarray(self.origin, float)
        elif self.needs_double:
            found = self.positions.min(axis=0)
        return found.astype(np.float32).astype(np.float64) if self._rounds(found) else np.zeros(self.dim)

    def _rounds(self, x: np.ndarray) -> bool:
        """Whether single precision is too coarse for coordinates `x` [m]; without a spacing that of a lattice counts."""
        spacing = self.spacing
        if spacing is None:
            spacing = float(np.ptp(self.positions, axis=0).max()) / len(self.positions) ** (1.0 / self.dim)
        return float(np.abs(x).max()) * 2.0**-24 > COARSEST * spacing

    def arrays(self) -> dict[str, np.ndarray]:
        """Return `position` and all attributes, (N,) or (N, 3) each, what is 2D with a zero: what formats for 3D tools hold."""
        return {name: pad(values) for name, values in {"position": self.positions, **self.attributes}.items()}

    def columns(self) -> dict[str, np.ndarray]:
        """Return x, y, z and all attributes as scalars, (N,) each: what tables hold."""
        found: dict[str, np.ndarray] = {}
        for name, values in self.arrays().items():
            found |= {name: values} if values.ndim == 1 else dict(zip(component_names(name), values.T, strict=True))
        return found


def pad(values: np.ndarray) -> np.ndarray:
    """Return two-dimensional vectors, (N, 2), as (N, 3) with a zero behind; all else as it is."""
    return np.pad(values, ((0, 0), (0, 1))) if values.ndim == 2 and values.shape[1] == 2 else values


def component_names(name: str) -> tuple[str, ...]:
    """Names of the columns of the vector `name`."""
    return AXES if name == "position" else COMPONENTS.get(name, tuple(f"{name}_{axis}" for axis in AXES))


def from_arrays(arrays: dict[str, np.ndarray], time: float = 0.0, spacing: float | None = None) -> ParticleFrame:
    """Return the frame that holds `position` and attributes; where every z is zero it is two-dimensional.

    Raises `ValueError` if there is no position.
    """
    if "position" not in arrays:
        raise ValueError(f"it holds no positions, only {', '.join(arrays) or 'nothing'}")
    vectors = [values for values in arrays.values() if values.ndim == 2 and values.shape[1] == 3]
    if len(arrays["position"]) and all(not values[:, 2].any() for values in vectors):
        arrays = {name: v[:, :2] if v.ndim == 2 and v.shape[1] == 3 else v for name, v in arrays.items()}
    rest = {name: values for name, values in arrays.items() if name != "position"}
    return ParticleFrame(arrays["position"], rest, time, spacing)


def from_columns(columns: dict[str, np.ndarray]) -> ParticleFrame:
    """Return the frame that holds columns x, y, perhaps z, and others; raises `ValueError` if x or y is missing."""
    arrays = dict(columns)
    for name in ("position", *COMPONENTS):
        parts = [arrays.pop(part) for part in component_names(name) if part in arrays]
        if len(parts) >= 2:
            arrays[name] = np.stack(parts, axis=1)
    return from_arrays(arrays)
