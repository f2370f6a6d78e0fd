"""Turns pydantic's findings into one readable message that names every value, limit and remedy."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import pydantic
from pydantic import ConfigDict

from taichi_rts.errors import Error

FROZEN = ConfigDict(extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=False)
T = TypeVar("T", bound=type)


def describe(error: pydantic.ValidationError, subject: str, names: Iterable[str] = ()) -> str:
    """List all findings of `error`, one a line: path, what is wrong, the value given, a near name for an unknown key."""
    lines = []
    known = sorted(names)
    for item in error.errors(include_url=False):
        path = ".".join(str(part) for part in item["loc"] if part != "__root__")
        message = item["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
        if item["type"] in ("unexpected_keyword_argument", "extra_forbidden"):
            near = difflib.get_close_matches(str(item["loc"][-1]), known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            message = f"unknown key{hint} (known: {', '.join(known)})"
        elif item["type"] in ("missing", "missing_argument"):
            message = "missing; give it a value"
        elif item["type"] not in ("value_error", "assertion_error"):
            message = f"{message} (got {item['input']!r})"
        lines.append(f"{path}: {message}" if path else message)
    return f"{subject}: " + "\n  ".join(lines)


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
