import math

import pytest

import taichi_rts as rts
from taichi_rts.scene import parse_count

UNIT = rts.Box((0, 0), (1, 1))
DAM = rts.Block((0, 0), (0.5, 0.5))
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
        ({"density": "continuity"}, ["density", "summation", "continuity"]),
        ({"support_ratio": 5}, ["support_ratio", "less than or equal to 4", "5"]),
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


@pytest.mark.parametrize("shape", [rts.Box, rts.Block])
def test_corners(shape):
    with pytest.raises(rts.SceneError, match=r"upper \(1\.0, 0\.0\) must exceed lower \(0\.0, 0\.0\)"):
        shape((0, 0), (1, 0))
    with pytest.raises(rts.SceneError, match="differ in dimension; give both 2 or both 3"):
        shape((0, 0), (1, 1, 1))
    with pytest.raises(rts.SceneError, match="finite"):
        shape((0, math.nan), (1, 1))


def test_velocity_of_a_block_has_its_dimension():
    with pytest.raises(rts.SceneError, match="has 3 components; the block has 2"):
        rts.Block((0, 0), (1, 1), velocity=(0, 0, 1))


def test_blocks_may_touch_each_other_and_the_walls():
    third = 1 / 3
    assert scene(fluids=[rts.Block((0, 0), (third, 1)), rts.Block((third, 0), (1, 1))]).dim == 2
    assert scene(fluids=[rts.Block((0, 0), (0.1 + 0.2, 0.3)), rts.Block((0.3, 0), (1, 0.3))]).dim == 2


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
    assert set(required.split()) | {"dam_break_2d", "double_dam_break_2d"} <= set(names)
    for name in names:
        loaded = rts.load_scene(name)
        assert loaded.name == name
        assert loaded.dim == (2 if name.endswith("_2d") else 3)
        assert loaded.description


def test_plain_data_survives_a_round_trip():
    data = rts.load_scene("dam_break_drop").to_dict()
    data["domain"] = rts.Box(**data["domain"])
    data["fluids"] = [rts.Block(**block) for block in data["fluids"]]
    data["view"] = rts.View(**data["view"])
    assert rts.Scene(**data) == rts.load_scene("dam_break_drop")


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
