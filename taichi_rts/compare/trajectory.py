"""The states of a run at the times at which it is compared."""

from __future__ import annotations

import io
from dataclasses import dataclass, field

import numpy as np

from taichi_rts.readings.reading import Reading


@dataclass
class Trajectory:
    """States at `times` [s], the first of them the start; particles in order of their stable ids, whose number may grow.

    Attributes:
        times: [s], (S,).
        positions, velocities: for each time (N, dim) [m], [m/s].
        densities: for each time (N,) [kg/m^3].
        pressures: for each time (N,) [Pa].
        energies: for each time kinetic, potential and internal energy [J].
    """

    times: list[float] = field(default_factory=list)
    positions: list[np.ndarray] = field(default_factory=list)
    velocities: list[np.ndarray] = field(default_factory=list)
    densities: list[np.ndarray] = field(default_factory=list)
    pressures: list[np.ndarray] = field(default_factory=list)
    energies: list[tuple[float, ...]] = field(default_factory=list)

    def append(self, now: Reading) -> None:
        """Add a state."""
        self.times.append(float(now.time))
        self.positions.append(now.positions)
        self.velocities.append(now.velocities)
        self.densities.append(now.densities)
        self.pressures.append(now.pressures.astype(now.densities.dtype))
        self.energies.append(tuple(float(part) for part in now.energy))

    def to_bytes(self) -> bytes:
        """Return the trajectory as a compressed npz file without pickled objects."""
        buffer = io.BytesIO()
        np.savez_compressed(
            buffer,
            times=np.asarray(self.times),
            counts=np.asarray([len(x) for x in self.positions]),
            positions=np.concatenate(self.positions),
            velocities=np.concatenate(self.velocities),
            densities=np.concatenate(self.densities),
            pressures=np.concatenate(self.pressures),
            energies=np.asarray(self.energies),
        )
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> Trajectory:
        """Read what `to_bytes` wrote; raises `ValueError`, `KeyError`, `OSError` or `BadZipFile` if it did not."""
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            ends = np.cumsum(file["counts"])[:-1]
            names = ("positions", "velocities", "densities", "pressures")
            x, v, rho, p = (list(np.split(file[name], ends)) for name in names)
            energies = [tuple(float(part) for part in row) for row in file["energies"]]
            return cls([float(time) for time in file["times"]], x, v, rho, p, energies)
