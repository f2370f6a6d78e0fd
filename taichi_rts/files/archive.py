"""One file for a header and arrays: an .npz that ends in a checksum of all of it, read without trusting its content.

NumPy opens it (`np.load`); a header in JSON is the member `header.json`. The checksum stands in the zip's comment, which is its
last bytes, so that it covers every other byte of the file.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from taichi_rts.errors import CheckpointError, Error
from taichi_rts.files.unpacking import array_header
from taichi_rts.files.writing import replacing

MARK = b"taichi_rts archive, sha256 "
DIGEST = 64  # hexadecimal digits
HEADER = "header.json"
CHUNK = 1 << 20
EPOCH = (1980, 1, 1, 0, 0, 0)  # of every member: the same state gives the same bytes


def write_archive(
    path: Path, header: Mapping[str, Any], arrays: Mapping[str, np.ndarray], temporary: Path | None = None
) -> None:
    """Write `path` in one go; raises `OutputError`, and then leaves what was there as it was."""
    with replacing(path, temporary) as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
            archive.comment = MARK + DIGEST * b"0"
            archive.writestr(zipfile.ZipInfo(HEADER, EPOCH), json.dumps(header))
            for name, values in arrays.items():
                with archive.open(zipfile.ZipInfo(f"{name}.npy", EPOCH), "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, np.asarray(values), allow_pickle=False)
        digest = _digest(file)
        file.seek(-DIGEST, 2)
        file.write(digest)


class Archive:
    """An archive that is open and whole. Raises `CheckpointError` if it is not, and as the methods say."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self.path = path
        file.seek(0, 2)
        ending = len(MARK) + DIGEST
        if file.tell() < ending:
            raise self.error("is too short to be a checkpoint")
        file.seek(-ending, 2)
        mark, digest = file.read(len(MARK)), file.read()
        if mark != MARK:
            raise self.error("does not end as a checkpoint of taichi_rts does: it is another file, or cut short")
        if digest != _digest(file):
            raise self.error("is damaged: its bytes do not fit its checksum")
        try:
            self.zip = zipfile.ZipFile(file)
            self.header = json.loads(self.zip.read(self._member(HEADER)))
            if not isinstance(self.header, dict):
                raise ValueError
        except (zipfile.BadZipFile, KeyError, ValueError, RecursionError, NotImplementedError):
            raise self.error("is damaged: it has no header that can be read") from None

    def error(self, what: str) -> CheckpointError:
        """Return the error that says `what` about this file."""
        return CheckpointError(f"{self.path} {what}; use another checkpoint")

    @contextlib.contextmanager
    def trusted_by_nobody(self) -> Iterator[None]:
        """Turn every error that malformed content causes into a `CheckpointError`: a checksum is no signature."""
        try:
            yield
        except Error:
            raise
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, RecursionError) as error:
            raise self.error(f"holds what cannot be used: {type(error).__name__}: {error}") from None

    def array(self, name: str, dtype: Any = None, shape: tuple[int, ...] | None = None) -> np.ndarray:
        """Read one array; raises `CheckpointError` before it takes any memory unless it has this dtype and shape."""
        try:
            info = self._member(f"{name}.npy")
            found, kind = array_header(self.zip, info)
            if (dtype is not None and kind != dtype) or (shape is not None and found != shape):
                raise self.error(f"has {name} of {kind} {found} where {np.dtype(dtype)} {shape} is needed")
            with self.zip.open(info) as member:
                return np.lib.format.read_array(member, allow_pickle=False)
        except (KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
            if isinstance(error, CheckpointError):
                raise
            raise self.error(f"has no array {name} that can be read") from None

    def _member(self, name: str) -> zipfile.ZipInfo:
        """Return the facts of a member, which is not packed and so no longer than the file; raises `ValueError` otherwise."""
        info = self.zip.getinfo(name)
        if info.compress_type != zipfile.ZIP_STORED or info.file_size > self.path.stat().st_size:
            raise ValueError
        return info


@contextlib.contextmanager
def open_archive(path: Path) -> Iterator[Archive]:
    """Open a file and check that it is a whole archive; raises `CheckpointError`."""
    with contextlib.ExitStack() as stack:
        try:
            archive = Archive(path, stack.enter_context(path.open("rb")))
        except OSError as error:
            raise CheckpointError(f"checkpoint {path} cannot be read: {error.strerror}; check the path") from None
        yield archive


def _digest(file: BinaryIO) -> bytes:
    """SHA-256 of all but the last bytes, in hexadecimal digits."""
    file.seek(0, 2)
    left = file.tell() - DIGEST
    file.seek(0)
    sha = hashlib.sha256()
    while left > 0:
        chunk = file.read(min(CHUNK, left))
        sha.update(chunk)
        left -= len(chunk)
    return sha.hexdigest().encode()
