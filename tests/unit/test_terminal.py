"""How far a command is: a bar that fits its terminal, lines in a log."""

import io
import time

import pytest
from rich.console import Console

from taichi_rts import terminal
from taichi_rts.terminal import Progress


def log(monkeypatch):
    """Let commands write to a file, and return it."""
    file = io.StringIO()
    monkeypatch.setattr(terminal, "console", Console(file=file, width=80))
    return file


def test_a_log_has_a_line_for_every_tenth_and_none_is_cut(monkeypatch):
    file = log(monkeypatch)
    text = "a description that is much longer than eighty columns " * 3
    with Progress("dam_break_2d", 2.0) as progress:
        progress.begin("compiling")
        for done in range(41):
            progress.reach(0.05 * done, text)
    lines = file.getvalue().splitlines()
    assert [line.split()[1] for line in lines] == [f"{10 * k}%" for k in range(1, 11)]
    assert all(line.startswith("dam_break_2d: ") and line.endswith(text.strip()) for line in map(str.strip, lines))
    assert "left" in lines[4]
    assert "left" not in lines[-1]


def test_a_log_shows_that_a_long_step_is_alive(monkeypatch):
    file = log(monkeypatch)
    monkeypatch.setattr(terminal, "LINE_SECONDS", 0.05)
    with Progress("tank", 1.0, look=lambda: 0.03) as progress:
        progress.begin("compiling")
        deadline = time.monotonic() + 5.0
        while "3%" not in file.getvalue() and time.monotonic() < deadline:
            time.sleep(0.01)
    assert "tank: 3% after 0:00:0" in file.getvalue()
    assert "; compiling" in file.getvalue()


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_the_bar_stays_in_one_line(monkeypatch, width):
    file = io.StringIO()
    console = Console(file=file, width=width, force_terminal=True, color_system=None)
    monkeypatch.setattr(terminal, "console", console)
    with Progress("tank", 0.6) as progress:
        progress.begin("compiling")
        progress.reach(0.3, "t = 0.300 of 0.6 s, active 100%, 1.23 M updates/s")
    file = io.StringIO()
    Console(file=file, width=width).print(progress._bar.get_renderable())
    line = file.getvalue().rstrip("\n")
    assert "\n" not in line
    assert len(line) <= width
    assert "50%" in line
    if width >= 80:
        assert "1.23 M updates/s" in line
        assert "━━━━━━━" in line


def test_what_is_not_a_terminal_cuts_nothing(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    assert terminal.make_console().width == terminal.UNCUT
    monkeypatch.setenv("COLUMNS", "72")
    assert terminal.make_console().width == 72
