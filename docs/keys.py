"""Write docs/scene_keys.md, all keys of scene files, from the JSON Schema (`python docs/keys.py`)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import taichi_rts as rts

PAGE = Path(__file__).parent / "scene_keys.md"
HEAD = """# Every key of a scene file

Written by `python docs/keys.py` from the schema that `taichi-rts scenes --schema` prints. Units are SI and degrees,
`dim` is 2 or 3, the number of components of a vector; *null* (None) is a key that is left out. How to write such a
file: [scene_files.md](scene_files.md).
"""


def kind(schema: dict[str, Any]) -> str:
    """Say in a few words what values a key takes."""
    for several in ("anyOf", "oneOf"):
        if several in schema:
            return " or ".join(dict.fromkeys(kind(each) for each in schema[several] if each.get("type") != "null"))
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "enum" in schema:
        return ", ".join(f'"{word}"' for word in schema["enum"])
    if "const" in schema:
        return f'"{schema["const"]}"'
    if schema.get("type") == "array":
        return f"list of ({kind(schema['items'])})" if schema["items"].get("type") != "number" else "numbers"
    least = " > 0" if "exclusiveMinimum" in schema or schema.get("gt") == 0 else " ≥ 0" if schema.get("ge") == 0 else ""
    return {"number": "number", "boolean": "true or false", "string": "text"}.get(
        schema.get("type", ""), "array"
    ) + least


def table(part: dict[str, Any], required: set[str]) -> list[str]:
    """Return the rows of one object."""
    rows = ["| key | value | default | |", "|---|---|---|---|"]
    for name, each in part["properties"].items():
        default = (
            "needed" if name in required else f"`{json.dumps(each.get('default', {}))}`".replace("`null`", "*null*")
        )
        rows.append(f"| `{name}` | {kind(each)} | {default} | {each['description'].replace('|', chr(92) + '|')} |")
    return rows


def page() -> str:
    """Return the page."""
    schema = rts.scene_schema()
    lines = [HEAD]
    for name, part in {"Scene": schema, **schema["$defs"]}.items():
        lines += [f"## {name}", "", part["description"].partition("\n\n")[0].replace("\n", " "), ""]
        lines += [*table(part, set(part.get("required", ()))), ""]
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
