"""Help says nothing of None, and Python says what is meant."""

import pytest
import tyro

from taichi_rts.commands.main import Command


@pytest.mark.parametrize("command", ["run", "compare", "stability", "bench", "side-by-side", "plot", "scenes"])
def test_help_does_not_mention_none(command, capsys):
    with pytest.raises(SystemExit):
        tyro.cli(Command, args=[command, "--help"])
    said = capsys.readouterr().out
    assert "--help" in said
    assert "None" not in said
    assert "(default: )" not in said


def test_optional_values_are_read_as_before():
    run = tyro.cli(
        Command, args=["run", "dam_break", "--spacing", "0.1", "--limiter", "False", "--sound-speed", "auto"]
    )
    text = repr(run)
    for part in ("spacing=0.1", "limiter=False", "sound_speed='auto'", "alpha=None", "scene='dam_break'"):
        assert part in text


@pytest.mark.parametrize("command", ["compare", "stability"])
def test_help_is_in_groups(command, capsys):
    with pytest.raises(SystemExit):
        tyro.cli(Command, args=[command, "--help"])
    said = capsys.readouterr().out
    for group in ("files options", "machine options", "What is written, and where."):
        assert group in said
    assert "--files." not in said
