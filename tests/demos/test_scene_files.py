"""The example scene files, each coarser and for a few steps, and what they and the schema have to agree on."""

import json

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.commands.scene_copies import EXAMPLES, copy_scene, example_names
from taichi_rts.scene.files.reading import read_scene_file, tomllib
from taichi_rts.scene.loading import scene_from
from taichi_rts.scene.obstacles.shapes import BY_NAME
from taichi_rts.scene.schema import keys_at

FOLDER = EXAMPLES
FILES = sorted(FOLDER.glob("*.toml"))
COARSE = {"two_dams": 0.1, "inflow_jet": 0.05, "wave_paddle": 0.05, "splash_regional": 0.1}


def test_there_are_five():
    assert len(FILES) == len(example_names()) == 5


def test_a_copy_loads_and_replaces_nothing(tmp_path):
    files = copy_scene("two_dams", tmp_path)
    assert [path.name for path in files] == ["two_dams.toml", "hexagon.obj"]
    assert rts.load_scene(files[0]).obstacles[0].sha256 == rts.load_scene(FOLDER / "two_dams.toml").obstacles[0].sha256
    files[0].unlink()
    files[1].write_text("mine")
    with pytest.raises(rts.OutputError, match=r"hexagon.obj is there already, and --copy replaces nothing"):
        copy_scene("two_dams", tmp_path)
    assert (files[1].read_text(), files[0].exists()) == ("mine", False)
    assert rts.load_scene(*copy_scene("dam_break_2d.toml", tmp_path)) == rts.load_scene("dam_break_2d")
    with pytest.raises(rts.SceneError, match="'two_dam' is no scene of this package; did you mean 'two_dams'"):
        copy_scene("two_dam", tmp_path)


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
        "kinematic_viscosity",  # each fluid's own is used
        "gravity_interpolation",
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
