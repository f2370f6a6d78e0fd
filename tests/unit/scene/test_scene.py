"""Scenes: what may be wrong between their fields, and what follows from them."""

import dataclasses
import json
import math

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.scene.loading import scene_from

UNIT = rts.Box((0, 0), (1, 1))
DAM = rts.Block((0, 0), (0.5, 0.5))
DROP = rts.Sphere((0.7, 0.7), 0.2)
CENTRAL = rts.LinearField(((-1, 0), (0, -1)))


def scene(**changes):
    return rts.Scene(**({"domain": UNIT, "fluids": [DAM], "spacing": 0.1} | changes))


def complaint(**changes):
    with pytest.raises(rts.SceneError) as caught:
        scene(**changes)
    return str(caught.value)


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"kernel": "gauss"}, ["kernel", "cubic_spline", "wendland_c2", "gauss"]),
        ({"density": "guess"}, ["density", "summation", "continuity", "guess"]),
        ({"support_ratio": 5}, ["support_ratio", "less than or equal to 4", "5"]),
        (
            {"support_ratio": 3, "density": "continuity"},
            ["support_ratio: 3 with kernel 'cubic_spline'", "at most 2.75", "'wendland_c2'"],
        ),
        (
            {"fluids": [rts.Sphere((0.5, 0.9), 0.2)]},
            [
                "fluids.0: sphere of radius 0.2 around (0.5, 0.9) leaves the domain from (0.0, 0.0) to (1.0, 1.0); move or"
            ],
        ),
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
    ],
)
def test_each_fault_names_value_limit_and_remedy(changes, parts):
    message = complaint(**changes)
    assert message.startswith("Scene: ")
    for part in parts:
        assert part in message


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
        gravity_interpolation="linear",
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


@pytest.mark.parametrize(
    ("changes", "up"),
    [
        ({}, (0.0, 1.0, 0.0)),
        ({"gravity": (0, 0, -9.81)}, (0.0, 0.0, 1.0)),
        ({"gravity": (3, 0, 4)}, (-0.6, 0.0, -0.8)),
        ({"gravity": (0, 0, 0)}, (0.0, 1.0, 0.0)),
        ({"gravity": (0, 0, 0), "gravity_changes": [rts.GravityChange(0.5, (0, 0, -1))]}, (0.0, 0.0, 1.0)),
        ({"gravity": (0.8, 0, 0), "periodic": ("x",)}, (0.0, 1.0, 0.0)),  # drives a flow, and is no weight
    ],
)
def test_up_is_against_gravity(changes, up):
    box = rts.Box((0, 0, 0), (1, 1, 1))
    scene = rts.Scene(domain=box, fluids=[rts.Block((0, 0, 0), (1, 1, 1))], spacing=0.1, sound_speed=20.0, **changes)
    assert scene.up == pytest.approx(up, abs=0.0)
