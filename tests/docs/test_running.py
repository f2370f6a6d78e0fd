"""What stands in the docs is run, smaller: some pages from top to bottom, of the others what runs scenes, every Python block.

`compare`, `stability`, `bench` and `--gui` have tests of their own (tests/unit/compare, tests/stability,
tests/unit/benchmarks/test_benchmarks.py, tests/unit/window/test_window.py). Scripts that measure for minutes to hours
are only read (test_commands.py).
"""

import subprocess
import sys

import checking
import pytest
from documents import PAGES, ROOT, blocks, commands, commands_of, name, scene_files

from taichi_rts.commands.main import main
from taichi_rts.device.backend import ti

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_environment")]

PICTURE = ["--width", "240", "--height", "160", "--quality", "draft"]
APPENDED = {
    "run": ["--end-time", "0.1", "--export-fps", "20", "--checkpoint-every", "0.05", *PICTURE],
    "resume": PICTURE,
}
"""Options that are appended to a command of each kind, so that they win."""
REPLACED = {
    "000000.500000000": "000000.050000000",
    "000010.vtu": "000001.vtu",
    "000012.npz": "000001.npz",
    "spacing=0.04": "spacing=0.1",
    "spacing=0.05": "spacing=0.1",
    'arch="auto"': 'arch="cpu"',
    "out/one": "out/mine",
    "out/two": "out/mine",
    "cuda": "cpu",
    "advance_to(0.5)": "advance_to(0.02)",
    "particles=500": "particles=60, end_time=0.04",
    "courants=(0.4, 0.8)": "courants=(0.4,), samples=4, repeats=1",
}
"""Words of commands and of Python blocks, and what stands for them here."""
OWN_SIZE = ("tank.toml", "again.toml")
"""Scenes that keep their spacing: the second starts from particles of the first."""
WHOLE = ["docs/tutorial.md", "docs/restart.md"]
"""Pages that are run from top to bottom; of the others Python blocks and commands of these kinds:"""
KINDS = ("run", "side-by-side", "scenes", "info")
ELSEWHERE = {"--gui", "--help", "FILE", "..."}
A_RUN = "import taichi_rts as rts\nrts.init('cpu')\nsim = rts.Simulation(rts.load_scene('dam_break_2d', spacing=0.1))\n"
TAKEN_FOR_GRANTED = {"docs/restart.md": A_RUN, "docs/stability.md": A_RUN}
"""What was said before a page's Python blocks."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to work in, with what a clone has in it."""
    for part in ("assets", "demos"):
        (tmp_path / part).symlink_to(ROOT / part)
    checking.write_stand_ins(tmp_path, {})
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    ti.reset()


def replaced(text):
    for word, other in REPLACED.items():
        text = text.replace(word, other)
    return text


def smaller(words):
    """A command of `taichi-rts` as long as a test may take; a size and an end that it names give way."""
    kind, *rest = (replaced(word) for word in words[1:])
    resumes = kind == "run" and "--resume" in rest
    for option in ("--spacing", "--particles"):
        if option in rest:
            del rest[rest.index(option) : rest.index(option) + 2]
    if resumes and "--end-time" in rest:
        rest[rest.index("--end-time") + 1] = "0.15"
    size = ["--particles", "1000"] if kind == "run" and rest[0] not in OWN_SIZE and not resumes else []
    return [kind, *rest, *size, *APPENDED.get("resume" if resumes else kind, ())]


def run_shell(text):
    """Run the commands of a block that are ours; the Python block of docs/compare.md does what `compare` does."""
    for words in commands_of(text):
        if words[0] == "taichi-rts" and words[1] != "compare":
            main(smaller(words))


def run_python(text, page, folder):
    """Run a block; in a program of its own if it starts processes, which import it, or has kernels, whose source is looked up."""
    text = TAKEN_FOR_GRANTED.get(page, "") + replaced(text)
    if any(word in text for word in ("__main__", "ti.func", "ti.kernel", "ti.data_oriented")):
        (folder / "block.py").write_text(text)
        subprocess.run([sys.executable, "block.py"], check=True, timeout=300)
    else:
        exec(compile(text, page, "exec"), {"__name__": "block"})


@pytest.mark.parametrize("page", WHOLE)
def test_a_page_from_top_to_bottom(page, folder):
    for block in blocks(page):
        if block.file:
            with open(folder / block.file, "a") as scene:
                scene.write(replaced(block.text))
        elif block.language == "sh":
            run_shell(block.text)
        elif block.language == "python":
            run_python(block.text, page, folder)
    runs = sorted(folder.glob("out/*/run.json"))
    assert len(runs) >= 2
    assert len(sorted(folder.glob("out/*/frames/000002.png"))) >= 2


@pytest.mark.parametrize("page", [name(page) for page in PAGES if name(page) not in WHOLE])
def test_python_blocks(page, folder):
    for block in blocks(page):
        if block.language == "python":
            run_python(block.text, page, folder)


def to_run(page):
    """The commands of a page that this file runs, each once, in their order."""
    ours = (tuple(words) for words in commands(page) if words[0] == "taichi-rts" and words[1] in KINDS)
    return [words for words in dict.fromkeys(ours) if words[1:] != ("run",) and not ELSEWHERE & {*words}]


@pytest.mark.parametrize("page", [name(page) for page in PAGES if name(page) not in WHOLE and to_run(name(page))])
@pytest.mark.filterwarnings("ignore::UserWarning")  # what of a SPlisHSPlasH scene is not honoured
def test_commands_of_a_page(page, folder):
    checking.write_stand_ins(folder, {file: replaced(text) for file, text in scene_files(page).items()})
    for words in to_run(page):
        command = smaller(words)
        again = command[0] == "run" and "--resume" not in command
        main([*command, *(["--overwrite"] if again and "--overwrite" not in command else [])])
    writes = any(words[1] in ("run", "side-by-side") for words in to_run(page))
    assert bool(list(folder.glob("out/**/*.json"))) == writes
