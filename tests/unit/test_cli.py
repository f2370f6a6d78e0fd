import hashlib
import json
import subprocess
import sys

import imageio.v3 as imageio
import pytest

from taichi_rts import cli

SMALL = [
    "--arch",
    "cpu",
    "--spacing",
    "0.1",
    "--end-time",
    "0.1",
    "--export-fps",
    "20",
    "--width",
    "320",
    "--height",
    "180",
]


def run(*args):
    command = [sys.executable, "-m", "taichi_rts", *args]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory):
    folders = [tmp_path_factory.mktemp("run") / name for name in ("one", "two")]
    results = [run("run", "double_dam_break", "--preset", "paper", *SMALL, "--output-dir", str(f)) for f in folders]
    assert all(result.returncode == 0 for result in results), results[0].stderr
    return folders, results


def test_run_writes_frames_and_facts(two_runs):
    (folder, _), (result, _) = two_runs
    frames = sorted((folder / "frames").iterdir())
    assert [frame.name for frame in frames] == ["000000.png", "000001.png", "000002.png"]
    assert imageio.imread(frames[0]).shape == (180, 320, 3)
    facts = json.loads((folder / "run.json").read_text())
    for key in ("scene", "stepper", "arch", "particles", "end_time", "base_steps", "particle_updates", "wall_seconds"):
        assert key in facts
    assert facts["end_time"] == 0.1
    assert facts["active_fraction"] == pytest.approx(
        facts["particle_updates"] / facts["particles"] / facts["base_steps"]
    )
    assert sum(facts["level_fractions"]) == pytest.approx(1.0)
    assert "active fraction" in result.stdout
    assert "energy drift" in result.stdout


def test_the_same_command_gives_the_same_bits(two_runs):
    folders, _ = two_runs
    facts = [json.loads((folder / "run.json").read_text()) for folder in folders]
    for fact in facts:
        del fact["wall_seconds"]
    assert facts[0] == facts[1]
    hashes = [
        [hashlib.sha256(frame.read_bytes()).hexdigest() for frame in sorted((folder / "frames").iterdir())]
        for folder in folders
    ]
    assert hashes[0] == hashes[1]
    assert len(set(hashes[0])) == 3


def test_existing_output_is_kept(two_runs):
    (folder, _), _ = two_runs
    before = (folder / "run.json").read_text()
    result = run("run", "double_dam_break", *SMALL, "--output-dir", str(folder))
    assert result.returncode == 2
    assert "--overwrite" in result.stderr
    assert (folder / "run.json").read_text() == before


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["run", "no_such_scene"], ["no_such_scene", "double_dam_break"]),
        (["run", "missing.toml"], ["missing.toml"]),
        (["run", "dam_break", "--spacing", "-1"], ["spacing", "-1"]),
        (["run", "dam_break", "--particles", "many"], ["many", "30k"]),
        (["run", "dam_break", "--levels", "0"], ["levels", "0"]),
        (["run", "dam_break", "--stepper", "uniform", "--levels", "3"], ["--levels", "uniform"]),
        (["run", "dam_break", "--arch", "tpu"], ["tpu"]),
        (["run", "dam_break", "--width", "1"], ["1 x 720"]),
        (["run", "dam_break", "--export-fps", "0"], ["export_fps"]),
        (["run", "dam_break", "--nonsense"], ["nonsense"]),
    ],
)
def test_bad_input_is_one_message_and_exit_code_2(args, words, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main([*args, "--output-dir", str(tmp_path / "out")])
    assert stop.value.code == 2
    captured = capsys.readouterr()
    for word in words:
        assert word in captured.err + captured.out
    assert "Traceback" not in captured.err
    assert not (tmp_path / "out").exists()


def test_a_missing_arch_never_falls_back(tmp_path):
    from taichi_rts import backend

    if backend.available()["cuda"] == "available":
        pytest.skip("this machine has CUDA")
    result = run("run", "dam_break", *SMALL[2:], "--arch", "cuda", "--output-dir", str(tmp_path / "out"))
    assert result.returncode == 2
    assert "cuda" in result.stderr
    assert "--arch cpu" in result.stderr
    assert not (tmp_path / "out").exists()


def test_scenes_and_info_list_what_there_is(capsys):
    cli.main(["scenes"])
    assert "martin_moyce" in capsys.readouterr().out
    cli.main(["info"])
    assert "arch cpu" in capsys.readouterr().out
