"""What `--help` says of options that need not be given: their text says what happens without them."""

from __future__ import annotations

import dataclasses
import types
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import tyro

T = TypeVar("T")
POSITIONAL = get_args(tyro.conf.Positional[int])[1]


def quiet(options: type[T]) -> type[T]:
    """Return the dataclass `options`, whose help does not mention None; nor does that of the dataclasses in it."""
    hints = get_type_hints(options, include_extras=True)
    for field in dataclasses.fields(options):  # type: ignore[arg-type]
        hint = hints[field.name]
        plain = get_args(hint)[0] if get_origin(hint) is Annotated else hint
        if dataclasses.is_dataclass(plain):
            quiet(plain)  # type: ignore[arg-type]
        elif field.default is None:
            positional = any(each is POSITIONAL for each in get_args(hint))
            name = f"[{field.name.upper()}]" if positional else metavar(plain)
            said = tyro.conf.arg(metavar=name, help_behavior_hint="")
            options.__annotations__[field.name] = Annotated[hint, said]
        elif field.default == ():
            options.__annotations__[field.name] = Annotated[hint, tyro.conf.arg(help_behavior_hint="")]
    return options


def metavar(hint: Any) -> str:
    """Say what may be given for an optional value of type `hint`, as tyro does, but for None."""
    parts = []
    for each in get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,):
        if get_origin(each) is Literal:
            parts.append("{" + ",".join(map(str, get_args(each))) + "}")
        elif each is bool:
            parts.append("{True,False}")
        elif each is not type(None):
            parts.append(getattr(each, "__name__", str(each)).upper())
    return "|".join(parts)
