"""JSON Schemas of descriptions: for editors, and to know which keys may stand where."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any, Union

import pydantic
from pydantic import Discriminator, Tag

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def one_of(kinds: Sequence[type], kind_of: Callable[[Any], type | None], **unknown: Any) -> Any:
    """Return the type of a value of one of `kinds`, which `kind_of` says of data or objects; None: of none, as `unknown` says.

    So a mistake in one kind is not reported for the others as well. Paths of errors have the kind's name in angle brackets,
    by which `keys_at` finds it in a schema and which `validation.describe` leaves out.
    """

    def tag(data: Any) -> str | None:
        kind = kind_of(data)
        return None if kind is None else f"<{kind.__name__}>"

    members = tuple(Annotated[kind, Tag(f"<{kind.__name__}>")] for kind in kinds)  # type: ignore[valid-type]
    return Annotated[Union[members], Discriminator(tag, **unknown)]  # noqa: UP007


@functools.cache
def schema_of(kind: type) -> dict[str, Any]:
    """Return the JSON Schema of a pydantic dataclass; keys are described by `Attributes` of the docstrings."""
    schema = pydantic.TypeAdapter(kind).json_schema()
    for part in (schema, *schema.get("$defs", {}).values()):
        _describe(part)
    return {"$schema": DIALECT, **schema}


def _describe(part: dict[str, Any]) -> None:
    """Move what the description of an object, a docstring, says of its keys to those."""
    about, found, rest = part.get("description", "").partition("\nAttributes:\n")
    if not found:
        return
    section, _, after = rest.partition("\n\n")
    part["description"] = "\n\n".join(text.strip() for text in (about, after) if text.strip())
    for entry in re.split(r"\n(?= {4}\S)", "\n" + section)[1:]:
        names, _, text = entry.strip().partition(": ")
        for name in names.split(", "):
            if name in part["properties"]:
                part["properties"][name]["description"] = " ".join(text.split())


def keys_at(kind: type, place: Sequence[str | int]) -> list[str]:
    """Names of the keys that the part of a `kind` at `place`, the path of an error, may have; the kind's if that is unknown."""
    schema = schema_of(kind)
    node: dict[str, Any] = schema
    for step in place:
        for branch in _branches(schema, node):
            if isinstance(step, int) and "items" in branch:
                node = branch["items"]
                break
            if step == f"<{branch.get('title')}>":
                node = branch
                break
            if step in branch.get("properties", {}):
                node = branch["properties"][step]
                break
        else:
            return sorted(schema["properties"])
    return sorted({key for branch in _branches(schema, node) for key in branch.get("properties", {})})


def _branches(schema: dict[str, Any], node: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield `node`, with references followed, or what it is one of."""
    if "$ref" in node:
        node = schema["$defs"][node["$ref"].rpartition("/")[2]]
    members = [*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())]
    if not members:
        yield node
    for member in members:
        yield from _branches(schema, member)
