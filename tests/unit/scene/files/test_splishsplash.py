import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.sampling.sampling import sample
from taichi_rts.scene.files.splishsplash_bodies import area, as_box, section
from taichi_rts.scene.files.splishsplash_fluids import block, inflow
from taichi_rts.scene.files.splishsplash_format import Emitter, FluidBlock
from taichi_rts.scene.loading import scene_from

CORNERS = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
FACES = [(1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2), (3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5)]
FACES += [(2, 6, 8), (2, 8, 4)]
TANK = {"geometryFile": "../models/cube.obj", "translation": [0, 1, 0], "scale": [2, 2, 1], "isWall": True}
TANK |= {"mapInvert": True}
DAM = {"start": [-0.5, 0.0, -0.5], "end": [0.5, 1.0, 0.5], "translation": [-0.5, 0.0, 0.0], "scale": [0.8, 1, 1]}
INSTALLED = Path(sys.prefix) / "bin" / "data" / "Scenes"


@pytest.fixture
def load(tmp_path):
    """Return a function that writes a scene of these parts beside a folder of models, and loads it with its warnings."""
    (tmp_path / "models").mkdir()
    (tmp_path / "scenes").mkdir()
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {a} {b} {c}" for a, b, c in FACES]
    (tmp_path / "models" / "cube.obj").write_text("\n".join(lines))

    def build(name="dam.json", **parts):
        configuration = {"particleRadius": 0.05, "simulationMethod": 0} | parts.pop("Configuration", {})
        data = {"Configuration": configuration, "RigidBodies": [TANK], "FluidBlocks": [DAM]} | parts
        path = tmp_path / "scenes" / name
        path.write_text(json.dumps(data))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            scene = rts.load_scene(path)
        return scene, [str(each.message) for each in caught if each.category is UserWarning]

    build.folder = tmp_path
    return build


def test_a_dam_break_is_read_as_it_is(load):
    configuration = {"gravitation": [0, -5, 0.5], "stopAt": 1.5, "timeStepSize": 0.002, "cflMethod": 1}
    configuration |= {"cameraPosition": [0, 2, 5], "cameraLookat": [0, 0.5, 0], "kernel": 1}
    scene, messages = load(Configuration=configuration)
    assert messages == []
    assert (scene.name, scene.spacing, scene.end_time, scene.kernel) == ("dam", 0.1, 1.5, "wendland_c2")
    assert (scene.domain.lower, scene.domain.upper) == ((-1.0, 0.0, -0.5), (1.0, 2.0, 0.5))
    assert scene.acceleration == (0.0, -5.0, 0.5)
    assert (scene.view.eye, scene.view.target) == ((0.0, 2.0, 5.0), (0.0, 0.5, 0.0))
    # 0.8 and 1 long: 8 and 10 diameters, so 7 and 9 particles, the first one diameter inside
    x = sample(scene).positions
    assert len(x) == 7 * 9 * 9
    np.testing.assert_allclose(x.min(axis=0), (-0.9 + 0.1, 0.1, -0.4), atol=1e-9)
    np.testing.assert_allclose(x.max(axis=0), (-0.2, 0.9, 0.4), atol=1e-9)
    assert scene.volume == pytest.approx(0.7 * 0.9 * 0.9)


@pytest.mark.parametrize(("length", "count"), [(0.25, 2), (0.36, 3), (0.34, 2), (1.0, 9)])
def test_edges_are_rounded_as_there(length, count):
    data = block(FluidBlock(start=(0, 0, 0), end=(length, 1, 1)), 0.1, 3)
    assert (data["upper"][0] - data["lower"][0]) / 0.1 == pytest.approx(count)
    assert block(FluidBlock(start=(0, 0, 0), end=(0.2, 1, 1)), 0.1, 3) is None


def test_what_cannot_be_honoured_is_one_warning(load):
    material = {
        "id": "Fluid",
        "elasticityMethod": 3,
        "viscosityMethod": 2,
        "Bender and Koschier 2017": {"viscosity": 0.5},
    }
    ball = {"geometryFile": "../models/cube.obj", "isDynamic": 1, "translation": [0.5, 1.0, 0.0], "scale": [0.3] * 3}
    scene, (message,) = load(
        Configuration={"simulationMethod": 4, "scriptFile": "evil.py", "imteStepSize": 1, "color": [1]},
        Materials=[material | {"surfaceTensionMethod": 1}],
        RigidBodies=[TANK, ball],
        AnimationFields=[{"particleField": "velocity"}],
        BallJoints=[{"bodyID1": 1}],
    )
    for part in (
        "dam.json: not honoured: ",
        "DFSPH (weakly compressible SPH instead)",
        "elasticity of Fluid (method 3)",
        "surface tension of Fluid (method 1)",
        "viscosityMethod 2 of Fluid",
        "RigidBodies.1.isDynamic (it stays where it is)",
        "scriptFile 'evil.py'",
        "Configuration.imteStepSize (did you mean 'timeStepSize'?)",
        "animation fields",
        "BallJoints.0",
    ):
        assert part in message
    assert scene.kinematic_viscosity == 0.0
    assert len(scene.obstacles) == 1


def test_materials_give_each_fluid_its_viscosity_and_colour(load):
    oil = {"id": "oil", "viscosityMethod": 6, "Weiler et al. 2018": {"viscosity": 2.0}, "density0": 900}
    water = {"id": "water", "viscosityMethod": 1, "Standard viscosity": {"viscosity": 0.01}}
    old = {"id": "old", "viscosityMethod": 1, "viscosity": 0.03}
    right = {"start": [0.2, 0.0, -0.5], "end": [0.7, 0.5, 0.5], "id": "oil"}
    top = {"start": [0.2, 0.8, -0.5], "end": [0.7, 1.5, 0.5], "id": "old", "initialVelocity": [1, 0, 0]}
    scene, (message,) = load(Materials=[oil, water, old], FluidBlocks=[DAM | {"id": "water"}, right, top])
    assert scene.viscosities == (0.01, 2.0, 0.03)
    assert len(set(scene.fluid_colours)) == 3
    assert scene.rest_density == 1000.0
    assert "density0 of oil, old (a scene has one rest density: 1000 kg/m^3)" in message
    assert scene.fluids[2].velocity == (1.0, 0.0, 0.0)


def test_a_fluid_may_turn_at_the_start(load):
    scene, _ = load(FluidBlocks=[DAM | {"initialAngularVelocity": [0, 0, 2.0], "initialVelocity": [0, 1, 0]}])
    start = sample(scene)
    middle = start.positions.mean(axis=0)
    np.testing.assert_allclose(start.velocities.mean(axis=0), (0, 1, 0), atol=1e-9)
    arm = start.positions[0] - middle
    np.testing.assert_allclose(start.velocities[0], (-2 * arm[1], 1 + 2 * arm[0], 0), atol=1e-9)


def test_a_turned_box_stands_where_its_mesh_does(load):
    turned = {"geometryFile": "../models/cube.obj", "translation": [0.5, 0.8, 0.1], "scale": [0.4, 0.2, 0.3]}
    turned |= {"rotationAxis": [1, 1, 0], "rotationAngle": 0.7}
    scene, messages = load(RigidBodies=[TANK, turned])
    (box,) = scene.obstacles
    assert isinstance(box, rts.BoxObstacle)
    assert messages == []
    axis = np.array([1, 1, 0]) / np.sqrt(2)
    np.testing.assert_allclose(box.rotation, np.degrees(0.7) * axis, rtol=1e-9)
    np.testing.assert_allclose(box.upper, np.array([0.5, 0.8, 0.1]) + np.array([0.2, 0.1, 0.15]), rtol=1e-9)


def test_a_flat_scene_has_two_components(load):
    turned = {"geometryFile": "../models/cube.obj", "translation": [0.5, 0.8, 0], "scale": [0.4, 0.2, 1]}
    turned |= {"rotationAxis": [0, 0, -1], "rotationAngle": 0.5}
    scene, messages = load(Configuration={"sim2D": True}, RigidBodies=[TANK, turned])
    assert (scene.dim, messages) == (2, [])
    assert len(sample(scene).positions) == 7 * 9
    np.testing.assert_allclose(scene.obstacles[0].rotation, [np.degrees(-0.5)])


def test_a_mesh_becomes_its_section_in_a_flat_scene():
    trimesh = pytest.importorskip("trimesh")
    loop = section("RigidBodies.0", trimesh.creation.icosphere(4, radius=0.5))
    assert abs(area(loop)) == pytest.approx(np.pi * 0.25, rel=0.01)
    np.testing.assert_allclose(np.linalg.norm(loop, axis=1), 0.5, rtol=0.01)


def test_without_a_container_there_are_walls_around(load):
    plate = {"geometryFile": "../models/cube.obj", "translation": [0, -0.25, 0], "scale": [3, 0.5, 3]}
    scene, (message,) = load(RigidBodies=[plate])
    assert "no container (walls around everything and some room: " in message
    assert scene.domain.lower[1] == -0.5  # nothing falls below the plate
    assert scene.domain.lower[0] == pytest.approx(-1.5 - 0.1 * np.ceil(7.5 + 2))
    assert scene.domain.upper[1] >= 1.0 + 0.75


def test_where_nothing_moves_the_largest_step_sizes_the_sound_speed(load):
    slow = {"gravitation": [0, 0, 0], "cflFactor": 0.5, "cflMaxTimeStepSize": 0.01}
    assert load(Configuration=slow)[0].wave_speed == pytest.approx(10 * 0.4 * 0.5 * 0.1 / 0.01)
    fixed = slow | {"cflMethod": 0, "timeStepSize": 0.005}
    assert load(Configuration=fixed)[0].wave_speed == pytest.approx(10 * 0.4 * 0.5 * 0.1 / 0.005)


def test_fluid_beyond_the_walls_or_inside_bodies_is_left_out(load):
    high = {"start": [0.2, 1.5, -0.3], "end": [0.7, 2.5, 0.3]}
    scene, (message,) = load(FluidBlocks=[DAM, high])
    assert "fluid outside the walls" in message
    assert len(sample(scene).positions) == 7 * 9 * 9 + 4 * 4 * 5
    shell = {"geometryFile": "../models/cube.obj", "translation": [0.5, 1.0, 0.0], "scale": [0.8, 0.8, 0.8]}
    inner = {"start": [0.3, 0.8, -0.2], "end": [0.7, 1.2, 0.2]}
    scene, (message,) = load(FluidBlocks=[DAM, inner], RigidBodies=[TANK, shell])
    assert "fluid inside a rigid body (1 blocks left out: bodies are solid)" in message
    assert len(scene.fluids) == 1


def test_an_emitter_on_a_wall_is_an_inflow(load):
    near = {"width": 3, "height": 4, "translation": [-0.8, 1.0, 0.0], "velocity": 2, "emitEndTime": 0.5}
    middle = {"width": 3, "translation": [0.0, 1.5, 0.0], "rotationAxis": [0, 1, 0], "rotationAngle": 0.3}
    scene, (message,) = load(Emitters=[near, middle])
    (found,) = scene.inflows
    np.testing.assert_allclose(found.lower, (-1.0, 0.8, -0.15))
    np.testing.assert_allclose(found.upper, (-1.0, 1.2, 0.15))
    assert (found.velocity, found.stop) == ((2.0, 0.0, 0.0), 0.5)
    assert "Emitters.0 (moved 0.2 m back onto the wall)" in message
    assert "Emitters.1 (left out: it looks along no axis)" in message


def test_a_round_emitter_keeps_its_area():
    lower, upper = np.array([-1.0, -1.0, -1.0]), np.array([1.0, 1.0, 1.0])
    down = Emitter(width=6, type=1, translation=(0, 1, 0), rotationAxis=(0, 0, -1), rotationAngle=np.pi / 2)
    data, remark = inflow(down, lower, upper, 0.1, 1.0)
    size = np.subtract(data["upper"], data["lower"])
    assert size[0] * size[2] == pytest.approx(np.pi * 0.3**2)
    assert (remark, data["velocity"]) == ("made square", [0.0, -1.0, 0.0])


def test_a_particle_file_is_placed_and_comes_back_from_plain_data(load):
    x = np.stack(np.meshgrid(*[0.05 + 0.1 * np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    rts.write_particles(load.folder / "models" / "cloud.bgeo", rts.ParticleFrame(x, {}, 0.0, None))
    model = {"particleFile": "../models/cloud.bgeo", "translation": [0.3, 1.0, 0.0], "scale": [1, 1, 1]}
    model |= {"rotationAxis": [0, 1, 0], "rotationAngle": np.pi / 2}
    scene, messages = load(FluidModels=[model], FluidBlocks=[])
    placed = np.stack([x[:, 2], x[:, 1], -x[:, 0]], axis=1) + np.array([0.3, 1.0, 0.0])
    np.testing.assert_allclose(scene.fluids[0].positions, placed, atol=1e-6)
    assert messages == []
    again = scene_from(json.loads(json.dumps(scene.to_dict())))
    assert again == scene  # a checkpoint keeps no more than this
    scene, (message,) = load(FluidModels=[model, model | {"particleFile": "../models/cube.obj"}])
    assert "FluidModels.1.particleFile '../models/cube.obj' (only .vtu, .ply" in message


def test_a_motor_turns_its_body(load):
    paddle = {"id": 7, "geometryFile": "../models/cube.obj", "isDynamic": True, "translation": [0.5, 0.5, 0]}
    joint = {"bodyID1": 7, "bodyID2": 0, "position": [0.5, 0, 0], "axis": [0, 2, 0], "target": -6}
    scene, messages = load(
        RigidBodies=[TANK, paddle | {"scale": [0.6, 0.1, 0.2]}], TargetVelocityMotorHingeJoints=[joint]
    )
    assert messages == []
    assert scene.obstacles[0].motion.angular_velocity == (0.0, -6.0, 0.0)
    assert scene.obstacles[0].motion.pivot == (0.5, 0.0, 0.0)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (
            {"Configuration": {"particleRadius": -1, "gravitation": [0, 1]}, "FluidBlocks": [{"start": [0, 0, "a"]}]},
            [
                "Configuration.particleRadius: ",
                "(got -1)",
                "Configuration.gravitation",
                "FluidBlocks.0.start.2",
                "FluidBlocks.0.end: missing",
            ],
        ),
        ({"Configuration": {"gravitation": [0, float("nan"), 0]}}, ["Configuration.gravitation.1", "nan"]),
        ({"FluidBlocks": []}, ["holds no fluid; give it FluidBlocks or FluidModels"]),
        ({"FluidBlocks": [], "Emitters": [{}]}, ["only emitters; give it FluidBlocks or FluidModels"]),
        (
            {"RigidBodies": [TANK | {"geometryFile": "../models/no.obj"}]},
            ["RigidBodies.0.geometryFile", "no.obj", "check the path"],
        ),
        (
            {"RigidBodies": [TANK | {"geometryFile": "../../secret.obj"}]},
            ["RigidBodies.0.geometryFile", "secret.obj", "leaves", "put it there"],
        ),
        ({"FluidModels": [{"particleFile": "no.bgeo"}]}, ["FluidModels.0", "no.bgeo", "check the path"]),
        ({"RigidBodies": TANK}, ["RigidBodies: is one table; write it as a list"]),
    ],
)
def test_every_fault_has_its_place_in_the_file(load, parts, words):
    with pytest.raises(rts.SceneError) as caught:
        load(**parts)
    for word in ["dam.json", *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "is not valid JSON"),
        ("[1]", "holds a list"),
        ("[" * 100_000, "is not valid JSON"),
        ("{}", "domain: missing"),
    ],
)
def test_what_is_no_scene_is_refused(tmp_path, text, words):
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(rts.SceneError, match=words):
        rts.load_scene(path)


def test_boxes_are_told_from_other_meshes():
    corners = np.array(CORNERS)
    low, high = as_box(np.concatenate([corners, corners]))
    np.testing.assert_array_equal([low, high], [[-0.5] * 3, [0.5] * 3])
    assert as_box(corners[:-1]) is None
    assert as_box(np.concatenate([corners, [[0.0, 0.0, 0.5]]])) is None
    assert as_box(corners * [1, 1, 0]) is None


def test_it_runs(load, simulate):
    scene, _ = load(Configuration={"sim2D": True}, Materials=[{"id": "Fluid", "viscosityMethod": 1, "viscosity": 0.01}])
    sim = simulate(scene, rts.Uniform())
    sim.advance_to(0.02)
    assert sim.count == 63
    fallen = sample(scene).positions[:, 1].mean() - sim.positions()[:, 1].mean()
    assert fallen == pytest.approx(0.5 * 9.81 * 0.02**2, rel=0.05)


@pytest.mark.skipif(not INSTALLED.is_dir(), reason="pysplishsplash is not installed")
@pytest.mark.parametrize(
    ("name", "fluid", "obstacles", "inflows"),
    [
        ("DamBreakModel", 6859, 0, 0),
        ("DamBreakModel_2D", 841, 0, 0),
        ("DoubleDamBreakWithSphere", 11492, 1, 0),
        ("Emitter", 1938, 0, 1),
        ("Obstacle", 10212, 1, 0),
        ("DeformableBunnies", 8416, 1, 0),
    ],
)
def test_its_own_scenes_have_as_many_particles_as_there(name, fluid, obstacles, inflows):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = rts.load_scene(INSTALLED / f"{name}.json")
    assert (len(scene.obstacles), len(scene.inflows)) == (obstacles, inflows)
    assert round(scene.volume / scene.spacing**scene.dim) == fluid  # what pysplishsplash 2.19.0 counts
