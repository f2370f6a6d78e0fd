"""`--set KEY=VALUE,VALUE`: which parameter of which stepper, or of the scene, takes which values."""

from __future__ import annotations

import dataclasses
import difflib
import itertools
import json
from collections.abc import Sequence
from typing import Any

from taichi_rts.errors import Error, SceneError, StepperError
from taichi_rts.scene.scene import Scene
from taichi_rts.solver.stepping.steppers import setups

ONE_SOUND_SPEED = tuple(name for name, (_kind, setup) in setups("compared").items() if not setup.regional_sound)
"""Those of `kinds` that are compared by default."""
FIXED = {"courant": "--courants", "preset": "--steppers paper", "end_time": "--end-time"}
"""Parameters that are no sweep, and the option to use instead."""
SHAPE = ("domain", "fluids", "probes", "gauges", "view", "name", "description")
"""Fields that define which scene it is, or change no motion."""


def kinds() -> dict[str, Any]:
    """Classes of all steppers that can be compared, by the name on the command line (`Stepper.compared`).

    `paper` is `Regional(preset="paper")`, and those that end in "-c" run with the regional sound speed, `uniform-c` with one
    adaptive step for all.
    """
    return {name: kind for name, (kind, _setup) in setups("compared").items()}


def parameters(kind: Any) -> set[str]:
    """Names of the parameters of a stepper's class, or of the scene's."""
    return {field.name for field in dataclasses.fields(kind)}


@dataclasses.dataclass(frozen=True)
class Sweep:
    """Values of one parameter; `target` is a stepper's name, "scene", or None for wherever the key is known."""

    target: str | None
    key: str
    values: tuple[Any, ...]


def parse_sweep(text: str) -> Sweep:
    """Read "KEY=VALUE,VALUE" or "TARGET.KEY=VALUE,VALUE"; raises `Error` for what is not one or an unknown name."""
    name, equals, values = text.partition("=")
    if not equals or not name.strip() or not values.strip():
        raise Error(
            f"--set {text!r} is not KEY=VALUE,VALUE; write e.g. --set levels=2,3 or --set regional.alpha=0.2,0.4"
        )
    target, dot, key = name.strip().rpartition(".")
    targets = (*kinds(), "scene")
    if dot and target not in targets:
        raise Error(f"--set {text!r}: {target!r} is {_unknown(target, targets)}")
    key = key.replace("-", "_")
    if key in FIXED:
        raise Error(f"--set {text!r}: {key} is not set but has an option of its own; use {FIXED[key]}")
    known = known_keys(target) if dot else sorted({key for name in targets for key in known_keys(name)})
    if key not in known:
        raise Error(f"--set {text!r}: {key!r} is {_unknown(key, known)}")
    found: list[Any] = []
    for each in map(parse_scalar, split_values(values)):
        if not any(each == other and type(each) is type(other) for other in found):
            found.append(each)
    return Sweep(target if dot else None, key, tuple(found))


def known_keys(target: str) -> list[str]:
    """Parameters of a stepper, or of the scene, that can be swept."""
    kind = Scene if target == "scene" else kinds()[target]
    return sorted(parameters(kind) - {*FIXED, *SHAPE})


def split_values(text: str) -> list[str]:
    """Split at commas outside brackets, so that a vector such as [0, -9.81] stays whole."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter == "[") - (letter == "]")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def parse_scalar(text: str) -> Any:
    """Read true, false, none, a number, a [vector] or, failing that, a string; raises `Error` for nothing at all."""
    words = {"true": True, "false": False, "none": None}
    if not text:
        raise Error("--set has an empty value between two commas; leave out the comma, or write none")
    if text.lower() in words:
        return words[text.lower()]
    for read in (int, float, json.loads):
        try:
            return read(text)  # type: ignore[operator]
        except ValueError:
            continue
    return text.strip("\"'")


def for_stepper(sweeps: Sequence[Sweep], name: str) -> list[dict[str, Any]]:
    """All combinations of the parameters that `sweeps` give the stepper `name`; one empty one if there are none."""
    known = parameters(kinds()[name])
    return _combine([s for s in sweeps if s.target == name or (s.target is None and s.key in known)])


def for_scene(sweeps: Sequence[Sweep], steppers: Sequence[str]) -> list[dict[str, Any]]:
    """All combinations of the scene's parameters: those named so, and those that no chosen stepper has."""
    taken = {key for name in steppers for key in parameters(kinds()[name])}
    return _combine([s for s in sweeps if s.target == "scene" or (s.target is None and s.key not in taken)])


def check(sweeps: Sequence[Sweep], steppers: Sequence[str]) -> None:
    """Raise `Error` for a sweep that would change nothing, its stepper not being compared, or that comes twice."""
    seen: set[tuple[str | None, str]] = set()
    for sweep in sweeps:
        if (sweep.target, sweep.key) in seen:
            raise Error(f"--set {sweep.key} comes twice; give all its values in one")
        seen.add((sweep.target, sweep.key))
        if sweep.target is None:
            idle = not any(sweep.key in parameters(kinds()[name]) for name in steppers)
            idle = idle and sweep.key not in known_keys("scene")
        else:
            idle = sweep.target not in (*steppers, "scene")
        if idle:
            raise Error(
                f"--set {sweep.key} belongs to no stepper that is compared ({', '.join(steppers)}); add one to --steppers"
            )


def make_stepper(name: str, courant: float, options: dict[str, Any]) -> Any:
    """Build the stepper `name` for the sweep's number `courant`; raises `StepperError` for values that do not fit.

    The number is the Courant number of the longest step, lambda = dt_max c_s / r, because that is what stability limits: of the
    one step of `Uniform`, of level n_max of `Regional` (so its base step has courant / n_max, unless `strict_cfl`, which
    divides by itself), and of the longest step of `Asynchronous`. Only `paper` is by its base step, as the paper means it. With
    the regional sound speed it is that of every step with its own sound speed.
    """
    kind, setup = setups("compared")[name]
    if setup.of_longest and not setup.regional_sound:
        return kind(**setup.parameters, **options).with_longest(courant)
    return kind(courant=courant, **setup.parameters, **options)


def changes_by(name: str) -> dict[str, Any]:
    """What the stepper `name` changes in the scene."""
    return {"sound_speed": "regional"} if setups("compared")[name][1].regional_sound else {}


def scenes_of(scene: Scene, changes: list[dict[str, Any]]) -> list[Scene]:
    """Return `scene` with each of `changes`; raises `SceneError` that names the --set."""
    found = []
    for change in changes:
        try:
            found.append(scene.replace(**change))
        except SceneError as error:
            raise SceneError(f"--set {describe(change)}: {error}") from None
    return found


def describe(options: dict[str, Any]) -> str:
    """Return parameters as text: `levels=3 corrector=false`."""
    words = {True: "true", False: "false", None: "none"}
    parts = []
    for key, value in options.items():
        shown = (
            words[value]
            if value is None or isinstance(value, bool)
            else f"{value:g}"
            if isinstance(value, float)
            else str(value)
        )
        parts.append(f"{key}={shown}")
    return " ".join(parts)


def choose(text: str) -> list[str]:
    """Read a list of steppers such as "uniform,paper"; raises `StepperError` for an unknown or missing one."""
    names = list(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if not names:
        raise StepperError(f"--steppers {text!r} names none; choose from {', '.join(kinds())}")
    for name in names:
        if name not in kinds():
            raise StepperError(f"--steppers: {name!r} is {_unknown(name, list(kinds()))}")
    return names


def numbers(text: str, option: str) -> list[float]:
    """Read a list of numbers above zero such as "0.2,0.4"; raises `Error`."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if not found or not all(0.0 < number <= 2.0 for number in found):
        raise Error(f"{option} {text!r} is not a list of numbers above 0 and at most 2; write e.g. 0.2,0.4,0.8")
    return sorted(set(found))


def _combine(sweeps: Sequence[Sweep]) -> list[dict[str, Any]]:
    return [
        {sweep.key: value for sweep, value in zip(sweeps, values, strict=True)}
        for values in itertools.product(*(sweep.values for sweep in sweeps))
    ]


def _unknown(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=3)
    hint = f"did you mean {' or '.join(near)}? " if near else ""
    return f"unknown; {hint}known: {', '.join(known)}"
