"""Output in encodings that lack Greek letters and boxes, as on Windows, under Slurm, with LC_ALL=C."""

import sys
from pathlib import Path

import pytest
from programs import run

import taichi_rts
from taichi_rts.commands.plain_text import HANDLER, plain, use_plain_text

ENCODINGS = ["cp1252", "latin-1", "ascii", "cp437", "gbk"]
C_LOCALE = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0", "PYTHONIOENCODING": None}
RUN = [
    "run",
    "dam_break_2d",
    "--spacing",
    "0.1",
    "--end-time",
    "0.2",
    "--no-frames",
    "--arch",
    "cpu",
    "--output-dir",
    "out",
]
RUN += ["--stepper", "uniform", "--export-fps", "10"]


def program(*options, folder, **changes):
    return run(sys.executable, "-m", "taichi_rts", *options, folder=folder, **changes)


def test_plain_characters():
    assert plain("ε λ Δt – 20–30 ≥ 2 m³/s², μ") == "eps lambda dt - 20-30 >= 2 m^3/s^2, u"
    assert plain("┌─┬┐│├┼┤└┴┘╭╮╰╯━┃╋╸╵█") == "+-++|++++++++++-|+-|#"
    assert plain("Größe, café, 水") == "Grosse, cafe, ?".replace("oss", "o?")
    assert plain("plain ~ stays\n") == "plain ~ stays\n"


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_whatever_the_package_says_can_be_encoded_and_is_legible(encoding):
    use_plain_text()
    sources = "".join(path.read_text(encoding="utf-8") for path in Path(taichi_rts.__file__).parent.rglob("*.py"))
    foreign = sorted({character for character in sources if not character.isascii()})
    assert len(foreign) > 15
    for character in foreign:
        text = character.encode(encoding, HANDLER).decode(encoding)
        assert text == character or (text == plain(character) and "?" not in text)


@pytest.mark.parametrize("options", [["--help"], ["run", "--help"], ["scenes"], ["run", "mäusebüro_ε"]])
def test_help_tables_and_errors_in_ascii(tmp_path, options):
    done = program(*options, folder=tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == (2 if options[0] == "run" and "--help" not in options else 0)
    assert "Traceback" not in done.stderr
    assert (done.stdout + done.stderr).isascii()
    assert len(done.stdout + done.stderr) > 60


@pytest.mark.usefixtures("quick_environment")
@pytest.mark.parametrize(
    "locale",
    [
        C_LOCALE,
        *(pytest.param({"PYTHONIOENCODING": each}, marks=pytest.mark.slow) for each in ENCODINGS),
    ],
    ids=lambda each: each.get("PYTHONIOENCODING") or "C",
)
def test_a_run_ends_with_its_table(tmp_path, locale):
    done = program(*RUN, folder=tmp_path, **locale)
    assert done.returncode == 0, done.stderr
    assert "UnicodeEncodeError" not in done.stderr
    assert "facts in out" in done.stdout
    encoding = locale.get("PYTHONIOENCODING") or "ascii"
    text = done.stdout.encode("latin-1").decode(encoding)
    assert ("overhead (eps)" in text) == (encoding not in ("cp437", "gbk"))  # which have an ε
