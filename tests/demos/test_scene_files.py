"""The example scene files, each coarser and for a few steps, and what they and the schema have to agree on."""

import json
from pathlib import Path

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.scene.files.reading import read_scene_file, tomllib
from taichi_rts.scene.loading import scene_from
from taichi_rts.scene.obstacles.shapes import BY_NAME
from taichi_rts.scene.schema import keys_at

FOLDER = Path(__file__).parents[2] / "demos" / "scenes"
FILES = sorted(FOLDER.glob("*.toml"))
COARSE = {"two_dams": 0.1, "inflow_jet": 0.05, "wave_paddle": 0.05, "splash_regional": 0.1}


def test_there_are_five():
    assert len(FILES) == 5


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_an_example_comes_back_from_plain_data_and_from_json(path, tmp_path):
    scene = rts.load_scene(path)
    plain = json.dumps(scene.to_dict())
    assert scene_from(json.loads(plain)) == scene
    if not any(hasattr(each, "file") for each in scene.obstacles):  # which have to lie beside the scene's
        (tmp_path / "same.json").write_text(plain)
        assert rts.load_scene(tmp_path / "same.json") == scene


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_an_example_runs(path, simulate):
    scene = rts.load_scene(path, **({"spacing": COARSE[path.stem]} if path.stem in COARSE else {}))
    sim = simulate(scene, rts.Uniform())
    until = 0.02 if scene.inflows else 2.5 * sim.base_step
    sim.advance_to(until)
    x = sim.positions()
    assert np.isfinite(x).all()
    assert (x >= scene.domain.lower).all()
    assert (x <= scene.domain.upper).all()
    assert sim.statistics["runaways"] == 0
    drawn = np.bincount(sim.fluids(), minlength=len(scene.fluid_names))
    assert (drawn > 0).all()
    assert drawn.sum() == sim.count


def test_examples_use_every_key_of_a_scene():
    used = {key for path in FILES for key in read_scene_file(path)}
    assert set(rts.Scene.__dataclass_fields__) - used <= {
        "body_force",
        "support_ratio",
        "rest_density",
        "walls",
        "outlets",
    } | {
        "kinematic_viscosity"  # each fluid's own is used
    }


def test_the_schema_knows_every_key_and_no_other():
    schema = rts.scene_schema()
    assert set(schema["properties"]) == set(rts.Scene.__dataclass_fields__)
    assert schema["required"] == ["domain", "fluids", "spacing"]
    assert schema["additionalProperties"] is False
    assert all(each["additionalProperties"] is False for each in schema["$defs"].values())
    for path in FILES:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        assert set(data) <= set(schema["properties"])
        for fluid in data["fluids"]:
            kind = "<Sphere>" if "radius" in fluid else "<Block>"
            assert set(fluid) <= set(keys_at(rts.Scene, ["fluids", 0, kind]))
        for body in data.get("obstacles", ()):
            assert set(body) <= set(keys_at(rts.Scene, ["obstacles", 0, f"<{BY_NAME[body['shape']].__name__}>"]))
