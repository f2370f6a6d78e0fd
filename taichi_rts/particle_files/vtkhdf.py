"""VTKHDF, VTK's HDF5 file (extra `hdf`), which ParaView reads in parallel: every particle is a vertex.

https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format/index.html, unstructured grid, version 1.0.
"""

from __future__ import annotations

import io

import numpy as np

from taichi_rts.particle_files.frame import ParticleFrame
from taichi_rts.particle_files.vtu import TIME, VERTEX


def write_vtkhdf(frame: ParticleFrame) -> bytes:
    """Return `frame` as a VTKHDF file."""
    import h5py  # only here, because it is an extra

    arrays = frame.arrays()
    count = len(frame.positions)
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = (1, 0)
        root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", len("UnstructuredGrid")))
        for name in ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"):
            root[name] = np.array([count], np.int64)
        root["Points"] = arrays.pop("position")
        root["Connectivity"] = np.arange(count, dtype=np.int64)
        root["Offsets"] = np.arange(count + 1, dtype=np.int64)
        root["Types"] = np.full(count, VERTEX, np.uint8)
        root.create_group("FieldData")[TIME] = np.array([frame.time])
        data = root.create_group("PointData")
        for name, values in arrays.items():
            data[name] = values
    return buffer.getvalue()
