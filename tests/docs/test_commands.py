"""Every command, link, picture and scene in README, CONTRIBUTING and docs holds: read by the real command line, not run."""

import os
import re
import shutil

import checking
import documents
import numpy as np
import pytest
from checking import as_text, check
from documents import PAGES, ROOT, anchors, blocks, commands, links, name, scene_files

import taichi_rts as rts
from taichi_rts.commands.scene_copies import EXAMPLES
from taichi_rts.errors import Error
from taichi_rts.scene.files.reading import tomllib, with_files_beside
from taichi_rts.scene.loading import scene_from

ALL = sorted({name(page) for page in PAGES})
DUMMY = {
    "domain": {"lower": [0.0, 0.0, 0.0], "upper": [2.0, 1.0, 1.0]},
    "fluids": [{"lower": [1.5, 0.8, 0.8], "upper": [2.0, 1.0, 1.0]}],
    "spacing": 0.1,
}
"""What a part of a scene file is put into; in two dimensions without its third components."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder that has what the docs' commands name: the repository's files, and their own scene files."""
    folder = tmp_path_factory.mktemp("docs")
    for part in ("assets", "demos"):
        (folder / part).symlink_to(ROOT / part)
    shutil.copytree(EXAMPLES, folder, dirs_exist_ok=True)  # as if they had been copied
    (folder / "out/tank/particles").mkdir(parents=True)
    frame = rts.ParticleFrame(np.array([[0.2, 0.2], [0.4, 0.2]]), {}, 0.0, 0.02)
    rts.write_particles(folder / "out/tank/particles/000012.npz", frame)
    checking.write_stand_ins(folder, {file: text for page in ALL for file, text in scene_files(page).items()})
    return folder


@pytest.fixture(scope="module")
def loaded():
    return {}


def test_there_are_commands_to_check():
    assert sum(len(list(commands(page))) for page in ALL) > 120
    assert len(scene_files("docs/tutorial.md")) == 1


@pytest.mark.parametrize("page", ALL)
@pytest.mark.filterwarnings("ignore::UserWarning")  # what a SPlisHSPlasH scene has that is not honoured
def test_commands_hold(page, folder, loaded, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    for words in commands(page):
        try:
            check(words, loaded)
        except (Error, AssertionError, SystemExit) as error:
            pytest.fail(f"{page}: {as_text(words)}: {error} {capsys.readouterr()}")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("taichi-rts run dam_brake", "dam_brake"),
        ("taichi-rts run dam_break --colour-by mood", "2"),
        ("taichi-rts run dam_break_2d --views top", "--views"),
        ("taichi-rts run dam_break --stepper uniform --levels 2", "--levels"),
        ("taichi-rts run dam_break --export vtk", "vtk"),
        ("taichi-rts stability --cases pistol", "pistol"),
        ("taichi-rts compare dam_break_2d --steppers uniforn", "uniforn"),
        ("python studies/faults.py --onyl two", "onyl"),
        ("python demos/dam_break.py --colour-bye speed", "2"),
        ("python -m pytest tests/unit/scene/parts/test_obstacles.py -k geometrie", "geometrie"),
        ("make tests", "tests"),
        ("pip install 'taichi_rts[videos]'", "videos"),
        ("cargo run", "cargo"),
    ],
)
def test_a_wrong_command_would_be_found(command, said, loaded):
    with pytest.raises((Error, AssertionError, SystemExit), match=said):
        check(next(documents.commands_of(command)), loaded)


@pytest.mark.parametrize("page", ALL)
def test_links_lead_somewhere(page):
    for target in links(page):
        path, _, anchor = target.partition("#")
        found = os.path.normpath(os.path.join(os.path.dirname(page), path)) if path else page
        assert (ROOT / found).exists(), f"{page}: {target}"
        assert not anchor or anchor in anchors(found), f"{page}: {target}"


@pytest.mark.parametrize("page", ALL)
def test_files_that_are_named_exist(page):
    named = re.findall(r"`((?:taichi_rts|tests|studies|demos|docs|assets)/[\w./-]+)`", documents.prose(page))
    lost = [file for file in named if not (ROOT / file).exists()]
    assert not lost, page


def test_pages_that_the_code_names_exist():
    named = set()
    for folder in ("taichi_rts", "tests", "studies", "demos"):
        for path in [*(ROOT / folder).rglob("*.py"), *(ROOT / folder).rglob("*.toml")]:
            named |= set(re.findall(r"\bdocs/[\w/]+\.md", path.read_text(encoding="utf-8")))
    assert len(named) > 10
    assert [page for page in sorted(named) if not (ROOT / page).exists()] == []


def test_the_data_walk_enters_no_file_twice():
    walk = documents.prose("docs/data_walk.md")
    entered = [
        file for step in re.findall(r"^\d+\. (.*?):", walk, re.MULTILINE) for file in re.findall(r"`([^`]+)`", step)
    ]
    assert len(entered) > 25
    assert len(entered) == len(set(entered))
    named = [file for file in re.findall(r"`([\w/]+/\w*(?:\.py)?)`", walk) if "/" in file]
    assert [file for file in named if not (ROOT / "taichi_rts" / file.removeprefix("taichi_rts/")).exists()] == []


@pytest.mark.parametrize("page", ALL)
def test_scene_files_hold(page, folder, monkeypatch):
    monkeypatch.chdir(folder)
    files = scene_files(page)
    for file in files:
        rts.load_scene(file)
    for block in blocks(page):
        if block.language == "toml" and not block.file:
            part = tomllib.loads(block.text)
            flat = "inflows" in part or any(
                len(wall.get("velocity", "xyz")) == 2 for wall in part.get("moving_walls", ())
            )
            dummy = {key: flattened(value) if flat else value for key, value in DUMMY.items()}
            shutil.copy(ROOT / "assets/obstacles/ball.obj", folder / "ball.obj")
            part["obstacles"] = [
                each | {"scale": 1.0} if "file" in each else each for each in part.get("obstacles", ())
            ]
            (folder / "shaken.csv").write_text("0.01, 0.2, -9.81, 0.0\n")
            scene_from(with_files_beside(dummy | part, folder / "part.toml"))


def flattened(value):
    """The same in two dimensions."""
    if isinstance(value, dict):
        return {key: flattened(each) for key, each in value.items()}
    return (
        [flattened(each) if isinstance(each, dict) else each for each in value[:2]]
        if isinstance(value, list)
        else value
    )
