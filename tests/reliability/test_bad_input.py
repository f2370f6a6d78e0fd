"""Every row of bad_fields, bad_scenes and bad_commands is refused as a whole.

Exit code 2, one message with value, limit and remedy, within 2 s, and nothing on disk changes. Each fault has its row here; tests
of scenes and of commands have those that no file and no command line can hold, and where a message stands or how it is shortened.
"""

import pytest
from bad_commands import COMMANDS
from bad_fields import field_rows
from bad_scenes import SCENES
from rows import RUN, prepare
from scenes import FLAT, SOLID, to_toml
from trial import attempt, without

import taichi_rts as rts
from taichi_rts.output import recorder
from taichi_rts.window.x_keys import XKeys


class StartedError(Exception):
    """A run has begun that should not."""


@pytest.fixture(autouse=True)
def never_starts(monkeypatch, kernel_cache):
    def start(*_args, **_options):
        raise StartedError

    monkeypatch.setattr(recorder, "Simulation", start)


def test_the_whole_scenes_are_valid(folder):
    for data, dim in ((SOLID, 3), (FLAT, 2)):
        (folder / "scene.toml").write_text(to_toml(data))
        assert rts.load_scene(folder / "scene.toml").dim == dim


@pytest.mark.parametrize("row", field_rows(), ids=lambda row: row.name)
def test_fields(row, folder):
    """What a scene's errors become on the command line is the same for all of them, and `test_rows` sees it."""
    found = {}
    for kind, (data, valid) in row.scenes.items():
        (folder / "scene.toml").write_text(to_toml(data))
        try:
            rts.load_scene(folder / "scene.toml")
            refused = False
        except rts.SceneError as error:
            refused = bool(str(error))
        if valid and refused:
            found[kind] = "is valid"
        elif not valid and not refused and (faults := attempt(folder, *RUN).faults()):  # refused later
            found[kind] = faults
    assert not found


@pytest.mark.parametrize("row", [*SCENES, *COMMANDS], ids=lambda row: row.what)
def test_rows(row, folder):
    prepare(folder, row)
    with without(row.hidden):
        trial = attempt(folder, *row.args)
    assert not trial.faults(row.words), trial.said


def test_a_window_without_python_xlib_lacks_only_keys():
    with without("Xlib"):
        keys = XKeys("none")
        assert keys.display is None
        assert keys.pressed() == []
