"""Obstacles before a run: descriptions, faults, geometry, wall particles, fluid left out."""

import os
from pathlib import Path

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.medium.smoothing import make_kernel
from taichi_rts.sampling.lining import line_solid
from taichi_rts.sampling.sampling import sample
from taichi_rts.sampling.walls import calibrate_walls
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.loading import scene_from
from taichi_rts.scene.obstacles.making import MOST_KEPT, make_solid
from taichi_rts.scene.obstacles.solid import distance_grid
from taichi_rts.scene.parts.rotations import rotation_matrix

MESHES = Path(__file__).parents[4] / "assets" / "obstacles"
BALL, WEDGE = (str(MESHES / f"{name}.obj") for name in ("ball", "wedge"))
S = 0.04


def scene(dim=2, **changes):
    fields = {"domain": rts.Box((0,) * dim, (1,) * dim), "fluids": [rts.Block((0,) * dim, (1,) * dim)], "spacing": S}
    return rts.Scene(**(fields | changes))


def complaint(dim=2, **changes):
    with pytest.raises(rts.SceneError) as caught:
        scene(dim, **changes)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return message


BOX = rts.BoxObstacle((0.4, 0.4), (0.6, 0.6))
MOVE = rts.ConstantMotion(velocity=(1, 0))


@pytest.mark.parametrize(
    ("obstacle", "parts"),
    [
        (rts.SphereObstacle((0.5, 0.5, 0.5), 0.1), ["obstacles.0: sphere has 3 dimensions; the domain has 2"]),
        (
            rts.BoxObstacle((0.4, 0.4), (0.6, 0.6), rotation=(0, 0, 1)),
            ["rotation (0.0, 0.0, 1.0) has 3 components", "give 1"],
        ),
        (
            rts.SphereObstacle((0.5, 0.5), 0.1, motion=rts.ConstantMotion(velocity=(0, 0, 1))),
            ["motion.velocity (0.0, 0.0, 1.0) has 3 components; in 2 dimensions give 2"],
        ),
        (
            rts.SphereObstacle((0.5, 0.5), 0.1, motion=rts.Keyframes((0, 1), rotations=((0, 0, 0), (0, 0, 9)))),
            ["motion.rotations (0.0, 0.0, 0.0) has 3 components; in 2 dimensions give 1"],
        ),
    ],
)
def test_an_obstacle_that_does_not_fit_the_scene_is_refused(obstacle, parts):
    message = complaint(obstacles=[obstacle])
    assert all(part in message for part in parts), message


def test_an_obstacle_across_a_periodic_face_is_refused():
    box = rts.BoxObstacle((0.8, 0.4), (1.1, 0.6))
    assert "crosses a periodic face of the domain; move it inside" in complaint(periodic=("x",), obstacles=[box])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rts.ConstantMotion(), "moves nothing; give velocity"),
        (lambda: rts.ConstantMotion(velocity=(1, 0), start=2, stop=1), "stop 1.0 must exceed start 2.0"),
        (lambda: rts.Keyframes((0, 1)), "moves nothing; give displacements"),
        (lambda: rts.Keyframes((0, 0), ((0, 0), (1, 0))), r"times \(0.0, 0.0\) must ascend"),
        (lambda: rts.Keyframes((0, 1), ((0, 0), (1, 0), (2, 0))), "times has 2 entries, displacements 3; give as many"),
        (
            lambda: rts.Keyframes((0, 1), ((1, 0), (1, 0))),
            r"displacements begin with \(1.0, 0.0\); the first must be 0",
        ),
        (lambda: rts.Keyframes((0, 1), rotations=(0, (0, 0, 1))), "rotations differ in their number of components"),
        (lambda: rts.BoxObstacle((0, 0), (0, 1)), "upper .* must exceed lower"),
        (lambda: rts.CylinderObstacle((0, 0, 0), (0, 0, 0), 1), "give the axis a length"),
        (lambda: rts.PolygonObstacle(((0, 0), (1, 0), (2, 0))), "enclose no area"),
        (lambda: scene(obstacles=[{"shape": "box", "lower": [0, 0], "uper": [1, 1]}]), "uper: unknown key"),
    ],
)
def test_parts_are_checked_by_themselves(make, message):
    with pytest.raises(rts.SceneError, match=message):
        make()


def write_wedge(path, change):
    lines = Path(WEDGE).read_text().splitlines()
    path.write_text("\n".join(change(lines)))
    return str(path)


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (lambda lines: ["v " + " ".join(str(1000 * float(w)) for w in x.split()[1:]) if x[0] == "v" else x for x in lines],
         ["mesh is 400 m across, the domain 1 m", "set scale, 0.001 if it is in mm (now 1)"]),
        (lambda lines: lines[:6], ["holds no triangles"]),
    ],
    ids=["millimetres", "empty"],
)  # fmt: skip
def test_a_mesh_that_cannot_be_used_is_refused(tmp_path, change, parts):
    pytest.importorskip("trimesh")
    message = complaint(3, obstacles=[rts.MeshObstacle(write_wedge(tmp_path / "bad.obj", change))])
    assert all(part in message for part in ["obstacles.0: ", *parts]), message


def test_a_mesh_is_read_once_for_each_description(tmp_path):
    pytest.importorskip("trimesh")
    file = write_wedge(tmp_path / "moving.obj", lambda lines: lines)
    spin = rts.ConstantMotion(angular_velocity=(0, 0, 2))
    made = scene(3, obstacles=[rts.MeshObstacle(file, translation=(0.5, 0.5, 0.5), motion=spin)])
    os.remove(file)
    solid = make_solid(made.obstacles[0], S)
    assert make_solid(made.obstacles[0], S, made.domain) is solid  # on which the domain has no influence
    reach = np.linalg.norm(solid.upper - solid.middle)
    assert made.wall_speed == pytest.approx(2 * reach, rel=1e-12)
    for k in range(MOST_KEPT):
        make_solid(rts.SphereObstacle((k, 0), 1), S)
    assert make_solid(made.obstacles[0], S) is not solid  # which is no longer kept, but the mesh is
    assert made.wall_speed == pytest.approx(2 * reach, rel=1e-12)


def test_scene_files_hold_obstacles():
    pytest.importorskip("trimesh")
    loaded = rts.load_scene(MESHES / "dam_break_meshes.toml")
    assert [obstacle.shape for obstacle in loaded.obstacles] == ["mesh", "mesh", "box"]
    assert loaded.obstacles[0].file == BALL
    assert loaded.obstacles[2].motion == rts.ConstantMotion(angular_velocity=(0, 0, 3))
    assert scene_from(loaded.to_dict()) == loaded


def test_a_body_follows_its_keyframes():
    table = rts.Keyframes((1, 2, 4), ((0, 0), (0.2, 0), (0.2, 0.1)), rotations=(0, 90, 810), pivot=(0.4, 0.5))
    body = bodies(scene(obstacles=[rts.BoxObstacle((0.4, 0.4), (0.6, 0.6), motion=table)]))[0]
    corner = np.array([[0.6, 0.5]])
    np.testing.assert_allclose(body.place(corner, 0.5), corner)
    np.testing.assert_allclose(body.place(corner, 1.5), [[0.5 + 0.2 * np.sqrt(0.5), 0.5 + 0.2 * np.sqrt(0.5)]])
    np.testing.assert_allclose(body.place(corner, 2), [[0.6, 0.7]], atol=1e-12)
    np.testing.assert_allclose(body.place(corner, 3), [[0.6, 0.75]], atol=1e-12)  # a whole turn further, twice as slow
    np.testing.assert_allclose(body.displace(body.place(corner, 3.7), 3.7), corner, atol=1e-12)
    assert body.top_speed == pytest.approx(0.05 + 2 * np.pi * np.hypot(0.2, 0.1))


@pytest.mark.parametrize(("a", "b"), [((0.3, 0, 0), (0, 0.4, 0)), ((1, 2, 0), (0, -1, 2)), ((0, 0, 1), (0, 0, 8))])
def test_rotations_between_keyframes_end_where_the_next_begins(a, b):
    pieces = rts.Keyframes((0, 1, 2), rotations=((0, 0, 0), tuple(np.degrees(a)), tuple(np.degrees(b)))).pieces(3)
    np.testing.assert_allclose(pieces.pose(2 - 1e-12)[1], rotation_matrix(b), atol=1e-9)


SOLIDS = {
    "box": (rts.BoxObstacle((0.2, 0.2, 0.2), (0.6, 0.5, 0.7), rotation=(0, 0, 30)), 0.4 * 0.3 * 0.5),
    "sphere": (rts.SphereObstacle((0.5, 0.5, 0.5), 0.2), 4 / 3 * np.pi * 0.2**3),
    "cylinder": (rts.CylinderObstacle((0.3, 0.3, 0.5), (0.7, 0.6, 0.5), 0.15), np.pi * 0.15**2 * 0.5),
    "ball": (rts.MeshObstacle(BALL, scale=2.0, translation=(0.5, 0.3, 0.5)), 4 / 3 * np.pi * 0.2**3),
    "wedge": (rts.MeshObstacle(WEDGE, rotation=(0, 40, 0), translation=(0.3, 0.3, 0.5)), 0.4 * 0.2 * 0.3 / 2),
    "disc": (rts.SphereObstacle((0.5, 0.5), 0.2), np.pi * 0.2**2),
    "polygon": (rts.PolygonObstacle(((0.2, 0.2), (0.8, 0.2), (0.5, 0.7))), 0.6 * 0.5 / 2),
}


CORNER = {dim: rts.Block((0,) * dim, (0.1,) * dim) for dim in (2, 3)}


@pytest.mark.parametrize("name", SOLIDS)
def test_geometry_and_wall_particles(name):
    obstacle, volume = SOLIDS[name]
    if obstacle.shape == "mesh":
        pytest.importorskip("trimesh")
    solid = make_solid(obstacle, S)
    dim = len(solid.lower)
    grid = distance_grid(solid, S)
    x = np.random.default_rng(0).uniform(solid.lower - S, solid.upper + S, (20_000, dim))
    box = np.prod(solid.upper - solid.lower + 2 * S)
    assert (solid.distance(x) < 0).mean() * box == pytest.approx(volume, rel=0.05)
    assert grid.at(solid.surface(0.1 * S)).max() < 0.02 * S  # no point that is outside by the grid is inside
    assert np.abs(grid.at(x) - solid.distance(x)).max() < 0.5 * S
    depth, _ = calibrate_walls(scene(dim))
    walls, normals = line_solid(solid, depth, S)
    deep = -solid.distance(walls)
    assert deep.max() < 1.02 * depth
    assert np.median(deep) > 0.9 * depth
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    gaps = np.sqrt(((walls[:, None] - walls) ** 2).sum(axis=2) + 1e9 * np.eye(len(walls))).min(axis=1) / S
    assert 0.8 < gaps.mean() < 1.05
    assert gaps.std() < 0.15
    assert gaps.min() > 0.45


def density(made, x):
    kernel, start = make_kernel(made.kernel, made.dim, made.support), sample(made)
    rho = start.mass * kernel.sample(np.linalg.norm(x[:, None] - start.positions, axis=2)).sum(axis=1)
    for layer in (start.walls, *start.obstacles):
        rho += 1000.0 * (kernel.sample(np.linalg.norm(x[:, None] - layer.positions, axis=2)) * layer.volumes).sum(
            axis=1
        )
    return rho


@pytest.mark.parametrize(("dim", "ratio"), [(2, 2.0), (3, 2.0), (2, 3.0), (3, 2.6)])
def test_fluid_rests_on_a_box_as_on_a_wall(dim, ratio):
    whole = rts.BoxObstacle((0,) * dim, (1, 0.32, 1)[:dim])
    raised = scene(dim, obstacles=[whole], support_ratio=ratio, kernel="wendland_c2")
    resting, corner = np.full((1, dim), 0.5), np.full((1, dim), 0.5)
    resting[0, 1] = corner[0, 1] = 0.34
    corner[0, 0] = 0.02
    assert sample(raised).positions[:, 1].min() == pytest.approx(0.34)
    assert density(raised, resting) == pytest.approx(1000.0, rel=1e-6)
    assert density(raised, corner) == pytest.approx(1000.0, rel=0.01)


@pytest.mark.parametrize("name", SOLIDS)
def test_wide_supports_lay_more_layers_where_the_body_has_room(name):
    obstacle, _ = SOLIDS[name]
    if obstacle.shape == "mesh":
        pytest.importorskip("trimesh")
    solid = make_solid(obstacle, S)
    dim = len(solid.lower)
    medium = {"support_ratio": 4.0, "kernel": "wendland_c2", "density": "continuity"}
    made = scene(dim, obstacles=[obstacle], fluids=[CORNER[dim]], **medium)
    (layer,) = sample(made).obstacles
    depth, _ = calibrate_walls(made)
    deep = -solid.distance(layer.positions)
    np.testing.assert_allclose(layer.depths, np.minimum(deep, made.support), rtol=1e-12)
    first = layer.depths < depth + 0.49 * S
    assert 0.1 < (~first).sum() / first.sum() < 2.0
    gaps = np.sqrt(((layer.positions[~first, None] - layer.positions[first]) ** 2).sum(axis=2))
    assert gaps.min() > 0.45 * S
    assert (layer.volumes > 0).all()


@pytest.mark.parametrize(("thickness", "rows"), [(1.0, 1), (2.0, 2), (2.5, 2), (3.0, 3), (4.0, 4), (8.0, 4)])
def test_no_layer_of_a_plate_pokes_through_its_other_side(thickness, rows):
    """Each side has a row, and a second one behind it, where there is room."""
    half = 0.5 * thickness * S
    plate = rts.BoxObstacle((0.2, 0.5 - half), (0.8, 0.5 + half))
    made = scene(support_ratio=3.0, kernel="wendland_c2", density="continuity", obstacles=[plate])
    (layer,) = sample(made).obstacles
    assert make_solid(plate, S).distance(layer.positions).max() < -0.4 * S
    middle = np.abs(layer.positions[:, 0] - 0.5) < 0.2
    assert len(np.unique(layer.positions[middle, 1].round(6))) == rows
    resting = np.array([[0.5, 0.5 + half + 0.5 * S], [0.5, 0.5 - half - 0.5 * S]])
    kernel = make_kernel(made.kernel, 2, made.support)
    steps = S * np.arange(-3, 4)
    seen = kernel.sample(np.linalg.norm(resting[:, None] - layer.positions, axis=2)) @ layer.volumes
    depth, volume = calibrate_walls(made)
    flat = volume * sum(kernel.sample(np.hypot(steps, 0.5 * S + depth + k * S)).sum() for k in range(2))
    np.testing.assert_allclose(seen, flat, rtol=0.05)


def test_fluid_keeps_half_a_spacing_from_an_obstacle_and_sees_a_whole_surface():
    made = scene(obstacles=[rts.SphereObstacle((0.5, 0.5), 0.22), BOX.__class__((0.3, 0), (0.4, 0.4))])
    x = sample(made).positions
    for obstacle in made.obstacles:
        assert make_solid(obstacle, S, made.domain).distance(x).min() >= 0.499 * S
    angle = np.linspace(0.6, 2.5, 40)
    probes = 0.5 + 0.24 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    kernel, layer = make_kernel(made.kernel, 2, made.support), sample(made).obstacles[0]
    depth, volume = calibrate_walls(made)
    steps = S * np.arange(-2, 3)
    flat = volume * kernel.sample(np.hypot(steps, 0.5 * S + depth)).sum()
    seen = kernel.sample(np.linalg.norm(probes[:, None] - layer.positions, axis=2)) @ layer.volumes
    np.testing.assert_allclose(seen, flat, rtol=0.05)
