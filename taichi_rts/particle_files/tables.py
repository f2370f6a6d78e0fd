"""npz, NumPy's own file, which keeps every bit; and CSV, which is only read."""

from __future__ import annotations

import io
import zipfile

import numpy as np

from taichi_rts.files.unpacking import require_sizes
from taichi_rts.particle_files.frame import ParticleFrame, from_arrays, from_columns

PLURALS = {"positions": "position", "velocities": "velocity", "densities": "density"}


def write_npz(frame: ParticleFrame) -> bytes:
    """Return `frame` as an npz file: `position`, (N, dim), each attribute, `time` and `spacing`; not compressed."""
    buffer = io.BytesIO()
    spacing = {} if frame.spacing is None else {"spacing": np.float64(frame.spacing)}
    np.savez(buffer, time=np.float64(frame.time), **spacing, position=frame.positions, **frame.attributes)  # type: ignore[arg-type]
    return buffer.getvalue()


def read_npz(data: bytes) -> ParticleFrame:
    """Read an npz file; names may be plural. Raises `ValueError` if it is none, or needs pickle."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            require_sizes(archive, len(data))
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {PLURALS.get(name, name): file[name] for name in file.files}
    except (zipfile.BadZipFile, EOFError, KeyError, AttributeError) as error:
        raise ValueError(f"it is not an npz file ({error})") from None
    time, spacing = arrays.pop("time", None), arrays.pop("spacing", None)
    if "position" not in arrays or arrays["position"].ndim != 2:
        return from_arrays({name: values for name, values in arrays.items() if name != "position"})
    positions = arrays.pop("position")
    return ParticleFrame(
        positions, arrays, 0.0 if time is None else float(time), None if spacing is None else float(spacing)
    )


def read_csv(data: bytes) -> ParticleFrame:
    """Read a table with a row of names first (x, y, z, vx, vy, vz, density ...); raises `ValueError` if it is none."""
    text = data.decode("utf-8-sig")
    head, _, rows = (part.strip() for part in text.partition("\n"))
    if not rows:
        raise ValueError("it has no rows")
    separator = next((mark for mark in ",;\t" if mark in head), None)
    names = [name.strip().strip('"').lower() for name in head.split(separator)]
    table = np.loadtxt(io.StringIO(rows), delimiter=separator, ndmin=2)
    if table.shape[1] != len(names):
        raise ValueError(f"it has {len(names)} names ({', '.join(names)}) for {table.shape[1]} columns")
    return from_columns(dict(zip(names, table.T, strict=True)))
