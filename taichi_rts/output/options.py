"""Options of a command by name, as a checkpoint and a demo give them, whatever groups the command has them in."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any


def flat(options: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, value and default of every option of a command, a frozen dataclass whose groups are dataclasses too."""
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if dataclasses.is_dataclass(value):
            yield from flat(value)
        else:
            yield field.name, value, field.default


def given(options: Any) -> dict[str, Any]:
    """Return the options that are not at their defaults."""
    return {name: value for name, value, default in flat(options) if value != default}


def replaced(options: Any, changes: dict[str, Any]) -> Any:
    """Return the same options with some changed, each in its group."""
    found = {}
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if dataclasses.is_dataclass(value):
            found[field.name] = replaced(value, changes)
        elif field.name in changes:
            found[field.name] = changes[field.name]
    return dataclasses.replace(options, **found)
