"""Domains far from 0: a run counts from near them, so that single precision tells positions apart as it does at 0."""

import dataclasses
import typing
import warnings

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.assembly.resources import require_resolution
from taichi_rts.errors import ResourceError
from taichi_rts.output.export import Exporter, capture
from taichi_rts.output.series import Series
from taichi_rts.particle_files.ply import read_ply
from taichi_rts.particle_files.surface import write_surface
from taichi_rts.rendering.painter import Painter, PictureOptions
from taichi_rts.scene.placing import at_origin, origin_of, translated

HERE, UTM = (0.0, 0.0), (500000.0, 4649776.0)
SPACING = (
    1 / 32
)  # like all that follows a multiple of a power of two, so that far from 0 the scenes are exactly the same


def box(kind, at, lower, upper, **more):
    return kind(tuple(np.add(at, lower)), tuple(np.add(at, upper)), **more)


def pool(at=HERE, **changes):
    """A still pool of 32 x 16 particles whose domain has its lower corner `at` [m], (2,)."""
    given = {"spacing": SPACING, "end_time": 0.5, "sound_speed": 30.0} | changes
    return rts.Scene(domain=box(rts.Box, at, (0, 0), (1, 1)), fluids=[box(rts.Block, at, (0, 0), (1, 0.5))], **given)


def tank(at=HERE):
    """Nearly all that has coordinates: bodies at rest and moving, a piston, an inflow, an outlet, fields, probes, gauges."""
    there = lambda *x: tuple(np.add(at, x))  # noqa: E731
    spin = rts.ConstantMotion(velocity=(0.25, 0.0), angular_velocity=2.0, pivot=there(0.75, 0.25))
    wave = rts.StandingWave(speed=0.25, wavelength=2.0, depth=0.5, origin=at)
    return rts.Scene(
        domain=box(rts.Box, at, (0, 0), (2, 1)),
        fluids=[
            box(rts.Block, at, (0, 0), (1.5, 0.5), velocity=wave),
            rts.Sphere(
                there(1.5, 0.75), 0.125, velocity=rts.LinearField(((1.0, 0.0), (0.0, -1.0)), origin=there(1.5, 0.75))
            ),
        ],
        spacing=SPACING,
        sound_speed=40.0,
        body_force=rts.LinearField(((-1.0, 0.0), (0.0, 0.0)), value=(0.5, 0.0), origin=there(0.5, 0.5)),
        obstacles=[
            rts.PolygonObstacle((there(1.0, 0.125), there(1.25, 0.125), there(1.25, 0.375))),
            box(rts.BoxObstacle, at, (0.625, 0.125), (0.875, 0.375), motion=spin),
        ],
        moving_walls=[rts.MovingWall("x-", (0.0, 0.25), (0.0, 0.125))],
        inflows=[box(rts.Inflow, at, (0.25, 1), (0.5, 1), velocity=(0.0, -2.0))],
        outlets=[box(rts.Outlet, at, (1.75, 0), (2, 0.25))],
        probes=[rts.Probe(there(0.25, 0.0625)), rts.Probe(there(1.5, 0.25))],
        gauges=[rts.Gauge(there(0.25, 0))],
        end_time=0.25,
    )


def channel(at=HERE):
    """A periodic axis, across which a disc moves, particles given one by one, and vortices."""
    disc = rts.SphereObstacle(tuple(np.add(at, (0.75, 0.5))), 0.125, rts.ConstantMotion(velocity=(1.0, 0.0)))
    rows = np.stack(np.meshgrid(*[(np.arange(n) + 0.5) * SPACING for n in (32, 4)], indexing="ij"), -1).reshape(-1, 2)
    return rts.Scene(
        domain=box(rts.Box, at, (0, 0), (1, 1)),
        fluids=[
            rts.Particles(rows + at),
            box(rts.Block, at, (0, 0.125), (1, 1), velocity=rts.TaylorGreen(0.5, 1.0, origin=at)),
        ],
        spacing=SPACING,
        sound_speed=30.0,
        periodic=("x",),
        obstacles=[disc],
        end_time=0.25,
    )


def seen(sim, folder):
    """All that can be read of `sim`, positions and pivots counted from its origin."""
    x, *rest = sim.state()
    found = {
        "x": x - np.asarray(sim.origin),
        "ids": sim.ids(),
        "rest": np.concatenate([np.ravel(each) for each in rest]),
    }
    row = Series(folder / "series.csv", sim).measure()
    places = [row.pop(name) for name in ("front", "centre_x", "centre_y")] - np.array([sim.origin[0], *sim.origin])
    found |= {"row": np.array([*row.values()]), "places": places.round(8)}  # whose sum double precision rounds
    if sim.scene.obstacles:
        forces = sim.obstacle_forces()
        found |= {"forces": forces.forces, "torques": forces.torques}
        found["pivots"] = (forces.pivots - np.asarray(sim.origin)).round(8)
    return found | {"energy": np.array(sim.energy())}


@pytest.mark.parametrize(
    ("lower", "upper", "origin"),
    [
        ((0, 0), (1, 1), (0, 0)),
        ((-1, -2), (1, 2), (0, 0)),
        ((2, -3), (3, -2), (0, 0)),  # its longest side from 0
        ((2, 1.01), (3, 2), (2, 1.01)),
        ((-3.5, 0), (-2.5, 1), (-3.5, 0)),
        ((5, 6), (15, 7), (0, 0)),
        ((1e3, 0, 0), (1e3 + 1, 1, 1), (1e3, 0, 0)),
        (UTM, (UTM[0] + 2, UTM[1] + 1), UTM),
    ],
)
def test_the_origin_is_0_near_0_and_else_the_lower_face(lower, upper, origin):
    size = max(np.subtract(upper, lower))
    if lower == (2, -3):  # 2 m from 0
        origin = (2, -3)
    fluid = rts.Block(lower, tuple(np.add(lower, 0.25)))
    scene = rts.Scene(domain=rts.Box(lower, upper), fluids=[fluid], spacing=0.125, sound_speed=10.0)
    assert origin_of(scene) == origin
    local = at_origin(scene)
    assert (local is scene) == (not any(origin))
    assert np.abs([local.domain.lower, local.domain.upper]).max() <= 2.0 * size
    np.testing.assert_array_equal(np.add(local.domain.upper, origin), upper)


def parts_of(kind, found=None):
    """The classes of which a scene may be made, its own among them."""
    found = set() if found is None else found
    if dataclasses.is_dataclass(kind) and kind not in found:
        found.add(kind)
        for hint in typing.get_type_hints(kind).values():
            parts_of(hint, found)
    for part in typing.get_args(kind):
        parts_of(part, found)
    return found


def numbers(thing, path=""):
    """All numbers of plain data by their paths."""
    if isinstance(thing, dict):
        return {key: n for name, each in thing.items() for key, n in numbers(each, f"{path}.{name}").items()}
    if isinstance(thing, list):
        return {key: n for k, each in enumerate(thing) for key, n in numbers(each, f"{path}.{k}").items()}
    return {path: thing} if isinstance(thing, (int, float)) and not isinstance(thing, bool) else {}


@pytest.mark.parametrize("scene", [tank(), channel()])
def test_all_coordinates_move_and_nothing_else(scene):
    before, after = numbers(scene.to_dict()), numbers(translated(scene, (8.0, -4.0)).to_dict())
    places = {name for kind in parts_of(rts.Scene) for name in getattr(kind, "places", ())}
    assert before.keys() == after.keys()
    for path, value in before.items():
        names = path.split(".")[1:]
        owners = [name for name in names if not name.isdigit() and name != "points"]
        moves = (owners[-1] in places or "points" in names) and names[-1].isdigit()
        assert after[path] - value == ((8.0, -4.0)[int(names[-1])] if moves else 0.0), path
    moved = translated(scene, (8.0, -4.0))
    assert translated(moved, (-8.0, 4.0)) == scene
    moved.replace(end_time=2.0)  # is valid


def test_every_coordinate_of_a_scene_is_a_place():
    """A vector that is no place is named here; a new one has to be put on either list."""
    turns = {"rotation", "rotations", "angular_velocity"}
    vectors = turns | {"velocity", "displacements", "times", "scale", "gravity", "value", "gradient"}
    kinds = parts_of(rts.Scene)
    assert {rts.Box, rts.Sphere, rts.PolygonObstacle, rts.Keyframes, rts.Gauge, rts.View, rts.TaylorGreen} < kinds
    for kind in kinds - {rts.Scene, rts.Particles}:  # which moves its arrays itself
        texts = {field.name: str(field.type) for field in dataclasses.fields(kind)}
        found = {name for name, text in texts.items() if "Vector" in text or "tuple[" in text or "Plane" in text}
        assert found - vectors == set(getattr(kind, "places", ())), kind


def test_fields_with_an_origin_are_the_same_elsewhere():
    x = np.random.default_rng(1).random((20, 2))
    for field in (rts.TaylorGreen(2.0, 1.0), rts.StandingWave(1.0, 2.0, 0.5), rts.LinearField(((1, 2), (3, 4)))):
        moved = translated(field, (500.0, -8.0))
        np.testing.assert_allclose(moved.at(x + np.array((500.0, -8.0))), field.at(x), atol=1e-12)
    force = rts.LinearField(((1, 2), (2, 4)), value=(1, 0), origin=(1e6, 0))
    assert force.base_near((0, 0), (1, 1)) == ((0.0, 0.0), (1.0 - 1e6, -2e6))
    assert force.base_near((1e6, 0), (1e6 + 1, 1)) == ((1e6, 0.0), (1.0, 0.0))


def test_no_distance_changes_a_bit_of_a_still_pool(start_taichi, quick, tmp_path):
    found = {}
    for at in (HERE, UTM):
        with start_taichi("cpu", "f32", **quick):
            sim = rts.Simulation(pool(at), rts.Regional(levels=3))
            assert sim.positions().dtype == (np.float32 if at == HERE else np.float64)
            sim.advance_to(0.3)
            found[at] = seen(sim, tmp_path)
            lower, upper = sim.scene.domain.lower, sim.scene.domain.upper
            assert ((sim.positions() >= lower) & (sim.positions() <= upper)).all()
            found[at]["picture"] = Painter(sim.scene, PictureOptions(160, 120)).paint(sim)
    speeds = found[HERE]["rest"][: 2 * 512]
    assert 1e-3 < np.sqrt(2.0 * np.mean(speeds**2.0)) < 0.1  # it moves a little, as pools do
    for name, values in found[HERE].items():
        np.testing.assert_array_equal(found[UTM][name], values, err_msg=name)


@pytest.mark.parametrize(
    ("make", "stepper"),
    [
        (tank, rts.Regional(levels=3)),
        pytest.param(channel, rts.Regional(levels=3), marks=pytest.mark.slow),
        pytest.param(tank, rts.Asynchronous(), marks=pytest.mark.slow),
    ],
)
def test_no_distance_changes_a_bit_of_what_drives_a_flow(start_taichi, quick, tmp_path, make, stepper):
    found = []
    for at in (HERE, UTM):
        with start_taichi("cpu", "f32", **quick):
            sim = rts.Simulation(make(at), stepper)
            sim.advance_to(0.2)
            assert at == HERE or sim.statistics["base_steps"] > 20
            found.append(seen(sim, tmp_path))
    assert found[0]["x"].std() > 0.1
    for name, values in found[0].items():
        np.testing.assert_array_equal(found[1][name], values, err_msg=name)
    assert np.abs(found[0]["forces"]).max() > 10.0


@pytest.mark.slow
def test_a_checkpoint_and_another_stepper_go_on_far_from_0(start_taichi, quick, tmp_path):
    with start_taichi("cpu", "f32", **quick):
        sim = rts.Simulation(pool(UTM, body_force=None), rts.Regional(levels=3))
        sim.advance_to(0.1)
        rts.save_checkpoint(sim, tmp_path / "state.npz")
        other = rts.change_stepper(sim, rts.Uniform())
        np.testing.assert_array_equal(other.positions(), sim.positions())
        other.advance_to(other.time + 0.01)
        assert np.abs(other.positions() - sim.positions()).max() < 0.1 * SPACING
        sim.advance_to(0.2)
        whole = sim.state()
    with start_taichi("cpu", "f32", **quick):
        again = rts.load_checkpoint(tmp_path / "state.npz")
        again.advance_to(0.2)
        assert again.origin == UTM
        for one, two in zip(again.state(), whole, strict=True):
            np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_files_of_a_run_far_from_0_keep_its_positions(start_taichi, quick, tmp_path, precision, unstarted):
    with start_taichi("cpu", precision, **quick):
        sim = rts.Simulation(pool(UTM), rts.Uniform())
        export = Exporter(tmp_path, ("vtu", "ply", "npz", "bgeo"))
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            export(sim)
            export(sim)
        (warning,) = said
        assert "bgeo holds single precision" in str(warning.message)
        assert "less (500000.0, 4649776.0)" in str(warning.message)
        assert export.files["bgeo_offset"] == [500000.0, 4649776.0]
        x, velocity = sim.positions(), sim.velocities()
        frame = capture(sim)
    assert frame.attributes["velocity"].dtype == velocity.dtype == (np.float32 if precision == "f32" else np.float64)
    for suffix in ("vtu", "ply", "npz", "bgeo"):
        back = rts.read_particles(tmp_path / "particles" / f"000001.{suffix}")
        assert len(np.unique(back.positions[:, 1])) == 16, suffix  # rows of the pool
        assert np.abs(back.positions - x).max() < (1e-6 * SPACING), suffix
        assert "offset" not in back.attributes
    whole = rts.Scene(
        domain=pool(UTM).domain,
        fluids=[rts.Particles(file=str(tmp_path / "particles" / "000001.ply"))],
        spacing=SPACING,
    )
    np.testing.assert_allclose(at_origin(whole).fluids[0].positions, x - np.asarray(UTM), atol=1e-7)


def test_a_surface_far_from_0_is_the_one_at_0():
    pytest.importorskip("pysplashsurf")
    axis = 0.05 * np.arange(5)
    x = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    velocity = {"velocity": np.ones_like(x, dtype=np.float32)}
    surfaces = [
        read_ply(write_surface(rts.ParticleFrame((x + at).astype(kind), velocity, spacing=0.05, origin=tuple(at))))
        for at, kind in ((np.zeros(3), np.float32), (np.array([*UTM, 0.0]), np.float64))
    ]
    assert [surface.positions.dtype for surface in surfaces] == [np.float32, np.float64]
    near, far = surfaces[0].positions, surfaces[1].positions - np.array([*UTM, 0.0])
    assert len(near) == len(far) > 500
    gaps = np.linalg.norm(near[:, None] - far, axis=2)  # corners may come in another order
    assert gaps.min(axis=0).max() < 1e-4 * 0.05


def test_files_near_0_are_as_they_were(tmp_path):
    """Single precision in PLY and no offset in bgeo: of a run at 0, and of particles whose spacing is not known."""
    x = np.random.default_rng(0).random((100, 2))
    for spacing in (None, 0.05):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            frame = rts.ParticleFrame(x, spacing=spacing)
            rts.write_particles(tmp_path / "a.bgeo", frame)
            rts.write_particles(tmp_path / "a.ply", frame)
        for suffix in ("ply", "bgeo"):
            back = rts.read_particles(tmp_path / f"a.{suffix}").positions
            assert back.dtype == np.float32
            np.testing.assert_array_equal(back, x.astype(np.float32))
    with pytest.warns(UserWarning, match="less"):
        rts.write_particles(tmp_path / "b.bgeo", rts.ParticleFrame(x + 1e7))
    np.testing.assert_allclose(rts.read_particles(tmp_path / "b.bgeo").positions, x + 1e7, atol=1e-7, rtol=0)


def test_only_the_size_of_a_domain_costs_precision():
    def long(length, at=0.0, spacing=0.01):
        fluid = rts.Block((at, 0), (at + 1, 1))
        return rts.Scene(domain=rts.Box((at, 0), (at + length, 1)), fluids=[fluid], spacing=spacing, sound_speed=10.0)

    for at in (0.0, 5e5, -5e5):
        require_resolution(long(160.0, at), "f32")  # 160 m x 2^-24 = 9.5e-6 m
        require_resolution(long(1000.0, at), "f64")
    with pytest.raises(
        ResourceError, match=r"reach 1000 m, where f32 rounds them by 5.96e-05 m, more than 0.001 .* 0.0596"
    ):
        require_resolution(long(1000.0), "f32")
    for precision in ("f32", "f64"):
        with pytest.raises(
            ResourceError, match=r"1e\+12 m from 0, where numbers in double precision .* use a spacing of at least"
        ):
            require_resolution(long(100.0, 1e12 - 100.0), precision)
