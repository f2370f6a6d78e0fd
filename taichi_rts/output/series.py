"""The time series of a run: a CSV file with a row for each frame."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from taichi_rts.errors import OutputError
from taichi_rts.files.writing import write_bytes
from taichi_rts.readings import measures
from taichi_rts.readings.measures import FaceForces
from taichi_rts.readings.reading import Readable, Reading
from taichi_rts.scene.geometry.periodic import periods
from taichi_rts.scene.parts import probes
from taichi_rts.scene.parts.conditions import AXES


class Series:
    """The time series of `sim` in the file `path`: each call adds a row for its present time; an earlier file is replaced.

    A run that goes on names the `times` [s] of the rows to keep; what comes behind them is cut off.

    Columns: time [s]; kinetic_energy, potential_energy, internal_energy [J]; front (fifth-largest x), centre_x ... [m], the
    centre of mass; max_speed [m/s]; level_n, the share of particles whose step is n base steps (where levels double: n up to
    2n - 1); particle_updates so far; inflow and outlet_n [kg], the mass that has come in so far and that each outlet, counted
    from 0, has taken out; pressure_NAME [Pa] of each probe of the scene; height_NAME [m] of each gauge;
    force_FACE [N], the pressure force on each wall of the domain along its outward normal (`measures.FaceForces`). In two
    dimensions energies and forces are per metre of depth.
    """

    def __init__(self, path: str | Path, sim: Readable, times: Sequence[float] = ()) -> None:
        self.path = Path(path)
        self.sim = sim
        start = sim.read()
        self.forces = FaceForces(start.local, start.medium)
        self.times: list[float] = []
        """Times [s] of the rows written."""
        if times and self.path.exists():
            self.times = list(times)
            rows = self.path.read_bytes().splitlines(keepends=True)[: len(times) + 1]
            write_bytes(self.path, b"".join(rows))

    def __call__(self, state: Readable | None = None) -> None:
        """Add a row: a `Reading` of the simulation it was made for, or that simulation, which is also what None stands for."""
        now = (state or self.sim).read()
        row = self.measure(now)
        digits = 15 if any(now.origin) else 9  # far from 0 coordinates need more of them
        line = ",".join(f"{value:.{digits}g}" for value in row.values()) + "\n"
        if self.times and self.path.exists():  # the folder may have been deleted meanwhile
            append(self.path, line.encode())
        else:
            write_bytes(self.path, (",".join(row) + "\n" + line).encode())
        self.times.append(now.time)

    def measure(self, state: Readable | None = None) -> dict[str, float]:
        """Return the values by column, at present or of a `state`."""
        now = (state or self.sim).read()
        scene, x, p = now.local, now.local_positions, now.pressures
        centre = x.sum(axis=0, dtype=np.float64) / max(1, len(x)) + now.origin  # outlets may have taken out all
        points = np.array([probe.position for probe in scene.probes]).reshape(-1, scene.dim)
        pressures = measures.interpolate(x, p, points, now.medium.kernel, periods(scene))
        heights = [measures.water_height(scene, now.medium, x, np.asarray(g.position)) for g in scene.gauges]
        return {
            "time": now.time,
            **{f"{name}_energy": value for name, value in now.energy._asdict().items()},
            "front": measures.front(x) + now.origin[0],
            **dict(zip((f"centre_{axis}" for axis in AXES), centre, strict=False)),
            "max_speed": now.max_speed,
            **_shares(now),
            "particle_updates": now.particle_updates,
            **({} if now.inflow is None else {"inflow": now.inflow}),
            **{f"outlet_{number}": mass for number, mass in enumerate(now.outflows)},
            **{f"pressure_{name}": value for name, value in zip(probes.names(scene.probes), pressures, strict=True)},
            **{f"height_{name}": value for name, value in zip(probes.names(scene.gauges), heights, strict=True)},
            **{
                f"force_{face}": value
                for face, value in zip(self.forces.faces, self.forces.at(now.time, x, now.densities, p), strict=True)
            },
        }


def _shares(now: Reading) -> dict[str, float]:
    """Share of the particles by level, or by octave where levels double."""
    count, shares = now.level_count, now.level_shares
    first = 2 ** np.arange(count.bit_length()) if now.levels_double else np.arange(len(shares)) + 1
    sums = np.add.reduceat(shares, first - 1)
    return {f"level_{n}": float(share) for n, share in zip(first, sums, strict=True)}


def append(path: Path, line: bytes) -> None:
    """Add a whole line to the file `path`; raises `OutputError`, and then leaves it as it was."""
    try:
        before = path.stat().st_size
        try:
            with path.open("ab", buffering=0) as file:
                if file.write(line) != len(line):
                    raise OSError(28, os.strerror(28))
        except OSError:
            with contextlib.suppress(OSError):
                os.truncate(path, before)
            raise
    except OSError as error:
        raise OutputError(
            f"{path} cannot be written: {error.strerror}; free some space or choose another --output-dir"
        ) from None
