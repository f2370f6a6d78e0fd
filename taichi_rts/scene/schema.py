"""JSON Schemas of descriptions: for editors, and to know which keys may stand where."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Any

import pydantic

DIALECT = "https://json-schema.org/draft/2020-12/schema"
TAGGED = {
    "<block>": ("Block",),
    "<sphere>": ("Sphere", "SphereObstacle"),
    "<particles>": ("Particles",),
    "<box>": ("BoxObstacle",),
    "<cylinder>": ("CylinderObstacle",),
    "<polygon>": ("PolygonObstacle",),
    "<mesh>": ("MeshObstacle",),
    "<constant>": ("ConstantMotion",),
    "<keyframes>": ("Keyframes",),
    "<linear>": ("LinearField",),
    "<vortices>": ("TaylorGreen",),
    "<wave>": ("StandingWave",),
    "<rule>": ("RegionalSound",),
}
"""Members of unions by the tags that our discriminators give them, which a schema does not have."""


@functools.cache
def schema_of(kind: type) -> dict[str, Any]:
    """Return the JSON Schema of a pydantic dataclass."""
    return {"$schema": DIALECT, **pydantic.TypeAdapter(kind).json_schema()}


def keys_at(kind: type, place: Sequence[str | int]) -> list[str]:
    """Names of the keys that the part of a `kind` at `place`, the path of an error, may have; the kind's if that is unknown."""
    schema = schema_of(kind)
    node: dict[str, Any] = schema
    for step in place:
        for branch in _branches(schema, node):
            if isinstance(step, int) and "items" in branch:
                node = branch["items"]
                break
            if step in TAGGED and branch.get("title") in TAGGED[str(step)]:
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
