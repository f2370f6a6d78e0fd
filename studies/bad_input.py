"""Tries all bad input of tests/reliability and writes what each is answered: python studies/bad_input.py [PAGE].

The page is build/bad_input.md unless another is named. Rows of checkpoints are only run by their test: it needs a run to spoil.
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

PAGE = Path(__file__).parents[1] / "build" / "bad_input.md"


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


def write_tables():
    """Print all tables; returns whether any case failed."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "bad"
        folder.mkdir()
        fill(folder)
        counts = []
        print("# Bad input\n\nWhat each mistake is answered (docs/evidence/reliability.md says what is promised).")
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
    return any(failed for _title, _tried, failed in counts)


def main(page):
    def never(*_args, **_options):
        raise AssertionError("a run has begun")

    recorder.Simulation = never
    page.parent.mkdir(parents=True, exist_ok=True)
    with page.open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file):
        failed = write_tables()
    print(f"{page}: {'some cases FAILED' if failed else 'all cases as promised'}")
    raise SystemExit(failed)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PAGE)
