"""Which checkpoint a run goes on from, and whether it is this run's."""

from __future__ import annotations

import contextlib
import json
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from taichi_rts.errors import CheckpointError, SceneError
from taichi_rts.files.archive import open_archive
from taichi_rts.output.checkpoint import Checkpoint, differences
from taichi_rts.output.options import given, replaced
from taichi_rts.output.panels import Panel
from taichi_rts.scene.files.reading import parts_with_files
from taichi_rts.scene.loading import scene_from
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.stepping.steppers import stepper_data

FOLDER = "checkpoints"
SCENE_OPTIONS = {"scene", "spacing", "particles", "sound_speed"}
FOR_THIS_COMMAND = {"resume", "overwrite", "output_dir", "gui", "strict"}
"""Options that a run that goes on does not take over from the one that wrote the checkpoint."""


def checkpoint_name(time: float) -> str:
    """Name of the checkpoint of `time` [s]; names sort by time."""
    return f"{time:016.9f}.npz"


@contextlib.contextmanager
def open_checkpoint(path: Path) -> Iterator[Checkpoint]:
    """Open a checkpoint, or the newest whole one of an output folder; raises `CheckpointError`."""
    with contextlib.ExitStack() as stack:
        yield Checkpoint(stack.enter_context(open_archive(newest(path) if path.is_dir() else path)))


def newest(folder: Path) -> Path:
    """Return the newest whole checkpoint of a run's folder; warns of those that are not. Raises `CheckpointError`."""
    found = sorted((folder / FOLDER).glob("*.npz"), reverse=True)
    for path in found:
        try:
            with open_archive(path):
                return path
        except CheckpointError as error:
            warnings.warn(str(error), stacklevel=2)
    raise CheckpointError(
        f"{folder / FOLDER} holds no whole checkpoint; start the run again, with --checkpoint-every to have some"
    )


def has_checkpoints(folder: Path) -> bool:
    """Whether a run's folder holds any."""
    return any((folder / FOLDER).glob("*.npz"))


def output_folder(path: Path) -> Path | None:
    """Return the folder of the run that wrote `path` (a checkpoint, or that folder itself), if it lies where runs put it."""
    if path.is_dir():
        return path
    return path.absolute().parent.parent if path.absolute().parent.name == FOLDER else None


def finished_until(folder: Path) -> float:
    """Return the time [s] at which the run in `folder` ended, or -1 if it did not."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        return float(json.loads((folder / "run.json").read_text())["end_time"])
    return -1.0


def resumed_scene(checkpoint: Checkpoint, given: Scene | None, end_time: float | None) -> Scene:
    """Return the scene to go on with: the checkpoint's, to another `end_time` [s] if there is one.

    Raises `CheckpointError` if the scene that was `given` is another, and names what differs.
    """
    path = checkpoint.archive.path
    kept = checkpoint.extra.get("scene")
    scene = scene_from(kept, f"scene of {path}") if kept else checkpoint.scenes[0]
    if given is not None:
        end_time = end_time or given.end_time
        if found := scene_differences(scene, given.replace(end_time=scene.end_time)):
            raise CheckpointError(f"{path} is of another scene: {found}; leave it out, or start a new run")
    if end_time is not None and end_time != scene.end_time:
        if any(inflow.stop is None for inflow in scene.inflows):
            raise CheckpointError(
                f"{path} is of a scene whose inflows stop at its end time, {scene.end_time:g} s; leave out --end-time"
            )
        try:
            scene = scene.replace(end_time=end_time)
        except SceneError as error:
            raise CheckpointError(f"--end-time: {error}") from None
    return scene


def scene_differences(there: Scene, here: Scene) -> str:
    """Say in what two scenes differ, as `differences` does; files are the same if their content is, wherever they lie."""
    found = []
    for data in (there.to_dict(), here.to_dict()):
        for _, part in parts_with_files(data):
            if part.get("sha256"):
                part["file"] = f"{Path(part['file']).name} of sha256 {part['sha256'][:12]}"
        found.append(data)
    for (place, one), (other_place, other) in zip(*map(parts_with_files, found), strict=False):
        if place == other_place and one.get("sha256") != other.get("sha256"):
            return f"{place}.file {one['file']} there and {other['file']} here"
    return differences(*found)


def require_same(checkpoint: Checkpoint, steppers: Sequence[Any], settings: dict[str, tuple[Any, Any]]) -> None:
    """Raise `CheckpointError` unless the checkpoint has these steppers, and each setting the same value there and here."""
    path = checkpoint.archive.path
    there, here = ([stepper_data(each) for each in some] for some in (checkpoint.steppers, steppers))
    if len(there) != len(here):
        raise CheckpointError(f"{path} has {len(there)} runs and --panels asks for {len(here)}; leave it out")
    for one, other in zip(there, here, strict=True):
        if found := differences(one, other):
            raise CheckpointError(f"{path} is of another stepper: {found}; leave it out, or start a new run")
    if found := differences(*({key: pair[n] for key, pair in settings.items()} for n in (0, 1))):
        raise CheckpointError(f"{path} is of another run: {found}; leave it out, or start a new run")


def command_data(options: Any) -> dict[str, Any]:
    """Return what a checkpoint keeps of the command that made the run."""
    return {key: value for key, value in given(options).items() if key not in FOR_THIS_COMMAND}


def continued(options: Any, path: Path, checkpoint: Checkpoint) -> tuple[Any, Scene, list[Panel]]:
    """Return the options of the run that goes on from the `checkpoint` at `path`, its scene and its panels.

    All is as it was, except for what `options` (of `taichi-rts run`) give and what does not count for the steps. Raises
    `CheckpointError` for what does, if it differs.
    """
    said = given(options)
    kept = checkpoint.extra.get("command", {})
    before = replaced(
        type(options)(), {key: tuple(value) if isinstance(value, list) else value for key, value in kept.items()}
    )
    run = replaced(before, said)
    scene = resumed_scene(checkpoint, run.scene.load() if SCENE_OPTIONS & set(said) else None, options.scene.end_time)
    panels = run.make_panels(scene.name, run.stepping.make())
    if "command" not in checkpoint.extra and not (run.stepping.stepper or run.panels or run.stepping.parameters()):
        panels = [Panel("", checkpoint.steppers[0])]  # a script saved it
    settings = {
        "precision": (checkpoint.precision, options.precision or checkpoint.precision),
        "debug": (checkpoint.debug, options.debug or checkpoint.debug),
        "export_fps": (before.files.export_fps if kept else run.files.export_fps, run.files.export_fps),
    }
    require_same(checkpoint, list(dict.fromkeys(panel.stepper for panel in panels)), settings)
    own = {"precision": checkpoint.precision, "debug": checkpoint.debug}
    own |= {"arch": checkpoint.arch} if options.arch == "auto" else {}
    own["output_dir"] = options.files.output_dir or output_folder(path)
    return replaced(run, own), scene, panels
