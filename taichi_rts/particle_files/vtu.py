"""VTU, the XML file of VTK with its arrays as raw bytes behind the XML, and the PVD collection that gives frames their times.

VTK File Formats, https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html: every particle is a vertex.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from xml.sax.saxutils import quoteattr

import numpy as np

from taichi_rts.particle_files.frame import ParticleFrame, from_arrays

TYPES = {"f4": "Float32", "f8": "Float64", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
DTYPES = {name: np.dtype("<" + code) for code, name in TYPES.items()}
VERTEX = 1  # VTK's number of this kind of cell
TIME = "TimeValue"  # the field that ParaView takes for the time of the data
DIMENSION = "dimension"  # of the scene: positions have three components in any case
MARK = b'<AppendedData encoding="raw">'


def write_vtu(frame: ParticleFrame) -> bytes:
    """Return `frame` as a VTU file."""
    arrays = frame.arrays()
    count = len(frame.positions)
    blobs: list[bytes] = []

    def appended(name: str, values: np.ndarray) -> str:
        components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
        kind = TYPES[values.dtype.str[1:]]
        offset = sum(map(len, blobs))
        data = np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()
        blobs.extend((np.uint64(len(data)).astype("<u8").tobytes(), data))
        return f'<DataArray type="{kind}" Name={quoteattr(name)}{components} format="appended" offset="{offset}"/>\n'

    # One byte before all others: meshio (5.3) looks for arrays by offsets that it has partly replaced by multiples of 4 already.
    dimension = appended(DIMENSION, np.array([frame.positions.shape[1]], np.uint8))
    points = appended("Points", arrays.pop("position"))
    data = "".join(appended(name, values) for name, values in arrays.items())
    index = np.int32 if count < 2**31 - 1 else np.int64
    cells = appended("connectivity", np.arange(count, dtype=index))
    cells += appended("offsets", np.arange(1, count + 1, dtype=index))
    cells += appended("types", np.full(count, VERTEX, np.uint8))
    head = (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        "<UnstructuredGrid>\n"
        f'<FieldData><DataArray type="Float64" Name="{TIME}" NumberOfTuples="1" format="ascii">{frame.time!r}'
        f"</DataArray>\n{dimension}</FieldData>\n"
        f'<Piece NumberOfPoints="{count}" NumberOfCells="{count}">\n'
        f"<Points>\n{points}</Points>\n<PointData>\n{data}</PointData>\n<Cells>\n{cells}</Cells>\n"
        "</Piece>\n</UnstructuredGrid>\n"
    )
    return b"".join([head.encode(), MARK, b"_", *blobs, b"\n</AppendedData>\n</VTKFile>\n"])


def read_vtu(data: bytes) -> ParticleFrame:
    """Read a VTU file as `write_vtu` writes it; raises `ValueError` for another one."""
    head, mark, rest = data.partition(MARK)
    if not mark:
        raise ValueError("its arrays are not appended as raw bytes; write it anew as ply or npz")
    if b"<!" in head:  # entities could grow without bound
        raise ValueError("it declares XML entities or has comments, which no particle file needs")
    root = ET.fromstring(head + b"</VTKFile>")
    if root.get("compressor") or root.get("header_type") != "UInt64" or root.get("byte_order") != "LittleEndian":
        raise ValueError("it is compressed or not little-endian with 64-bit headers; write it anew as ply or npz")
    raw = rest[rest.index(b"_") + 1 :]

    def values(array: ET.Element) -> np.ndarray:
        offset = int(array.attrib["offset"])
        size = int(np.frombuffer(raw, "<u8", 1, offset)[0])
        found = np.frombuffer(raw[offset + 8 : offset + 8 + size], DTYPES[array.attrib["type"]])
        components = int(array.get("NumberOfComponents", 1))
        return found.reshape(-1, components) if components > 1 else found

    piece = root.findall(".//Piece")
    if len(piece) != 1:
        raise ValueError(f"it has {len(piece)} pieces; one is needed")
    arrays = {array.attrib["Name"]: values(array) for array in piece[0].findall("PointData/DataArray")}
    arrays["position"] = values(piece[0].findall("Points/DataArray")[0])
    time = root.find(f".//FieldData/DataArray[@Name='{TIME}']")
    return from_arrays(arrays, float(time.text or 0.0) if time is not None else 0.0)


def collection(files: Iterable[tuple[float, str]]) -> bytes:
    """Return the PVD file that names `files`, each with its time [s]."""
    rows = "".join(f'<DataSet timestep="{time!r}" part="0" file={quoteattr(name)}/>\n' for time, name in files)
    text = f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n{rows}</Collection>\n</VTKFile>\n'
    return text.encode()
