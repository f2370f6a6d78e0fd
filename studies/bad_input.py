"""Tries all bad input of tests/reliability and prints the tables of docs/bad_input.md: python studies/bad_input.py.

Rows of checkpoints are only run by their test, which needs a run to spoil.
"""

import contextlib
import sys
import tempfile
from pathlib import Path

from tables import head, row

import taichi_rts as rts
from taichi_rts.output import recorder

sys.path.append(str(Path(__file__).parents[1] / "tests" / "reliability"))
import bad_checkpoints
from bad_commands import COMMANDS
from bad_fields import KINDS, field_rows
from bad_scenes import SCENES
from rows import RUN, prepare
from scenes import to_toml
from trial import PATIENCE, attempt, fill, without


def fields(folder):
    """Print a row for each field; returns how many cases were tried and how many of them failed."""
    tried = failed = 0
    head("field", *KINDS)
    for each in field_rows():
        cells = []
        for kind in KINDS:
            if kind not in each.scenes:
                cells.append("")
                continue
            data, valid = each.scenes[kind]
            (folder / "scene.toml").write_text(to_toml(data))
            tried += 1
            good = False
            if valid:
                with contextlib.suppress(rts.Error):
                    good = bool(rts.load_scene(folder / "scene.toml").fluids)
            else:
                good = not attempt(folder, *RUN).faults(patience=PATIENCE)
            failed += not good
            cells.append(("valid" if valid else "refused") if good else "**FAILS**")
        row(f"`{each.name}`", *cells)
    return tried, failed


def commands(folder, rows):
    """Print a row for each command; returns how many cases were tried and how many of them failed."""
    failed = 0
    head("what", "message")
    for each in rows:
        prepare(folder, each)
        with without(each.hidden):
            trial = attempt(folder, *each.args)
        failed += bool(trial.faults(each.words, PATIENCE))
        said = trial.said.removeprefix("taichi-rts: ").replace("|", "/").replace(str(folder), "FOLDER")
        said = "".join(letter for letter in said if letter.isascii() and letter.isprintable())
        said = " ".join(said.split())
        row(each.what, said if len(said) <= 220 else f"{said[:217]}...")
    return len(rows), failed


def main():
    def never(*_args, **_options):
        raise AssertionError("a run has begun")

    recorder.Simulation = never
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "bad"
        folder.mkdir()
        fill(folder)
        counts = []
        for title, do in (
            ("Fields of a scene", lambda: fields(folder)),
            ("Scene files", lambda: commands(folder, SCENES)),
            ("Command line", lambda: commands(folder, COMMANDS)),
        ):
            print(f"\n## {title}\n")
            counts.append((title, *do()))
    print("\n## Cases tried\n")
    head("table", "cases", "failed")
    for each in counts:
        row(*each)
    row("Checkpoints (tests/reliability/test_bad_checkpoints.py)", len(bad_checkpoints.ROWS) + 1, "")
    raise SystemExit(any(failed for _title, _tried, failed in counts))


if __name__ == "__main__":
    main()
