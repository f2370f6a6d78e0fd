"""Checkpoints with a right checksum and wrong content: every field of the header, and arrays that lie."""

import copy
import hashlib
import json
import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scenes import MISSING

from taichi_rts.files.archive import DIGEST, write_archive

Change = Callable[[dict[str, Any], dict[str, np.ndarray]], None]


def read(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return header and arrays of a checkpoint."""
    with zipfile.ZipFile(path) as archive:
        header = json.loads(archive.read("header.json"))
    with np.load(path, allow_pickle=False) as file:
        return header, {name: file[name] for name in file.files if name != "header.json"}


def write_changed(source: Path, target: Path, change: Change) -> None:
    """Write the checkpoint `source` to `target` with other content and a right checksum."""
    header, arrays = read(source)
    header = copy.deepcopy(header)
    change(header, arrays)
    write_archive(target, header, arrays)


def at(*path: Any, value: Any) -> Change:
    """Return the change that sets, or removes, one value of the header."""

    def change(header: dict[str, Any], _arrays: dict[str, np.ndarray]) -> None:
        owner: Any = header
        for key in path[:-1]:
            owner = owner[key]
        if value is MISSING:
            del owner[path[-1]]
        else:
            owner[path[-1]] = value

    return change


def array(name: str, make: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Return the change of one array."""

    def change(_header: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        arrays[name] = make(arrays[name])

    return change


RUN = ("runs", 0)
HEADER = [("format",), ("version",), ("arch",), ("precision",), ("extra",), ("runs",)]
OF_A_RUN = [(*RUN, key) for key in ("scene", "stepper", "time", "fields", "values")]
ROWS: list[tuple[str, Change]] = [
    *((f"{'.'.join(map(str, path))} missing", at(*path, value=MISSING)) for path in (*HEADER, *OF_A_RUN)),
    *(
        (f"{'.'.join(map(str, path))} of wrong type", at(*path, value=7.5))
        for path in (*HEADER, *OF_A_RUN)
        if path[-1] != "time"
    ),
    ("no run", at("runs", value=[])),
    ("format of the future", at("format", value=99)),
    ("another version", at("version", value="0.0.1")),
    ("time text", at(*RUN, "time", value="soon")),
    ("time NaN", at(*RUN, "time", value=math.nan)),
    ("time infinite", at(*RUN, "time", value=math.inf)),
    ("time negative", at(*RUN, "time", value=-1.0)),
    ("unknown stepper", at(*RUN, "stepper", "name", value="leapfrog")),
    ("courant of 50", at(*RUN, "stepper", "courant", value=50.0)),
    ("unknown parameter of the stepper", at(*RUN, "stepper", "mood", value=1)),
    ("spacing of 1e-7", at(*RUN, "scene", "spacing", value=1e-7)),
    ("spacing NaN", at(*RUN, "scene", "spacing", value=math.nan)),
    ("unknown key of the scene", at(*RUN, "scene", "spacin", value=1.0)),
    ("particles from a file elsewhere", at(*RUN, "scene", "fluids", value=[{"file": "/etc/passwd"}])),
    ("a field less", at(*RUN, "fields", 0, value="nothing")),
    ("values of no part", at(*RUN, "values", value={"nothing": {}})),
    ("the clock is text", at(*RUN, "values", "solver.timeline", "now", value="noon")),
    ("the clock is NaN", at(*RUN, "values", "solver.timeline", "now", value=math.nan)),
    ("frames are text", at("extra", "frames", value="many")),
    ("energies are text", at("extra", "initial_energy", value="many")),
    ("an option that there is not", at("extra", "command", value={"nonsense": 1})),
    ("a command that is a number", at("extra", "command", value=7)),
    ("positions of 1e6 particles", array("0/solver.particles.x", lambda x: np.zeros((1_000_000, 2), x.dtype))),
    ("positions of one dimension", array("0/solver.particles.x", lambda x: x[:, :1])),
    ("positions of integers", array("0/solver.particles.x", lambda x: x.astype(np.int64))),
    ("a missing array", lambda _header, arrays: arrays.__delitem__("0/solver.particles.v")),
]


def lie(source: Path, target: Path) -> None:
    """Write a checkpoint whose positions say that they are 1e12."""
    text = f"({10**12}, 2)"
    header, arrays = read(source)
    write_archive(target, header, arrays)
    data = bytearray(target.read_bytes())
    place = data.index(b"0/solver.particles.x.npy")
    start = data.index(b"'shape': (", place) + len(b"'shape': ")
    end = data.index(b"}", start)
    data[start:end] = f"{text}, ".ljust(end - start)[: end - start].encode()
    target.write_bytes(_with_checksum(bytes(data)))


def _with_checksum(data: bytes) -> bytes:
    body = data[:-DIGEST]
    return body + hashlib.sha256(body).hexdigest().encode()
