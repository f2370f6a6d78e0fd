"""The one list of steppers. Command line, comparisons, the stability map, the window and conformance tests take it from here."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from taichi_rts.errors import StepperError, did_you_mean
from taichi_rts.solver.stepping.asynchronous import Asynchronous
from taichi_rts.solver.stepping.base import Setup, Stepper
from taichi_rts.solver.stepping.regional import Regional
from taichi_rts.solver.stepping.uniform import Uniform

STEPPERS: dict[str, Any] = {kind.name: kind for kind in (Uniform, Regional, Asynchronous)}
PACKAGES_OWN = tuple(STEPPERS)
Kind = TypeVar("Kind", bound=type[Stepper])

if TYPE_CHECKING:
    StepperName = str
else:
    StepperName = Literal[PACKAGES_OWN]
    """Names of the package's own steppers, for the command line."""


def register_stepper(kind: Kind) -> Kind:
    """Class decorator: let `kind`, a stepper of your own, be known by its name, to checkpoints and comparisons.

    Raises `StepperError` if it is no stepper or has the name of one of the package's own. A class that is defined again, as in a
    notebook, takes the place of the one before.
    """
    require_kind(kind)
    STEPPERS[kind.name] = kind
    return kind


def require_kind(kind: Any) -> None:
    """Raise `StepperError` unless `kind` is a class that may be a user's own stepper."""
    if not (isinstance(kind, type) and issubclass(kind, Stepper)):
        raise StepperError(f"{kind!r} is no class derived from taichi_rts.Stepper; give the class, not an object of it")
    if not dataclasses.is_dataclass(kind):
        raise StepperError(f"{kind.__name__} is no dataclass; write @dataclass(frozen=True) above it")
    name = getattr(kind, "name", None)
    if not isinstance(name, str) or not name:
        raise StepperError(f"{kind.__name__} has no name; give it a class attribute, name = 'own'")
    if name in PACKAGES_OWN and kind is not STEPPERS[name]:
        raise StepperError(f"{kind.__name__} has the name {name!r} of {STEPPERS[name].__name__}; give it another one")


def as_stepper(stepper: Stepper | str | None) -> Stepper:
    """Return the stepper that is meant: itself, by its name one with its defaults, or `Regional()` for None.

    Raises `StepperError` for anything else, and for a name that no stepper has.
    """
    if stepper is None:
        return Regional()
    if isinstance(stepper, str):
        if stepper not in STEPPERS:
            hint = did_you_mean(stepper, STEPPERS)
            raise StepperError(f"stepper {stepper!r} is none of {', '.join(STEPPERS)}{hint}")
        stepper = STEPPERS[stepper]()
    if isinstance(stepper, type):
        raise StepperError(f"stepper {stepper.__name__} is a class; give an object of it, {stepper.__name__}()")
    if not callable(getattr(stepper, "schedule", None)):
        raise StepperError(
            f"stepper {stepper!r} is none; give e.g. rts.Regional(), or one of {', '.join(STEPPERS)} by name"
        )
    return stepper  # type: ignore[return-value]  # any object that has a schedule, as comparisons and tests have


def setups(what: str) -> dict[str, tuple[Any, Setup]]:
    """Return class and setup of all that is "compared" or "mapped", by name: first those with one sound speed."""
    found = [(kind, setup) for kind in STEPPERS.values() for setup in getattr(kind, what) or (Setup(kind.name),)]
    found.sort(key=lambda pair: pair[1].regional_sound)
    return {setup.name: (kind, setup) for kind, setup in found}


def stepper_data(stepper: Any) -> dict[str, Any]:
    """Return a stepper as plain data: its name and every parameter."""
    return {"name": stepper.name, **dataclasses.asdict(stepper)}


def stepper_from(data: Mapping[str, Any], others: Iterable[Any] = ()) -> Any:
    """Build the stepper that `stepper_data` described, of a class that is registered or one of `others`.

    Raises `StepperError` for a name that none has, and for parameters that are not valid.
    """
    others = list(others)
    for kind in others:
        require_kind(kind)
    known = {**STEPPERS, **{kind.name: kind for kind in others}}
    if data["name"] not in known:
        raise StepperError(
            f"stepper {data['name']!r} is none of {', '.join(known)}; define its class and write @rts.register_stepper "
            f"above it, or give the class itself: load_checkpoint(..., steppers=[...])"
        )
    return known[data["name"]](**{key: value for key, value in data.items() if key != "name"})
