"""Scenes by name, from files and from plain data, and what messages say of a mistake there."""

import json
import math

import pytest

import taichi_rts as rts
from taichi_rts.scene.loading import parse_count, scene_from

SPHERES = """
spacing = 0.1
domain = { lower = [0.0, 0.0], upper = [1.0, 1.0] }
[[fluids]]
lower = [0.0, 0.0]
upper = [0.5, 0.4]
[[fluids]]
centre = [0.7, 0.7]
radius = 0.2
velocity = { gradient = [[-100.0, 0.0], [0.0, 100.0]] }
"""
TOML = """
spacing = 0.1
domain = { lower = [0.0, 0.0], upper = [1.0, 1.0] }
[[fluids]]
lower = [0.0, 0.0]
upper = [0.5, 0.5]
"""


def write(folder, text, name="my_scene.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_toml_file(tmp_path):
    path = write(tmp_path, TOML)
    loaded = rts.load_scene(path)
    block = rts.Block((0, 0), (0.5, 0.5))
    assert loaded == rts.Scene(domain=rts.Box((0, 0), (1, 1)), fluids=[block], spacing=0.1, name="my_scene")
    changed = rts.load_scene(path, spacing=0.05, gravity=(0, -1))
    assert (changed.spacing, changed.gravity) == (0.05, (0.0, -1.0))
    assert rts.load_scene(str(path), particles=100).spacing == pytest.approx(0.05)


def test_faults_in_a_file_name_the_file_and_the_path(tmp_path):
    text = TOML.replace("spacing = 0.1", "spacing = -1\nsound_sped = 3").replace("upper = [0.5, 0.5]", "uper = [0.5]")
    with pytest.raises(rts.SceneError) as caught:
        rts.load_scene(write(tmp_path, text))
    message = str(caught.value)
    assert "my_scene.toml" in message
    assert "spacing: Input should be greater than 0 (got -1" in message
    assert "sound_sped: unknown key; did you mean 'sound_speed'?" in message
    assert "fluids.0.uper: unknown key; did you mean 'upper'?" in message
    assert "fluids.0.upper: missing" in message


def test_toml_file_with_a_sphere(tmp_path):
    loaded = rts.load_scene(write(tmp_path, SPHERES))
    drop = rts.Sphere((0.7, 0.7), 0.2, velocity=rts.LinearField(((-100, 0), (0, 100))))
    assert loaded.fluids == (rts.Block((0, 0), (0.5, 0.4)), drop)
    finer = rts.load_scene(write(tmp_path, SPHERES), particles=1000)
    assert (0.2 + math.pi * 0.04) / finer.spacing**2 == pytest.approx(1000, rel=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "lines"),
    [
        ("radius = 0.2", "radius = -0.2", ["fluids.1.radius: Input should be greater than 0 (got -0.2)"]),
        ("radius = 0.2", "", ["fluids.1.radius: missing; give it a value"]),
        (
            "radius",
            "radus",
            ["fluids.1.radius: missing; give it a value", "fluids.1.radus: unknown key; did you mean 'radius'?"],
        ),
        (
            "centre",
            "center",
            ["fluids.1.centre: missing; give it a value", "fluids.1.center: unknown key; did you mean 'centre'?"],
        ),
        (
            "gradient",
            "gradent",
            ["velocity.gradient: missing", "velocity.gradent: unknown key; did you mean 'gradient'?"],
        ),
        ("[[-100.0, 0.0], [0.0, 100.0]]", "[[1, 'x'], [0, 1]]", ["fluids.1.velocity.gradient.0.1: Input should be a"]),
        ("{ gradient = [[-100.0, 0.0], [0.0, 100.0]] }", "[1, 'x']", ["fluids.1.velocity.1: Input should be a valid"]),
        (
            "{ gradient = [[-100.0, 0.0], [0.0, 100.0]] }",
            "3",
            ["fluids.1.velocity: a list is needed, such as [0.0, 0.0, 1.0] (got 3)"],
        ),
        ("{ gradient = [[-100.0, 0.0], [0.0, 100.0]] }", "[1, 2, 3]", ["fluids.1: velocity (1.0, 2.0, 3.0) has 3"]),
        ("spacing = 0.1", "spacing = 0.1\nbody_forc = 1", ["body_forc: unknown key; did you mean 'body_force'?"]),
    ],
)
def test_a_mistake_in_a_sphere_is_reported_once(tmp_path, old, new, lines):
    with pytest.raises(rts.SceneError) as caught:
        rts.load_scene(write(tmp_path, SPHERES.replace(old, new)))
    message = str(caught.value)
    assert message.count("\n") == len(lines) - 1
    for line in lines:
        assert line in message


def test_a_key_that_is_unknown_is_refused():
    with pytest.raises(rts.SceneError, match="spacng: unknown key; did you mean 'spacing'"):
        rts.load_scene("dam_break", spacng=0.1)


def test_built_in_scenes_load_in_both_dimensions():
    required = "dam_break double_dam_break dam_break_drop serna_ablation martin_moyce still_pool free_fall"
    names = rts.scene_names()
    flat = {"elliptical_drop", "oscillating_drop", "hydrostatic_column", "taylor_green", "poiseuille", "standing_wave"}
    flat |= {"koshizuka_oka", "torricelli"}
    assert set(required.split()) | flat | {"dam_break_2d", "double_dam_break_2d"} <= set(names)
    for name in names:
        loaded = rts.load_scene(name)
        assert loaded.name == name
        assert loaded.dim == (2 if name.endswith("_2d") or name in flat else 3)
        assert loaded.description


def test_plain_data_survives_a_round_trip():
    data = rts.load_scene("dam_break_drop").to_dict()
    data["domain"] = rts.Box(**data["domain"])
    data["fluids"] = [rts.Block(**block) for block in data["fluids"]]
    data["view"] = rts.View(**data["view"])
    assert rts.Scene(**data) == rts.load_scene("dam_break_drop")
    for name in ("elliptical_drop", "oscillating_drop"):
        data = rts.load_scene(name).to_dict()
        assert data["fluids"][0]["velocity"].keys() == {"gradient"}
        assert scene_from(json.loads(json.dumps(data))) == rts.load_scene(name)


@pytest.mark.parametrize(
    ("text", "count"), [("1.5M", 1_500_000), ("30k", 30_000), ("30000", 30_000), (2e4, 20_000), ("2 m", 2_000_000)]
)
def test_particle_counts(text, count):
    assert parse_count(text) == count
    spacing = rts.load_scene("dam_break", particles=text).spacing
    assert 0.5 / spacing**3 == pytest.approx(count, rel=0.03)


def test_a_count_chooses_a_spacing_that_divides_the_scenes_lengths():
    assert rts.load_scene("dam_break", particles="3k").spacing == pytest.approx(
        1 / 18
    )  # not (0.5/3000)^(1/3) = 1/18.17
    assert rts.load_scene("torricelli", particles="1k").spacing == pytest.approx(1 / 30)


@pytest.mark.parametrize("text", ["x", "", "-5", "0", "nan", "inf", "1e12", "1.5G"])
def test_impossible_particle_counts(text):
    with pytest.raises(rts.SceneError, match=r"is not a count from 1 to 2147483647; write e\.g\. 30000, 30k or 1\.5M"):
        rts.load_scene("dam_break", particles=text)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"sound_speed": "72 km/h"}, "sound_speed: '72 km/h' is a text; give a plain number in SI units, 20"),
        ({"gravity": [0, "-981 cm/s²"]}, "gravity.1: '-981 cm/s²' is a text; give a plain number in SI units, -9.81"),
        ({"rest_density": "1 g/cm^3"}, "rest_density: '1 g/cm^3' is a text; give a plain number in SI units, 1000"),
        (
            {"end_time": "2 parsecs"},
            "end_time: Input should be a valid number (got ",
        ),
        ({"gravity": -9.81}, "gravity: a list is needed, such as [0.0, 0.0, 1.0] (got -9.81)"),
        ({"fluids": {"lower": [0, 0]}}, "fluids: is one table; write it as a list of tables, [[fluids]]"),
        ({"domain": [1, 1]}, "domain: a table with lower, upper is needed (got [1, 1])"),
        (
            {"view": {"azimut": 3}},
            "view.azimut: unknown key; did you mean 'azimuth'? (known: azimuth, elevation, eye, ",
        ),
        (
            {"fluids": [{"lower": [0, 0], "upper": [1, 1], "colour": "bleu"}]},
            "fluids.0.colour: 'bleu' is no colour; give a name such as 'orange', or '#RRGGBB'",
        ),
        (
            {"obstacles": [{"shape": "sphere", "centre": [0, 0], "radius": 1, "motion": {"velocty": [1, 0]}}]},
            "obstacles.0.motion.velocty: unknown key; did you mean 'velocity'? (known: angular_velocity, pivot, start, ",
        ),
    ],
)
def test_wrong_units_and_shapes_of_values_say_what_to_write(changes, line):
    data = {
        "spacing": 0.1,
        "domain": {"lower": [0, 0], "upper": [1, 1]},
        "fluids": [{"lower": [0, 0], "upper": [1, 1]}],
    }
    with pytest.raises(rts.SceneError) as caught:
        scene_from(data | changes, "my.toml")
    assert f"my.toml: {line}" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_messages_shorten_long_lists():
    times = [*(0.01 * k for k in range(400)), 0.0]
    with pytest.raises(rts.SceneError) as raised:
        rts.MovingWall("x-", times=times, displacements=[0.0] * 401)
    assert str(raised.value) == "MovingWall: times (0.0, 0.01, 0.02, ..., 0.0) (401 entries) must ascend"
    with pytest.raises(rts.SceneError, match=r"times \(0.0, 2.0, 1.0\) must ascend"):
        rts.MovingWall("x-", times=[0, 2, 1], displacements=[0, 0, 0])


def test_every_key_of_every_object_is_described():
    schema = rts.scene_schema()
    missing = [
        f"{name}.{key}"
        for name, part in {"Scene": schema, **schema["$defs"]}.items()
        for key, value in part["properties"].items()
        if len(value.get("description", "")) < 3
    ]
    assert not missing
    assert schema["$defs"]["Keyframes"]["properties"]["times"]["description"].startswith("[s], (K,), ascending")
    assert "Attributes" not in str(schema)
