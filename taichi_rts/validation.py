"""Turns pydantic's findings into one readable message that names every value, limit and remedy."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Callable, Iterable
from typing import Annotated, Any, TypeVar

import pydantic
from annotated_types import Len
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticKnownError

from taichi_rts.errors import Error

FROZEN = ConfigDict(extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=False)
LARGEST = 1e12
"""Largest magnitude of a number in a scene or a stepper, in SI units: the square of a larger one soon leaves single precision."""
LEAST = 1e-12
"""Least value of a number that has to be above 0."""
MOST_SHOWN = 100  # characters of a value that a message repeats
T = TypeVar("T", bound=type)


def _require_number(value: Any) -> Any:
    if isinstance(value, (bool, str)):  # which pydantic would take for 1 and for what the text says
        raise PydanticKnownError("float_type")
    return value


def _require_bounded(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(f"{value:g} is beyond {LARGEST:g}; give a smaller number, in SI units")
    return value


def _require_sizeable(value: float) -> float:
    if value < LEAST:
        raise ValueError(f"{value:g} is below {LEAST:g}; give a larger number, in SI units")
    return value


Number = Annotated[float, BeforeValidator(_require_number), AfterValidator(_require_bounded)]
Vector = Annotated[tuple[Number, ...], Len(2, 3)]
Positive = Annotated[Number, Field(gt=0), AfterValidator(_require_sizeable)]
NotNegative = Annotated[Number, Field(ge=0)]


def describe(error: pydantic.ValidationError, subject: str, names: Iterable[str] = ()) -> str:
    """List all findings of `error`, one a line: path, what is wrong, the value given, a near name for an unknown key.

    Tags in angle brackets, which pydantic puts into the path to say which member of a union it took, are left out.
    """
    lines = []
    fields = list(names)
    known = sorted(set(fields))
    items = error.errors(include_url=False)
    for item in items:
        if item["type"] == "too_short" and any(_lies_within(other["loc"], item["loc"]) for other in items):
            continue  # only because a component is invalid, which is said already
        parts = [part for part in item["loc"] if part != "__root__" and not str(part).startswith("<")]
        if parts and isinstance(parts[0], int) and parts[0] < len(fields):
            parts[0] = fields[parts[0]]  # an argument that was given by its position
        path = ".".join(str(part) for part in parts)
        message = item["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
        if item["type"] in ("unexpected_keyword_argument", "extra_forbidden"):
            near = difflib.get_close_matches(str(item["loc"][-1]), known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            message = f"unknown key{hint} (known: {', '.join(known)})"
        elif item["type"] in ("missing", "missing_argument"):
            message = "missing; give it a value"
        elif item["type"] not in ("value_error", "assertion_error"):
            given = repr(item["input"])
            message = f"{message} (got {given if len(given) <= MOST_SHOWN else given[: MOST_SHOWN - 3] + '...'})"
        lines.append(f"{path}: {message}" if path else message)
    return f"{subject}: " + "\n  ".join(lines)


def _lies_within(inner: tuple[Any, ...], outer: tuple[Any, ...]) -> bool:
    return len(inner) > len(outer) and inner[: len(outer)] == outer


def validated(error_type: type[Error]) -> Callable[[T], T]:
    """Class decorator for pydantic dataclasses: construction raises `error_type` instead of pydantic's error."""

    def decorate(cls: T) -> T:
        construct = cls.__init__  # type: ignore[misc]
        fields = cls.__dataclass_fields__  # type: ignore[attr-defined]

        @functools.wraps(construct)
        def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
            try:
                construct(self, *args, **kwargs)
            except pydantic.ValidationError as error:
                raise error_type(describe(error, cls.__name__, fields)) from None

        cls.__init__ = __init__  # type: ignore[misc]
        return cls

    return decorate
