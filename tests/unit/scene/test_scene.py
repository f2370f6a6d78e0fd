import dataclasses
import json
import math

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.scene.fluids.shapes import separation
from taichi_rts.scene.loading import parse_count, scene_from

UNIT = rts.Box((0, 0), (1, 1))
DAM = rts.Block((0, 0), (0.5, 0.5))
DROP = rts.Sphere((0.7, 0.7), 0.2)
CENTRAL = rts.LinearField(((-1, 0), (0, -1)))
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


def scene(**changes):
    return rts.Scene(**({"domain": UNIT, "fluids": [DAM], "spacing": 0.1} | changes))


def complaint(**changes):
    with pytest.raises(rts.SceneError) as caught:
        scene(**changes)
    return str(caught.value)


def write(folder, text, name="my_scene.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"spacing": -0.1}, ["spacing", "greater than 0", "-0.1"]),
        ({"spacing": math.nan}, ["spacing", "finite", "nan"]),
        ({"spacing": math.inf}, ["spacing", "finite", "inf"]),
        ({"gravity": (0, math.nan)}, ["gravity", "finite", "nan"]),
        ({"fluids": []}, ["fluids", "at least 1"]),
        ({"kernel": "gauss"}, ["kernel", "cubic_spline", "wendland_c2", "gauss"]),
        ({"density": "guess"}, ["density", "summation", "continuity", "guess"]),
        ({"support_ratio": 5}, ["support_ratio", "less than or equal to 4", "5"]),
        (
            {"support_ratio": 3, "density": "continuity"},
            ["support_ratio: 3 with kernel 'cubic_spline'", "at most 2.75", "'wendland_c2'"],
        ),
        ({"artificial_viscosity": -1}, ["artificial_viscosity", "greater than or equal to 0", "-1"]),
        ({"rest_density": 0}, ["rest_density", "greater than 0", "0"]),
        ({"gravity": (0, 0, -9.81)}, ["gravity (0.0, 0.0, -9.81) has 3 components; the domain has 2"]),
        ({"fluids": [rts.Block((0, 0, 0), (1, 1, 1))]}, ["fluids.0: has 3 components; the domain has 2"]),
        (
            {"fluids": [rts.Block((0, 0), (1.5, 0.5))]},
            ["fluids.0", "(1.5, 0.5)", "leaves the domain", "(1.0, 1.0)", "move or shrink it, or enlarge the domain"],
        ),
        ({"spacing": 0.6}, ["spacing: 0.6 exceeds the shortest edge 0.5 of fluids.0; use at most 0.5"]),
        ({"fluids": [DAM, rts.Block((0.4, 0.4), (1, 1))]}, ["fluids.1: overlaps fluids.0; move one"]),
        (
            {"fluids": [rts.Sphere((0.5, 0.9), 0.2)]},
            [
                "fluids.0: sphere of radius 0.2 around (0.5, 0.9) leaves the domain from (0.0, 0.0) to (1.0, 1.0); move or"
            ],
        ),
        ({"fluids": [rts.Sphere((0.5, 0.5, 0.5), 0.2)]}, ["fluids.0: has 3 components; the domain has 2"]),
        (
            {"fluids": [DROP], "spacing": 0.3},
            ["spacing: 0.3 exceeds the radius 0.2 of fluids.0; use at most 0.2"],
        ),
        ({"fluids": [rts.Block((0, 0), (1, 0.51)), DROP]}, ["fluids.1: overlaps fluids.0; move one"]),
        ({"fluids": [DROP, rts.Block((0, 0), (0.57, 0.57))]}, ["fluids.1: overlaps fluids.0; move one"]),
        ({"fluids": [DROP, rts.Block((0.5, 0.5), (0.9, 0.9))]}, ["fluids.1: overlaps fluids.0; move one"]),
        ({"fluids": [DROP, rts.Sphere((0.45, 0.45), 0.16)]}, ["fluids.1: overlaps fluids.0; move one"]),
        (
            {"fluids": [DROP, rts.Sphere((0.7, 0.26), 0.2)]},
            ["fluids.1: lies 0.04 from fluids.0, nearer than half a spacing 0.05", "move one", "a smaller spacing"],
        ),
        (
            {"body_force": rts.LinearField(((0, 1), (-1, 0))), "sound_speed": 1},
            [
                "body_force: gradient ((0.0, 1.0), (-1.0, 0.0)) is not symmetric",
                "make gradient[d][e] equal gradient[e][d]",
            ],
        ),
        (
            {"body_force": rts.LinearField(((1, 0, 0), (0, 1, 0), (0, 0, 1))), "sound_speed": 1},
            ["body_force: has 3 components; the domain has 2"],
        ),
        (
            {"body_force": CENTRAL},
            ["sound_speed: how fast the body_force makes", "give ten times the largest speed you expect [m/s]"],
        ),
        ({"gravity": (0, 0)}, ["sound_speed: nothing falls or moves", "give it a value [m/s]"]),
        ({"spacin": 1}, ["spacin: unknown key; did you mean 'spacing'?"]),
    ],
)
def test_each_fault_names_value_limit_and_remedy(changes, parts):
    message = complaint(**changes)
    assert message.startswith("Scene: ")
    for part in parts:
        assert part in message


def test_missing_fields():
    with pytest.raises(rts.SceneError, match=r"domain: missing; give it a value\n +fluids: missing"):
        rts.Scene(spacing=0.1)


def test_all_faults_come_at_once():
    assert complaint(spacing=-1, kernel="gauss", rest_density=-5, spacin=1).count("\n") == 3
    blocks = [rts.Block((0, 0), (2, 0.5)), rts.Block((0.1, 0), (0.5, 0.5)), rts.Block((0, 0, 0), (1, 1, 1))]
    message = complaint(fluids=blocks, spacing=0.7, gravity=(0, 0, 1))
    for part in ("gravity", "fluids.0: block", "of fluids.0", "of fluids.1", "fluids.1: overlaps", "fluids.2: has 3"):
        assert part in message
    drops = [rts.Sphere((0, 0), 0.2), rts.Sphere((0.1, 0.1), 0.3)]
    message = complaint(fluids=drops, spacing=0.4, body_force=rts.LinearField(((0, 1), (0, 0))))
    for part in (
        "body_force",
        "sound_speed",
        "fluids.0: sphere",
        "radius 0.2",
        "fluids.1: sphere",
        "radius 0.3",
        "overlaps",
    ):
        assert part in message


@pytest.mark.parametrize("shape", [rts.Box, rts.Block])
def test_corners(shape):
    with pytest.raises(rts.SceneError, match=r"upper \(1\.0, 0\.0\) must exceed lower \(0\.0, 0\.0\)"):
        shape((0, 0), (1, 0))
    with pytest.raises(rts.SceneError, match="differ in dimension; give both 2 or both 3"):
        shape((0, 0), (1, 1, 1))
    with pytest.raises(rts.SceneError, match="finite"):
        shape((0, math.nan), (1, 1))


@pytest.mark.parametrize("radius", [0, -1, math.nan, math.inf])
def test_radius_is_positive_and_finite(radius):
    with pytest.raises(rts.SceneError, match=r"^Sphere: radius: Input should be .*\(got "):
        rts.Sphere((0, 0), radius)


def test_an_invalid_component_is_reported_once_and_by_name():
    with pytest.raises(rts.SceneError) as caught:
        rts.Block((0, math.nan), (1, 1))
    assert str(caught.value) == "Block: lower.1: Input should be a finite number (got nan)"


@pytest.mark.parametrize(("shape", "kind"), [(rts.Block((0, 0), (1, 1)), "block"), (rts.Sphere((0, 0), 1), "sphere")])
def test_velocity_of_a_fluid_has_its_dimension(shape, kind):
    with pytest.raises(rts.SceneError, match=rf"velocity \(0\.0, 0\.0, 1\.0\) has 3 components; the {kind} has 2"):
        dataclasses.replace(shape, velocity=(0, 0, 1))
    with pytest.raises(rts.SceneError, match=rf"velocity field has 3 components; the {kind} has 2"):
        dataclasses.replace(shape, velocity=rts.LinearField(((0, 0, 0),) * 3))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"gradient": ((1, 0, 0), (0, 1))}, r"gradient: row 0 has 3 components; 2 rows need 2"),
        (
            {"gradient": ((1, 0), (0, 1)), "value": (1, 2, 3)},
            r"value \(1.0, 2.0, 3.0\) has 3 components; the gradient has 2",
        ),
        (
            {"gradient": ((1, 0), (0, 1)), "origin": (1, 2, 3)},
            r"origin \(1.0, 2.0, 3.0\) has 3 components; the gradient has 2",
        ),
        ({"gradient": ((1, 0),)}, r"gradient: .*at least 2"),
        ({"gradient": ((1, math.nan), (0, 1))}, r"gradient\.0\.1: .*finite number \(got nan\)"),
        ({"gradient": ((1, 0), (0, 1)), "value": (math.inf, 0)}, r"value\.0: .*finite number \(got inf\)"),
        ({"gradient": ((1, 0), (0, 1)), "orign": (0, 0)}, r"orign: unknown key; did you mean 'origin'"),
    ],
)
def test_faults_of_a_linear_field(arguments, message):
    with pytest.raises(rts.SceneError, match="^LinearField: " + message):
        rts.LinearField(**arguments)


def test_all_faults_of_a_linear_field_come_at_once():
    with pytest.raises(rts.SceneError) as caught:
        rts.LinearField(((1, 0), (0, 1, 2)), value=(1, 2, 3), origin=(0, 0, 0))
    assert str(caught.value).count("\n") == 2


def test_linear_field():
    field = rts.LinearField(((1, 2), (3, 4)), value=(10, 20), origin=(1, -1))
    assert field.at(np.array([[1, -1], [2, -1], [1, 0]])).tolist() == [[10, 20], [11, 23], [12, 24]]
    assert rts.LinearField(((1, 2), (3, 4))).at(np.array([1, 1])).tolist() == [3, 7]
    assert not field.is_conservative
    force = rts.LinearField(((1, 2), (2, -4)), value=(10, 20), origin=(1, -1))
    assert force.is_conservative
    x, step = np.array([0.3, 0.7]), 1e-4
    slope = [force.potential(x - e) - force.potential(x + e) for e in step * np.eye(2)]
    assert np.array(slope) / (2 * step) == pytest.approx(force.at(x), rel=1e-9)
    assert force.potential(np.array([1, -1])) == 0


def test_volume_and_reach_of_shapes():
    assert rts.Sphere((1, 2), 3).volume == pytest.approx(28.274333882308138)
    assert rts.Sphere((1, 2, 3), 3).volume == pytest.approx(113.09733552923255)
    assert rts.Sphere((1, 2), 3).reach((3, 4)) == pytest.approx(11 + 15)
    assert rts.Box((1, 2), (3, 5)).reach((-1, 2)) == rts.Block((1, 2), (3, 5)).reach((-1, 2)) == 9


def test_separation_of_spheres_and_blocks():
    ball, block = rts.Sphere((0, 0), 1), rts.Block((3, 4), (6, 6))
    assert separation(ball, block) == separation(block, ball) == 4.0
    assert separation(rts.Sphere((4, 5), 1), block) == -1.0
    assert separation(ball, rts.Sphere((3, 4), 2)) == 2.0
    assert separation(block, rts.Block((6, 0), (7, 5))) == 0.0
    assert separation(block, rts.Block((5, 0), (7, 4.5))) == -0.5


def test_blocks_may_touch_each_other_and_the_walls():
    third = 1 / 3
    assert scene(fluids=[rts.Block((0, 0), (third, 1)), rts.Block((third, 0), (1, 1))]).dim == 2
    assert scene(fluids=[rts.Block((0, 0), (0.1 + 0.2, 0.3)), rts.Block((0.3, 0), (1, 0.3))]).dim == 2


def test_a_sphere_may_touch_a_block_and_a_wall():
    resting = [rts.Block((0, 0), (1, 0.1 + 0.2)), rts.Sphere((0.2, 0.5), 0.2), rts.Sphere((0.65, 0.5), 0.2)]
    assert scene(fluids=resting).dim == 2


def test_scene_is_frozen_and_replace_validates():
    original = scene()
    with pytest.raises(AttributeError):
        original.spacing = 1.0
    finer = original.replace(spacing=0.05, name="finer")
    assert (finer.spacing, finer.name, finer.domain) == (0.05, "finer", UNIT)
    assert original.spacing == 0.1
    with pytest.raises(rts.SceneError, match=r"spacing: 0.8 exceeds"):
        original.replace(spacing=0.8)
    with pytest.raises(rts.SceneError, match="did you mean 'gravity'"):
        original.replace(gravty=(0, 0))


def test_defaults():
    assert scene().acceleration == (0.0, -9.81)
    three = rts.Scene(domain=rts.Box((0, 0, 0), (1, 1, 1)), fluids=[rts.Block((0, 0, 0), (1, 1, 1))], spacing=0.1)
    assert (three.dim, three.acceleration, three.support) == (3, (0.0, -9.81, 0.0), 0.2)


def test_largest_speed_is_that_of_the_longest_fall():
    assert scene().estimate_max_speed() == pytest.approx(math.sqrt(2 * 9.81 * 0.5))
    assert scene().wave_speed == pytest.approx(10 * math.sqrt(2 * 9.81 * 0.5))
    assert scene(sound_speed=7).wave_speed == 7.0
    thrown = rts.Block((0, 0.7), (0.2, 0.9), velocity=(3, -4))
    assert scene(fluids=[DAM, thrown]).estimate_max_speed() == pytest.approx(math.sqrt(25 + 2 * 9.81 * 0.9))
    assert scene(gravity=(2, 0)).estimate_max_speed() == pytest.approx(math.sqrt(2 * 2 * 1.0))  # falls towards +x
    lifted = rts.Box((-1, -2), (1, 1))
    assert scene(domain=lifted).estimate_max_speed() == pytest.approx(math.sqrt(2 * 9.81 * 2.5))
    assert scene(fluids=[thrown], gravity=(0, 0)).estimate_max_speed() == pytest.approx(5.0)


def test_largest_speed_of_spheres_and_linear_fields():
    assert scene(fluids=[DAM, DROP]).estimate_max_speed() == pytest.approx(math.sqrt(2 * 9.81 * 0.9))
    sideways = scene(fluids=[DROP], gravity=(-3, -4)).estimate_max_speed()
    assert sideways == pytest.approx(math.sqrt(2 * (0.7 * 7 + 0.2 * 5)))
    stretch = rts.LinearField(((-3, 0), (0, 4)), value=(0, -1), origin=(0.7, 0.7))
    drop = rts.Sphere((0.7, 0.7), 0.2, velocity=stretch)
    assert scene(fluids=[drop], gravity=(0, 0)).estimate_max_speed() == pytest.approx(math.hypot(0.6, 1.8))
    block = rts.Block((0.5, 0.5), (0.6, 0.8), velocity=stretch)
    assert scene(fluids=[block], gravity=(0, 0)).wave_speed == pytest.approx(10 * math.hypot(0.6, 1.8))
    assert scene(fluids=[drop]).estimate_max_speed() == pytest.approx(math.sqrt(0.36 + 3.24 + 2 * 9.81 * 0.9))
    assert scene(body_force=CENTRAL, sound_speed=7).wave_speed == 7.0


def test_toml_file(tmp_path):
    path = write(tmp_path, TOML)
    loaded = rts.load_scene(path)
    assert loaded == scene(name="my_scene")
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


def test_unreadable_files(tmp_path):
    with pytest.raises(rts.SceneError, match=r"none\.toml' cannot be read: No such file.*check the path"):
        rts.load_scene(tmp_path / "none.toml")
    with pytest.raises(rts.SceneError, match="not valid TOML"):
        rts.load_scene(write(tmp_path, "spacing = = 1"))
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe")
    with pytest.raises(rts.SceneError, match="not valid TOML"):
        rts.load_scene(binary)


def test_unknown_scene_lists_the_known_ones():
    with pytest.raises(rts.SceneError, match=r"'dam' is unknown; choose one of dam_break, dam_break_2d,.*\.toml file"):
        rts.load_scene("dam")
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
    assert 0.5 / spacing**3 == pytest.approx(count, rel=1e-9)


@pytest.mark.parametrize("text", ["x", "", "-5", "0", "nan", "inf", "1e12", "1.5G"])
def test_impossible_particle_counts(text):
    with pytest.raises(rts.SceneError, match=r"is not a count from 1 to 2147483647; write e\.g\. 30000, 30k or 1\.5M"):
        rts.load_scene("dam_break", particles=text)


def test_particles_and_spacing_exclude_each_other():
    with pytest.raises(rts.SceneError, match=r"particles '1k' and spacing 0\.1 are both given; give one"):
        rts.load_scene("dam_break", particles="1k", spacing=0.1)


def test_stepper_parameters_are_validated_together():
    with pytest.raises(rts.StepperError) as caught:
        rts.Regional(levels=0, courant=3, preset="papr", alpa=1)
    for part in ("levels", "courant", "(got 3)", "preset", "'paper'", "did you mean 'alpha'?"):
        assert part in str(caught.value)
    with pytest.raises(rts.StepperError, match="'serna' or 'symplectic_euler'"):
        rts.Uniform(integrator="euler")


def test_presets_of_the_regional_stepper():
    paper = rts.Regional(preset="paper")
    assert [paper.resolved(key) for key in ("courant", "levels", "strict_cfl")] == [0.4, 3, False]
    assert rts.Regional(preset="paper", levels=5, courant=0.2).resolved("levels") == 5
    assert rts.Regional(preset="paper", levels=5, courant=0.2).resolved("courant") == 0.2
    assert rts.Regional(levels=1).resolved("courant") == rts.Uniform().courant


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"spacing": "20 mm"}, "spacing: '20 mm' is a text; give a plain number in SI units, 0.02"),
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


def test_a_scene_with_everything_comes_back_from_plain_data(tmp_path):
    cloud = np.array([[0.65, 0.85], [0.75, 0.85]])
    rts.write_particles(tmp_path / "cloud.ply", rts.ParticleFrame(cloud, {}, 0.0, 0.1))
    everything = scene(
        fluids=[
            rts.Block((0, 0), (0.3, 0.3), velocity=rts.LinearField(((0, 1), (1, 0))), colour="red"),
            rts.Block((0.3, 0), (0.6, 0.3), kinematic_viscosity=0.1),
            rts.Sphere((0.3, 0.7), 0.1, velocity=(1, 0), colour="#00ff00"),
            rts.Particles(file=str(tmp_path / "cloud.ply"), translation=(0.0, 0.05), colour="blue"),
        ],
        gravity=(0, -1),
        gravity_changes=[rts.GravityChange(0.5, (1, 0))],
        body_force=rts.LinearField(((-1, 0), (0, -1)), value=(0.1, 0)),
        sound_speed=20,
        kernel="wendland_c2",
        support_ratio=2.5,
        rest_density=900,
        artificial_viscosity=0.1,
        kinematic_viscosity=0.01,
        hydrostatic=True,
        moving_walls=[rts.MovingWall("x+", (0, 1), (0, -0.1))],
        inflows=[rts.Inflow((0, 0.5), (0, 0.7), (1, 0), 0.1, 0.2)],
        outlets=[rts.Outlet((0, 0.75), (0.25, 1))],
        probes=[rts.Probe((0.1, 0.1), "low")],
        gauges=[rts.Gauge((0.2, 0))],
        obstacles=[
            rts.BoxObstacle((0.6, 0.3), (0.8, 0.5), rotation=10, motion=rts.ConstantMotion((0.1, 0), 0.5, stop=1)),
            rts.SphereObstacle((0.8, 0.2), 0.1, rts.Keyframes((0, 1), ((0, 0), (0.1, 0)), (0, 90))),
            rts.PolygonObstacle(((0.4, 0.4), (0.55, 0.4), (0.4, 0.55))),
        ],
        end_time=2,
        view=rts.View(zoom=2),
        name="all",
        description="everything",
    )
    plain = json.loads(json.dumps(everything.to_dict()))
    assert scene_from(plain) == everything
    left_out = {"periodic", "walls", "background_pressure", "density"}  # their defaults, which go with the rest
    unlike = {
        f.name for f in dataclasses.fields(rts.Scene) if getattr(everything, f.name) != getattr(scene(), f.name, 0)
    }
    assert set(rts.Scene.__dataclass_fields__) - unlike <= left_out | {"domain", "spacing"}
    np.testing.assert_allclose(everything.fluids[3].positions, cloud + np.array([0.0, 0.05]))
    assert everything.fluid_colours == ("red", None, "#00ff00", "blue", None)


def test_messages_shorten_long_lists():
    times = [*(0.01 * k for k in range(400)), 0.0]
    with pytest.raises(rts.SceneError) as raised:
        rts.MovingWall("x-", times=times, displacements=[0.0] * 401)
    assert str(raised.value) == "MovingWall: times (0.0, 0.01, 0.02, ..., 0.0) (401 entries) must ascend"
    with pytest.raises(rts.SceneError, match=r"times \(0.0, 2.0, 1.0\) must ascend"):
        rts.MovingWall("x-", times=[0, 2, 1], displacements=[0, 0, 0])
