"""Every format that particles are written to and read from: to add one, write its functions and list it here."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from taichi_rts.errors import OutputError, SceneError, did_you_mean
from taichi_rts.particle_files.bgeo import read_bgeo, write_bgeo
from taichi_rts.particle_files.frame import ParticleFrame
from taichi_rts.particle_files.ply import read_ply, write_ply
from taichi_rts.particle_files.surface import write_surface
from taichi_rts.particle_files.tables import read_csv, read_npz, write_npz
from taichi_rts.particle_files.vtkhdf import write_vtkhdf
from taichi_rts.particle_files.vtu import read_vtu, write_vtu


@dataclass(frozen=True)
class Format:
    """A file format: how to write and read it, and what that takes.

    Attributes:
        suffix: of its files.
        write: from a frame to the file's bytes; None: it is only read.
        read: back again; raises an error that is no `rts.Error` where the bytes are not such a file. None: only written.
        package, extra: what has to be installed to write it, and the extra of `taichi_rts` that has it.
        folder: of a run's folder in which its files lie.
        dims: numbers of space dimensions that it can hold.
        single: whether it holds reals in single precision alone, and so positions far from 0 less an offset.
    """

    suffix: str
    write: Callable[[ParticleFrame], bytes] | None = None
    read: Callable[[bytes], ParticleFrame] | None = None
    package: str = ""
    extra: str = ""
    folder: str = "particles"
    dims: tuple[int, ...] = (2, 3)
    single: bool = False


FORMATS = {
    "vtu": Format(".vtu", write_vtu, read_vtu),
    "ply": Format(".ply", write_ply, read_ply),
    "npz": Format(".npz", write_npz, read_npz),
    "bgeo": Format(".bgeo", write_bgeo, read_bgeo, single=True),
    "vtkhdf": Format(".vtkhdf", write_vtkhdf, package="h5py", extra="hdf"),
    "surface": Format(".ply", write_surface, package="pysplashsurf", extra="surface", folder="surface", dims=(3,)),
    "csv": Format(".csv", read=read_csv),
}
WRITTEN = tuple(name for name, each in FORMATS.items() if each.write)
READ = {each.suffix: each.read for each in FORMATS.values() if each.read}


def require_format(name: str, dim: int | None = None) -> Format:
    """Return the format `name`; raises `OutputError` if nothing can be written to it here, or not in `dim` dimensions."""
    if name not in WRITTEN:
        hint = did_you_mean(name, WRITTEN)
        raise OutputError(f"--export {name!r} is no format; choose from {', '.join(WRITTEN)}{hint}")
    found = FORMATS[name]
    if found.package and importlib.util.find_spec(found.package) is None:
        raise OutputError(
            f"--export {name} needs the package {found.package}; run: pip install 'taichi_rts[{found.extra}]'"
        )
    if dim is not None and dim not in found.dims:
        raise OutputError(
            f"--export {name} needs a scene in {found.dims[0]} dimensions, this one has {dim}; leave it out"
        )
    return found


def read_particles(path: str | Path) -> ParticleFrame:
    """Read particles from a vtu, ply, npz, bgeo or csv file; raises `SceneError` if it cannot be read or is none."""
    path = Path(path)
    read = READ.get(path.suffix.lower())
    if read is None:
        raise SceneError(f"particle file {str(path)!r} has none of the known suffixes {', '.join(READ)}; convert it")
    if path.exists() and not path.is_file():  # a device may have no end
        raise SceneError(f"particle file {str(path)!r} is no file but a folder or a device; check the path")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"particle file {str(path)!r} cannot be read: {error.strerror}; check the path") from None
    try:
        return read(data)
    except Exception as error:  # any error that a damaged file can cause
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise SceneError(f"particle file {str(path)!r} is not a whole {path.suffix} file: {reason}") from None
