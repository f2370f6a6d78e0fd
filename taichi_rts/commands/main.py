"""The command line: `taichi-rts run|compare|stability|bench|side-by-side|plot|scenes|info`."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import tyro

import taichi_rts as rts
from taichi_rts import importing
from taichi_rts.benchmarks.command import Bench
from taichi_rts.commands import report
from taichi_rts.commands.help import quiet
from taichi_rts.commands.options import StepperOptions
from taichi_rts.commands.plain_text import use_plain_text
from taichi_rts.commands.plot import Plot
from taichi_rts.commands.run import Run
from taichi_rts.commands.scene_copies import copy_scene, example_names
from taichi_rts.compare.command import Compare
from taichi_rts.device import backend
from taichi_rts.errors import Error
from taichi_rts.output.options import replaced
from taichi_rts.output.side_by_side import SideBySide
from taichi_rts.stability.command import Stability
from taichi_rts.terminal import execute


@dataclasses.dataclass(frozen=True)
class Scenes:
    """List the built-in scenes, or copy one's file to change it."""

    copy: str | None = None
    """Write the file of this scene, or of an example, into the present folder; nothing is replaced."""
    schema: bool = False
    """Print the JSON Schema of scene files instead, for editors (docs/scene_files.md)."""

    def __call__(self) -> None:
        """List them."""
        if self.schema:
            print(json.dumps(rts.scene_schema(), indent=2))
            return
        if self.copy is not None:
            print(", ".join(path.name for path in copy_scene(self.copy, Path())))
            return
        report.print_scenes([rts.load_scene(name) for name in rts.scene_names()])
        print(f"Commented examples: {', '.join(example_names())}. To change one: taichi-rts scenes --copy NAME")


@dataclasses.dataclass(frozen=True)
class Info:
    """Say what is installed and which arches can be used here."""

    def __call__(self) -> None:
        """Say it."""
        report.print_info(backend.available())


for each in (Run, Compare, Stability, Bench, SideBySide, Plot, Scenes):
    quiet(each)

Command = (
    Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Compare, tyro.conf.subcommand("compare")]
    | Annotated[Stability, tyro.conf.subcommand("stability")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[SideBySide, tyro.conf.subcommand("side-by-side")]
    | Annotated[Plot, tyro.conf.subcommand("plot")]
    | Annotated[Scenes, tyro.conf.subcommand("scenes")]
    | Annotated[Info, tyro.conf.subcommand("info")]
)


def main(args: list[str] | None = None) -> None:
    """Entry point of `taichi-rts`."""
    with _program():
        execute(tyro.cli(Command, prog="taichi-rts", description=rts.__doc__, args=args))  # type: ignore[arg-type]


def run_demo(scene: str, **defaults: Any) -> None:
    """Run a demo: `taichi-rts run SCENE` with other defaults; takes the same options."""
    with _program():
        execute(parse_demo(replaced(Run(), {"scene": scene, "output_dir": Path("out") / scene} | defaults)))


def parse_demo(default: Run, args: list[str] | None = None) -> Run:
    """Parse a demo's command line: its own settings of a stepper apply to that one only, not to others or to panels."""
    run = tyro.cli(Run, default=default, args=args)
    if run.stepping.stepper != default.stepping.stepper or run.panels != default.panels:
        run = tyro.cli(Run, default=dataclasses.replace(default, stepping=StepperOptions()), args=args)
    return run


@contextlib.contextmanager
def _program() -> Iterator[None]:
    """What is said, and with which exit code, when the package runs as a program."""
    use_plain_text()
    try:
        importing.done()
        yield
    except Error as error:
        print(f"taichi-rts: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt as stop:
        said = str(stop) or "interrupted; what is written already is whole"
        print(f"taichi-rts: {said}", file=sys.stderr)
        raise SystemExit(getattr(stop, "exit_code", 130)) from None
