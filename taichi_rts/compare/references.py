"""References: runs in double precision with far smaller steps, kept on disk under a name made from all that decides them."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import zipfile
from pathlib import Path
from typing import Any

import taichi_rts as rts
from taichi_rts.compare.jobs import Job
from taichi_rts.compare.trajectory import Trajectory
from taichi_rts.device import forks
from taichi_rts.errors import OutputError
from taichi_rts.files.writing import write_bytes
from taichi_rts.solver.stepping.steppers import stepper_data

FINER = 8.0
"""How many times the smallest step tested is longer than the reference's."""
COARSER = math.sqrt(2.0)
"""Step of the second reference over the first's. Uniform steps are of second order, so its error is twice the first's, and
their difference is as large as the first's error: the floor below which no error can be told."""
SOLVER = (
    "assembly",
    "device",
    "files/unpacking.py",
    "medium",
    "particle_files",
    "sampling",
    "scene",
    "simulation.py",
    "solver",
)
"""Parts of the package that decide the bits of a run; only changes to them make references anew."""
IDLE = ("name", "description", "view")  # of a scene: changes no motion


def reference_jobs(scene: dict[str, Any], smallest: float, samples: int) -> tuple[Job, Job]:
    """Return the reference and the coarser one, for `smallest`, the smallest Courant number of a step tested."""
    finest = smallest / FINER
    return tuple(  # type: ignore[return-value]
        Job(scene, stepper_data(rts.Uniform(courant=courant)), samples, "cpu", "f64", reference=True)
        for courant in (finest, finest * COARSER)
    )


def job_key(job: Job, *more: str) -> str:
    """Return the SHA-256 of all that decides what a job gives: its data, the solver's source files, Taichi, the processor."""
    scene = {key: value for key, value in job.scene.items() if key not in IDLE}
    facts = [scene, job.stepper, job.samples, job.arch, job.precision, job.repeats, job.reference]
    about = [source_hash(), forks.versions(), platform.machine(), *more]
    return hashlib.sha256(json.dumps([facts, about], sort_keys=True).encode()).hexdigest()


def source_hash(package: Path | None = None) -> str:
    """Return the SHA-256 of the source files of `SOLVER`; what shows, stores or compares results is left out."""
    package = Path(rts.__file__).parent if package is None else package
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package).as_posix()
        if any(name == each or name.startswith(f"{each}/") for each in SOLVER):
            digest.update(f"{name}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()


def default_cache() -> Path:
    """Return $XDG_CACHE_HOME/taichi_rts/references, or ~/.cache in its place."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "taichi_rts" / "references"


def prepare_cache(folder: Path) -> None:
    """Make the folder; raises `OutputError` if it cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cache {folder} cannot be made: {error.strerror}; choose another --cache-dir") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"cache {folder} cannot be written: no permission; choose another --cache-dir")


def load(folder: Path, key: str) -> Trajectory | None:
    """Return the reference that is stored under `key`; None if there is none, or it cannot be read."""
    try:
        return Trajectory.from_bytes((folder / f"{key}.npz").read_bytes())
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def store(folder: Path, key: str, reference: Trajectory) -> None:
    """Store a reference under `key`, in one go."""
    write_bytes(folder / f"{key}.npz", reference.to_bytes())
