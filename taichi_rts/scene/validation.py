"""Turns pydantic's findings into one readable message that names every value, limit and remedy."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any, TypeVar

import pydantic
from annotated_types import Len
from PIL import ImageColor
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticKnownError

from taichi_rts.errors import Error, did_you_mean

NAME = r"^[\w()+-][\w .()+-]*$"
"""What a scene may be called: a folder of results gets its name, so it holds no separators."""

FROZEN = ConfigDict(extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=False)
LARGEST = 1e12
"""Largest magnitude of a number in a scene or a stepper, in SI units: the square of a larger one soon leaves single precision."""
LEAST = 1e-12
"""Least value of a number that has to be above 0."""
Colour = Annotated[str, AfterValidator(lambda name: _known_colour(name))]
"""A colour by its name in HTML or as "#RRGGBB"."""
MOST_SHOWN = 100  # characters of a value that a message repeats
T = TypeVar("T", bound=type)
Keys = Callable[[Sequence[str | int]], list[str]]
UNITS = {
    **{"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "s": 1.0, "ms": 1e-3, "min": 60.0, "kg": 1.0, "g": 1e-3, "t": 1e3},
    **{
        "m/s": 1.0,
        "cm/s": 1e-2,
        "mm/s": 1e-3,
        "km/h": 1 / 3.6,
        "m/s^2": 1.0,
        "cm/s^2": 1e-2,
        "m^2/s": 1.0,
        "mm^2/s": 1e-6,
    },
    **{"kg/m^3": 1.0, "g/cm^3": 1e3, "kg/l": 1e3, "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "bar": 1e5, "deg": 1.0, "°": 1.0},
}
"""Units that people write behind numbers, in SI units (angles in degrees): only to say what to write instead."""
LONG_LIST = re.compile(r"[(\[](?:[-+\w.]+|[(\[][^()\[\]]*[)\]])(?:, (?:[-+\w.]+|[(\[][^()\[\]]*[)\]])){8,}[)\]]")
"""A list of numbers, or of lists of numbers, with more than eight entries, as Python writes it."""
QUANTITY = re.compile(r"([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)\s*([^\d\s.][^\s]*)")


def _known_colour(name: str) -> str:
    try:
        ImageColor.getrgb(name)
    except ValueError:
        raise ValueError(f"{name!r} is no colour; give a name such as 'orange', or '#RRGGBB'") from None
    return name


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


def describe(error: pydantic.ValidationError, subject: str, names: Iterable[str] = (), keys: Keys | None = None) -> str:
    """List all findings of `error`, one a line: path, what is wrong, the value given, a near name for an unknown key.

    `names` are those of the description's own fields, `keys` gives those of the part at a path.
    Tags in angle brackets, which pydantic puts into the path to say which member of a union it took, are left out.
    """
    lines = []
    fields = list(names)
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
            known = sorted(fields) if keys is None else keys(item["loc"][:-1])
            hint = did_you_mean(item["loc"][-1], known)
            message = f"unknown key{hint} (known: {', '.join(known)})"
        elif item["type"] in ("missing", "missing_argument"):
            message = "missing; give it a value"
        elif item["type"] == "tuple_type" and isinstance(item["input"], dict):
            message = f"is one table; write it as a list of tables, [[{path}]]"
        elif item["type"] == "tuple_type":
            message = f"a list is needed, such as [0.0, 0.0, 1.0] (got {item['input']!r})"
        elif item["type"] == "dataclass_type" and keys is not None:
            message = f"a table with {', '.join(keys(item['loc']))} is needed (got {item['input']!r})"
        elif isinstance(item["input"], str) and (value := in_si(item["input"])) is not None:
            message = f"{item['input']!r} is a text; give a plain number in SI units, {value:.9g}"
        elif item["type"] not in ("value_error", "assertion_error"):
            given = repr(item["input"])
            message = f"{message} (got {given if len(given) <= MOST_SHOWN else given[: MOST_SHOWN - 3] + '...'})"
        message = with_short_lists(message)
        lines.append(f"{path}: {message}" if path else message)
    return f"{subject}: " + "\n  ".join(lines)


def with_short_lists(message: str) -> str:
    """Return `message` with the first three and the last entry of each long list, and how many there are."""

    def shorten(found: re.Match[str]) -> str:
        entries = re.findall(r"[-+\w.]+|[(\[][^()\[\]]*[)\]]", found[0][1:-1])
        return f"{found[0][0]}{', '.join(entries[:3])}, ..., {entries[-1]}{found[0][-1]} ({len(entries)} entries)"

    return LONG_LIST.sub(shorten, message)


def in_si(text: str) -> float | None:
    """Return what a quantity such as "20 mm" is in SI units; None for what is no number with a known unit."""
    found = QUANTITY.fullmatch(text.strip())
    factor = UNITS.get(found[2].replace("²", "^2").replace("³", "^3")) if found else None
    return float(found[1]) * factor if found and factor is not None else None


def _lies_within(inner: tuple[Any, ...], outer: tuple[Any, ...]) -> bool:
    return len(inner) > len(outer) and inner[: len(outer)] == outer


def validated(error_type: type[Error]) -> Callable[[T], T]:
    """Class decorator for pydantic dataclasses: construction raises `error_type` instead of pydantic's error."""

    def decorate(cls: T) -> T:
        construct = cls.__init__  # type: ignore[misc]
        fields = [field.name for field in dataclasses.fields(cls)]  # type: ignore[arg-type]

        @functools.wraps(construct)
        def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
            try:
                construct(self, *args, **kwargs)
            except pydantic.ValidationError as error:
                raise error_type(describe(error, cls.__name__, fields)) from None

        cls.__init__ = __init__  # type: ignore[misc]
        return cls

    return decorate
