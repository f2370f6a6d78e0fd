"""Packed data, of which nothing is taken at its word: what it unpacks to is known before memory is taken for it."""

from __future__ import annotations

import gzip
import io
import math
import zipfile
from typing import Any

import numpy as np

MOST_RATIO = 100
"""Largest size of what is unpacked over that of the file: particles have never been packed to less than a tenth."""
LEAST = 1 << 20  # bytes that any file may unpack to


def gunzip(data: bytes) -> bytes:
    """Return what gzipped `data` hold; raises `ValueError` if that is more than `MOST_RATIO` times their size."""
    most = max(LEAST, MOST_RATIO * len(data))
    with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
        found = file.read(most + 1)
    if len(found) > most:
        raise ValueError(f"it unpacks to more than {MOST_RATIO} times its size")
    return found


def require_sizes(archive: zipfile.ZipFile, length: int) -> None:
    """Raise `ValueError` unless every array of an npz file of `length` bytes is as large as it says, and not too large."""
    infos = archive.infolist()
    if sum(info.file_size for info in infos) > max(LEAST, MOST_RATIO * length):
        raise ValueError(f"it unpacks to more than {MOST_RATIO} times its size")
    for info in infos:
        if info.filename.endswith(".npy"):
            array_header(archive, info)


def array_header(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> tuple[tuple[int, ...], Any]:
    """Return shape and dtype of an array in an npz file; raises `ValueError` if there are fewer bytes than these take."""
    with archive.open(info) as member:
        version = np.lib.format.read_magic(member)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _order, dtype = read(member)
    if dtype.itemsize * math.prod(shape) > info.file_size:
        raise ValueError(
            f"{info.filename} says that it has the shape {shape}, which takes more than its {info.file_size} bytes"
        )
    return shape, dtype
