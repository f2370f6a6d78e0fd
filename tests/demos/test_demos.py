"""Every demo runs as a user would start it, only smaller."""

import json
import subprocess
import sys
from pathlib import Path

import imageio.v3 as imageio
import pytest

pytestmark = pytest.mark.usefixtures("quick_environment")

DEMOS = sorted((Path(__file__).parents[2] / "demos").glob("*.py"))
COARSE = {
    "martin_moyce": 0.0127,
    "dam_break_obstacle": 0.06,
    "free_fall": 0.1,
    "still_pool": 0.1,
    "dam_break_2d": 0.05,
    "double_dam_break_2d": 0.05,
    "elliptical_drop": 0.1,
    "oscillating_drop": 0.1,
    "hydrostatic_column": 0.05,
    "taylor_green": 0.05,
    "poiseuille": 0.05,
    "standing_wave": 0.05,
    "koshizuka_oka": 0.0146,
    "torricelli": 0.05,
}
END = {"martin_moyce": 0.02, "elliptical_drop": 0.0082, "oscillating_drop": 0.5}
SCENE = {"asynchronous_dam_break": "dam_break"}  # demos that show a scene of another name


QUICK = {"double_dam_break"}


@pytest.mark.parametrize(
    "demo",
    [pytest.param(demo, id=demo.stem, marks=[] if demo.stem in QUICK else pytest.mark.slow) for demo in DEMOS],
)
def test_demo(demo, tmp_path):
    size = ["--spacing", str(COARSE.get(demo.stem, 0.1)), "--end-time", str(END.get(demo.stem, 0.1))]
    picture = ["--export-fps", "10", "--width", "256", "--height", "144", "--output-dir", str(tmp_path / "out")]
    command = [sys.executable, str(demo), "--arch", "cpu", *size, *picture]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
    facts = json.loads((tmp_path / "out" / "run.json").read_text())
    assert facts["scene"]["name"] == SCENE.get(demo.stem, demo.stem)
    assert facts["particles"] > 100
    frames = sorted((tmp_path / "out" / "frames").glob("*.png"))
    assert imageio.imread(frames[-1]).std() > 5.0  # not an empty picture


def test_every_scene_has_a_demo():
    import taichi_rts as rts

    assert {demo.stem for demo in DEMOS} >= set(rts.scene_names())
