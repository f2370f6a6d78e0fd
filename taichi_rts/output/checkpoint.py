"""Checkpoints: everything that decides the bits of the rest of a run, in one file.

What is in it: every field and plain value of each simulation (`inventory.py`), the scene and the stepper as plain data,
precision, versions. A simulation is built anew from its scene and its stepper, then its state is put back.
"""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from taichi_rts.assembly.inventory import State
from taichi_rts.device import backend, forks
from taichi_rts.device.backend import ti
from taichi_rts.errors import CheckpointError, Error, StepperError
from taichi_rts.files.archive import Archive, open_archive, write_archive
from taichi_rts.scene.files.reading import moved_along, parts_with_files, places_beside, require_files_near
from taichi_rts.scene.loading import scene_from
from taichi_rts.scene.obstacles.mesh import changed_mesh, file_digest
from taichi_rts.scene.scene import Scene
from taichi_rts.simulation import Simulation
from taichi_rts.solver.physics.own_forces import forces_data
from taichi_rts.solver.stepping.steppers import stepper_data, stepper_from

FORMAT = 3
"""Counts up when the file's layout changes."""
VALUE = "value:"
"""Begins the names of arrays that are plain values, not fields."""


def save_checkpoint(sim: Simulation, path: str | Path) -> None:
    """Write all of `sim` to `path` (.npz), in one go; raises `OutputError`.

    `load_checkpoint` gives a simulation that goes on with the same bits, on the same arch, as if it had never stopped.
    """
    write(Path(path), [sim])


def load_checkpoint(
    path: str | Path, run: int = 0, *, forces: Sequence[Any] = (), steppers: Sequence[type] = ()
) -> Simulation:
    """Build the simulation that `save_checkpoint` or a run with `--checkpoint-every` wrote.

    Call `taichi_rts.init` first, with the precision that it had. `run` chooses one of several, where panels showed several.
    The file holds no code: give forces of your own again as you gave them to `Simulation`, and the class of a stepper of your own
    in `steppers`, unless it is registered (`register_stepper`).
    Raises `CheckpointError` for a file that is not whole, is of another version, has another precision, another stepper or other
    forces.
    """
    with open_archive(Path(path)) as archive:
        checkpoint = Checkpoint(archive, steppers)
        if not 0 <= run < len(checkpoint.runs):
            raise CheckpointError(
                f"{path} has no run {run}, only {len(checkpoint.runs)} of them; use 0 to {len(checkpoint.runs) - 1}"
            )
        return checkpoint.simulation(run, forces=forces)


def write(
    path: Path, sims: Sequence[Simulation], extra: Mapping[str, Any] | None = None, temporary: Path | None = None
) -> None:
    """Write simulations that share a device, and `extra` plain data, to one file; raises `OutputError`."""
    runs: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    for number, sim in enumerate(sims):
        sim.taichi_start.require("this simulation")
        state = State(sim)
        values: dict[str, dict[str, Any]] = {owner: {} for owner in state.owners}
        for owner, name, value in state.values():
            values[owner][name] = _encoded(value, f"{number}/{VALUE}{owner}.{name}", arrays)
        arrays |= {f"{number}/{name}": field.to_numpy() for name, field in state.fields.items()}
        scene, stepper = sim.scene.to_dict(), stepper_data(sim.stepper)
        runs.append({"scene": scene, "stepper": stepper, "debug": sim.schedule.debug, "time": sim.time})
        runs[-1] |= {"forces": forces_data(sim.forces)} if sim.forces else {}
        runs[-1] |= {"fields": list(state.fields), "values": values}
    device = sims[0].backend
    files: dict[str, str] = {}
    for data in runs:
        files |= places_beside(data["scene"], path.parent)
    header = {
        "format": FORMAT,
        "version": version("taichi_rts"),
        "versions": forks.versions() | {"numpy": version("numpy"), "python": platform.python_version()},
        "arch": device.arch,
        "precision": device.precision,
        "extra": dict(extra or {}),
        "files": files,
        "runs": runs,
    }
    write_archive(path, header, arrays, temporary)


class Checkpoint:
    """What is in an open archive. Raises `CheckpointError` unless this version can read it.

    `steppers` are classes of a user's own, besides those that are registered.
    """

    def __init__(self, archive: Archive, steppers: Sequence[type] = ()) -> None:
        self.archive = archive
        header = archive.header
        for what, there, here in (
            ("format", header.get("format"), FORMAT),
            ("version", header.get("version"), version("taichi_rts")),
        ):
            if there != here:
                raise CheckpointError(
                    f"{archive.path} has {what} {there!r}, and this is taichi_rts {version('taichi_rts')} with {what} "
                    f"{here!r}; go on with taichi_rts {header.get('version')}, or start the run again"
                )
        try:
            self.arch, self.precision = str(header["arch"]), str(header["precision"])
            if self.arch not in backend.ARCHES or self.precision not in backend.PRECISIONS:
                raise ValueError(f"arch {self.arch}, precision {self.precision}")
            self.extra, self.runs = dict(header["extra"]), list(header["runs"])
            self.steppers = [stepper_from(run["stepper"], steppers) for run in self.runs]
            source = f"scene of {archive.path}"
            for data in (*(run["scene"] for run in self.runs), self.extra.get("scene", {})):
                moved_along(data, dict(header.get("files", {})), archive.path.parent)
                require_files_near(data, archive.path, source)
                self._require_meshes(data)
            self.scenes = [scene_from(run["scene"], source) for run in self.runs]
            self.debug = bool(self.runs[0]["debug"])
            self.time = min(float(run["time"]) for run in self.runs)
            if not 0.0 <= self.time < math.inf:
                raise ValueError(f"time {self.time} is none")
        except CheckpointError:
            raise
        except StepperError as error:
            raise CheckpointError(f"{archive.path}: {error}") from None
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise archive.error(f"has a header that cannot be used: {error}") from None

    def _require_meshes(self, data: Mapping[str, Any]) -> None:
        """Raise `CheckpointError` for a mesh that is not there any more, or has another content than it had."""
        for place, part in parts_with_files(data):
            if part.get("shape") == "mesh" and (digest := file_digest(part["file"])) != part.get("sha256", digest):
                what = changed_mesh(part["file"], part["sha256"]) if digest else f"mesh file {part['file']!r} is gone"
                raise CheckpointError(f"{self.archive.path}: {place}: {what}, or start a new run")

    def simulation(self, run: int, scene: Scene | None = None, forces: Sequence[Any] = ()) -> Simulation:
        """Build simulation number `run` in its present state; `scene`, if given, differs from its own in nothing that counts.

        `forces` are the user's own that it had.
        """
        self._require_forces(run, forces)
        sim = Simulation(scene or self.scenes[run], self.steppers[run], forces=forces, debug=self.runs[run]["debug"])
        self.restore(sim, run)
        return sim

    def restore(self, sim: Simulation, run: int = 0) -> None:
        """Put the state of number `run` into `sim`, which has the same scene and stepper; compiles almost nothing."""
        data, device = self.runs[run], backend.current()
        self._require_forces(run, sim.forces)
        if device.precision != self.precision:
            raise CheckpointError(
                f"{self.archive.path} has precision {self.precision}, and {device.precision} is in use; "
                f'call init(precision="{self.precision}")'
            )
        state = State(sim)
        with self.archive.trusted_by_nobody():
            self._restore(run, data, state)
        sim.restored()

    def _require_forces(self, run: int, forces: Sequence[Any]) -> None:
        """Raise `CheckpointError` unless a user's own `forces` are those that run number `run` had."""
        there, here = self.runs[run].get("forces", []), forces_data(forces)
        if there == here:
            return
        names = [[str(each["name"]) for each in some] for some in (there, here)]
        if names[0] != names[1]:
            said = [", ".join(some) or "none" for some in names]
            raise CheckpointError(
                f"{self.archive.path} has forces of its user's own: {said[0]}; given are {said[1]}; "
                f"give the same in the same order, load_checkpoint(..., forces=[...])"
            )
        found = "; ".join(f"{a['name']}: {differences(a, b)}" for a, b in zip(there, here, strict=True) if a != b)
        raise CheckpointError(f"{self.archive.path} has other forces: {found}; give the same values")

    def _restore(self, run: int, data: Mapping[str, Any], state: State) -> None:
        self._compare("field", set(data["fields"]), set(state.fields))
        self._compare("part", set(data["values"]), set(state.owners))
        wanted = {}  # all is read before anything is changed
        for name, field in state.fields.items():
            dtype = np.dtype(_numpy_type(field.dtype))
            wanted[name] = self.archive.array(f"{run}/{name}", dtype, (*field.shape, *_entry_shape(field)))
        present: dict[str, set[str]] = {owner: set() for owner in state.owners}
        for path, name, _value in state.values():
            present[path].add(name)
        changes: list[tuple[dict[str, Any], str, Any]] = []
        for path, owner in state.owners.items():
            for name, value in data["values"][path].items():
                key = f"{run}/{VALUE}{path}.{name}"
                if name not in owner or _encoded(owner[name], key, {}) != value or _holds_arrays(value):
                    found = self._decoded(value, key, owner.get(name))
                    if not _alike(found, owner.get(name)):
                        raise TypeError(f"{path}.{name} is {_short(found)} and should be like {_short(owner[name])}")
                    changes.append((owner, name, found))
        for name, field in state.fields.items():
            field.from_numpy(wanted[name])
        for path, owner in state.owners.items():
            for name in present[path] - set(data["values"][path]):
                del owner[name]  # hides what the class says, such as `Schedule.needs_sorting`
        for owner, name, value in changes:
            owner[name] = value

    def _compare(self, what: str, there: set[str], here: set[str]) -> None:
        if there != here:
            names = ", ".join(sorted(there ^ here)[:3])
            raise self.archive.error(f"was written by other code: {what} {names} is in one and not in the other")

    def _decoded(self, value: Any, key: str, like: Any) -> Any:
        """Return the plain value; what JSON makes a list of is a tuple where `like`, the present value, is one."""
        if _holds_arrays(value):
            array = self.archive.array(key)
            if "array" in value:
                return array
            if "number" in value:
                return array[()]
            return list(np.split(array, np.cumsum(value["lengths"])[:-1]))
        if isinstance(value, list):
            return type(like)(value) if isinstance(like, tuple) else value
        return value


def differences(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Say in which keys two plain descriptions differ, and how; of things of two names only that. Empty if they do not."""
    keys = [key for key in dict.fromkeys([*there, *here]) if there.get(key) != here.get(key)]
    keys = ["name"] if "name" in keys else keys
    return ", ".join(f"{key} {_short(there.get(key))} there and {_short(here.get(key))} here" for key in keys)


def _alike(found: Any, present: Any) -> bool:
    """Whether one may take the place of the other: of one kind, or None, and a number if that is one."""
    if found is None or present is None or isinstance(found, type(present)):
        return not isinstance(found, float) or isinstance(present, np.ndarray) or found == found
    numbers = (int, float, np.integer, np.floating)
    return isinstance(found, numbers) and isinstance(present, numbers) and found == found


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _entry_shape(field: Any) -> tuple[int, ...]:
    """Return the shape of one entry of a field: of a number, a vector or a matrix."""
    if not isinstance(field, ti.MatrixField):
        return ()
    return (field.n,) if field.m == 1 else (field.n, field.m)


def _numpy_type(dtype: Any) -> Any:
    return ti.lang.util.to_numpy_type(dtype)


def _encoded(value: Any, key: str, arrays: dict[str, np.ndarray]) -> Any:
    """Return a plain value as JSON has it; arrays go to `arrays` under `key`."""
    if isinstance(value, np.ndarray):
        arrays[key] = value
        return {"array": True}
    if isinstance(value, np.generic):
        arrays[key] = np.asarray(value)
        return {"number": True}
    if isinstance(value, list) and value and all(isinstance(each, np.ndarray) and each.ndim == 1 for each in value):
        arrays[key] = np.concatenate(value)
        return {"lengths": [len(each) for each in value]}
    if isinstance(value, (list, tuple)):
        if any(isinstance(each, (np.ndarray, np.generic, dict)) for each in value):
            raise Error(f"{key} is a list of what no checkpoint can hold; make it an array")
        return [_encoded(each, key, arrays) for each in value]
    if isinstance(value, dict):
        raise Error(f"{key} is a dictionary, which no checkpoint can hold; make it a list or an array")
    return value


def _holds_arrays(value: Any) -> bool:
    return isinstance(value, dict)
