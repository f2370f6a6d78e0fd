"""Tries a command in this process: how it ends, what it says, how long that takes, what it does to the disk."""

import contextlib
import gzip
import io
import os
import pickle
import sys
import time
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scenes import FILES

from taichi_rts.commands.main import main

PATIENCE = 2.0
"""Seconds of the processor within which bad input is refused: measured by studies/bad_input.py."""
HANG = 20.0
"""The same where a machine may be busy: in tests, which measure no time."""


@dataclass(frozen=True)
class Trial:
    """How a command ended."""

    code: int
    said: str
    seconds: float
    changed: tuple[str, ...]

    def faults(self, words: tuple[str, ...] = (), patience: float = HANG) -> list[str]:
        """Return what is wrong with the way it refused its input."""
        found = [] if self.code == 2 else [f"exit code {self.code}"]
        found += [f"does not say {word!r}" for word in words if word not in self.said]
        found += ["traceback"] if "Traceback" in self.said else []
        found += ["says nothing"] if not self.said.strip() else []
        found += [f"took {self.seconds:.1f} s"] if self.seconds > patience else []
        return found + [f"changed {path}" for path in self.changed]


def fill(folder: Path) -> None:
    """Put into `folder` what bad scenes name: files that are broken, that lie, that lead out of the folder."""
    for name, text in FILES.items():
        (folder / name).write_text(text)
    (folder / "nan.csv").write_text("x,y,z\n0.1,nan,0.2\n")
    (folder / "broken.obj").write_bytes(bytes(range(256)))
    for name in ("folder.obj", "folder.toml", "earlier/frames"):
        (folder / name).mkdir(parents=True)
    (folder / "earlier" / "run.json").write_text("{}")
    (folder / "link.obj").symlink_to("/etc/passwd")
    (folder / "pickle.npz").write_bytes(pickle.dumps({"position": [[0.1, 0.1, 0.1]]}))
    (folder / "bomb.bgeo").write_bytes(gzip.compress(b"BgeoV" + bytes(1 << 30 >> 4), 1) * 16)
    (folder / "lying.ply").write_text(
        "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0123456789"
    )
    entities = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10}">' for n in range(1, 12))
    (folder / "laughs.vtu").write_text(
        f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a0 "ha">{entities}]><VTKFile>&a11;<AppendedData encoding="raw">_'
    )
    with zipfile.ZipFile(folder / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        head = io.BytesIO()
        np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (1 << 37, 1)})
        archive.writestr("position.npy", head.getvalue() + bytes(1 << 20))


def tree(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Return all paths below `folder` with what changes when they are written to."""
    found = {}
    for path in sorted(folder.rglob("*")):
        facts = path.lstat()
        written = (0, 0) if path.is_dir() else (facts.st_size, facts.st_mtime_ns)  # of a folder only that it is there
        found[path.relative_to(folder).as_posix()] = (facts.st_mode, *written)
    return found


@contextlib.contextmanager
def without(package: str | None) -> Iterator[None]:
    """Let `package`, if it is one, be not installed: neither imported nor found."""
    if package is None:
        yield
        return
    kept = {name: sys.modules.pop(name) for name in [*sys.modules] if name.partition(".")[0] == package}
    finders = [finder for finder in sys.meta_path if hasattr(finder, "find_spec")]
    sys.meta_path[:] = [Hiding(package, finder) for finder in finders]
    try:
        yield
    finally:
        sys.meta_path[:] = finders
        sys.modules.update(kept)


class Hiding:
    """Finds what another finder finds, except for one package."""

    def __init__(self, package: str, finder: Any) -> None:
        self.package = package
        self.finder = finder

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        return None if name.partition(".")[0] == self.package else self.finder.find_spec(name, path, target)


def attempt(folder: Path, *args: str) -> Trial:
    """Run `taichi-rts` with `args` in `folder`."""
    before, here = tree(folder), Path.cwd()
    out, err = io.StringIO(), io.StringIO()
    began = time.process_time()
    code = 0
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main(list(args))
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else 1
    except Exception as error:
        err.write(f"Traceback: {type(error).__name__}: {error}")
        code = 1
    finally:
        os.chdir(here)
    seconds, after = time.process_time() - began, tree(folder)
    changed = tuple(sorted(path for path in before.keys() | after.keys() if before.get(path) != after.get(path)))
    return Trial(code, " ".join((out.getvalue() + err.getvalue()).split()), seconds, changed)
