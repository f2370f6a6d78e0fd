"""Build the API reference from docstrings into build/api (`make api`); needs the extra `docs`."""

import argparse
import dataclasses
import inspect
import logging
import os
import sys
import typing
from pathlib import Path

os.environ.setdefault("TI_LOG_LEVEL", "error")
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "False")

import pdoc
import pdoc.render

import taichi_rts as rts
from taichi_rts.compare import Settings
from taichi_rts.rendering.painter import PictureOptions

MODULES = (
    "taichi_rts",
    "taichi_rts.rendering.painter",
    "taichi_rts.compare",
    "taichi_rts.readings.diagnosis",
    "taichi_rts.errors",
)
"""What the docs tell people to import; of a module with `__all__` only what that names."""


def show_plain_types(cls: type) -> None:
    """Let a dataclass be documented with its parameters' types, without the checks that pydantic makes of them."""
    hints = typing.get_type_hints(cls)  # which leaves out what Annotated says besides
    cls.__annotations__ = {name: hints[name] for name in cls.__annotations__}
    given = [
        each.replace(annotation=hints.get(each.name, each.annotation))
        for each in inspect.signature(cls).parameters.values()
    ]
    itself = inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY)
    vars(cls.__init__).pop("__wrapped__", None)  # type: ignore[misc]  # pdoc would go back to pydantic's own
    cls.__init__.__signature__ = inspect.Signature([itself, *given])  # type: ignore[misc]


def name_plain_types() -> None:
    """Let methods whose types are names, such as `Vector`, be documented without those checks as well."""
    for module in [module for name, module in sys.modules.items() if name.partition(".")[0] == "taichi_rts"]:
        for name, kind in list(vars(module).items()):
            if typing.get_origin(kind) is typing.Annotated:
                holder = type("Holder", (), {"__annotations__": {"kind": kind}})
                setattr(module, name, typing.get_type_hints(holder)["kind"])


def build(folder: Path) -> None:
    """Write one page for each of `MODULES`, an index and a search."""
    for cls in {PictureOptions, Settings, *(getattr(rts, name) for name in rts.__all__)}:
        if dataclasses.is_dataclass(cls) and isinstance(cls, type):
            show_plain_types(cls)
    name_plain_types()
    pdoc.render.configure(docformat="google", footer_text=f"taichi_rts {rts.__version__}", show_source=True)
    pdoc.pdoc(*MODULES, output_directory=folder)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("build/api"), help="by default build/api")
    logging.disable(logging.INFO)
    target = parser.parse_args().folder
    build(target)
    print(f"API reference in {target}/index.html")
