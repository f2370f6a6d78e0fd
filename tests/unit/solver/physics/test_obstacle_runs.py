"""Obstacles in runs: no particle gets in, steppers agree, forces and work are right, moving bodies wake what they meet."""

from pathlib import Path

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.assembly.inventory import State, parts
from taichi_rts.device.backend import ti
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.obstacles.making import make_solid
from taichi_rts.solver.physics.timetable import Ticking
from taichi_rts.solver.stepping.limits import BlockMaxima

MESHES = Path(__file__).parents[4] / "assets" / "obstacles"
UNIT = rts.Box((0, 0), (1, 1))


def inside(scene, x, time):
    """How many of `x` lie inside each obstacle, by its true distance."""
    moving = {body.number: body for body in bodies(scene)}
    found = []
    for k, obstacle in enumerate(scene.obstacles):
        y = moving[k].displace(x, time) if k in moving else x
        found.append(int((make_solid(obstacle, scene.spacing).distance(y) < 0.0).sum()))
    return found


def in_meshes(scene, meshes, x):
    """How many of `x` lie inside each of `meshes`, by trimesh's own rays; they are the first obstacles."""
    pairs = zip(meshes, scene.obstacles, strict=False)
    return [int(mesh.contains(x - obstacle.translation).sum()) for mesh, obstacle in pairs]


@pytest.mark.slow
def test_one_level_equals_uniform_bit_for_bit_and_reading_forces_changes_nothing(start_taichi):
    turning = rts.ConstantMotion(velocity=(0.0, 0.5), angular_velocity=4.0)
    scene = rts.Scene(
        UNIT,
        (rts.Block((0, 0), (0.4, 0.8)),),
        0.04,
        sound_speed=40.0,
        obstacles=(
            rts.BoxObstacle((0.6, 0), (0.72, 0.3)),
            rts.BoxObstacle((0.35, 0.25), (0.55, 0.35), rotation=20, motion=turning),
        ),
    )
    states = []
    for same in (rts.Uniform(), rts.Regional(levels=1), rts.Asynchronous(levels=1)):
        with start_taichi("cpu", "f64"):
            sim = rts.Simulation(scene, same)
            for piece in (100.5, 200.5):
                sim.advance_to(piece * sim.base_step)
                assert inside(scene, sim.positions(), sim.time) == [0, 0]
                if same == rts.Uniform():
                    read = sim.obstacle_forces()
            states.append(sim.state())
            assert sim.statistics["base_steps"] == 200
    assert np.linalg.norm(read.forces, axis=1).min() > 1.0  # the flow has reached both
    np.testing.assert_allclose(read.pivots, [[0.66, 0.15], [0.45, 0.3 + 0.5 * sim.timeline.time]], rtol=1e-6)
    for uniform, *others in zip(*states, strict=True):
        for other in others:
            assert uniform.tobytes() == other.tobytes()


def test_water_at_rest_lifts_obstacles_by_what_they_displace(simulate):
    box, disc = rts.BoxObstacle((0.32, 0.2), (0.68, 0.48)), rts.SphereObstacle((0.84, 0.4), 0.1)
    pool = rts.Scene(UNIT, (rts.Block((0, 0), (1, 0.8)),), 0.04, sound_speed=40.0, obstacles=(box, disc))
    sim = simulate(pool, rts.Regional())
    found = []
    for time in np.linspace(1.0, 1.5, 11):
        sim.advance_to(time)
        found.append(sim.obstacle_forces())
    lift = np.mean([each.forces for each in found], axis=0) / (1000 * 9.81 * np.array([[0.36 * 0.28], [np.pi * 0.01]]))
    np.testing.assert_allclose(lift[:, 1], 1.0, atol=0.12)
    np.testing.assert_allclose(lift[:, 0], 0.0, atol=0.12)
    torque = np.mean([each.torques for each in found], axis=0)
    assert abs(torque[1]) < 0.02 * 1000 * 9.81 * np.pi * 0.01 * 0.1  # pressure on a disc passes through its middle
    assert inside(pool, sim.positions(), 0.0) == [0, 0]
    sim.scene = pool.replace(obstacles=())
    with pytest.raises(rts.Error, match="has 0 obstacles"):
        sim.obstacle_forces()


@pytest.mark.parametrize("ratio", [pytest.param(2.0, marks=pytest.mark.slow), 3.0])
def test_friction_slows_down_what_passes_an_edge_or_a_thin_plate(simulate, ratio):
    plates = (rts.BoxObstacle((0.2, 0.4), (0.5, 0.48)), rts.BoxObstacle((0.6, 0.3), (0.9, 0.6)))
    stream = rts.Block((0, 0), (1, 1), velocity=(1.0, 0.0))
    rates = []
    for nu in (0.0, 0.01):
        medium = {
            "kinematic_viscosity": nu,
            "support_ratio": ratio,
            "kernel": "wendland_c2",
            "artificial_viscosity": 0.0,
        }
        scene = rts.Scene(UNIT, (stream,), 0.04, sound_speed=20.0, gravity=(0, 0), obstacles=plates, **medium)
        sim = simulate(scene, rts.Uniform())
        rates.append(sim.particles.to_numpy(sim.particles.a)[:, 0])
    friction = rates[1] - rates[0]
    assert friction.max() < 1e-9
    assert -60.0 < friction.min() < -10.0  # nu u / s^2 is 6.25


@pytest.mark.slow
def test_a_body_pushes_with_the_work_that_is_counted(simulate):
    ram = rts.BoxObstacle((0.1, 0.06), (0.3, 0.94), motion=rts.Keyframes((0.05, 0.25), ((0, 0), (0.2, 0))))
    pushed = rts.Scene(
        UNIT,
        (rts.Block((0.3, 0.3), (0.6, 0.7)),),
        0.05,
        gravity=(0, 0),
        sound_speed=20.0,
        artificial_viscosity=0.0,
        obstacles=(ram,),
    )
    assert pushed.replace(sound_speed=None).wave_speed == pytest.approx(10.0)  # 0.2 m in 0.2 s
    sim = simulate(pushed, rts.Regional(levels=3, courant=0.05), debug=True)
    sim.advance_to(0.3)
    x, v = sim.positions(), sim.velocities()
    assert x[:, 0].min() > 0.5
    assert inside(pushed, x, 0.3) == [0]
    assert 0.8 < v[:, 0].mean() < 1.6  # between sticking to the body and bouncing off it
    assert sim.work() > 50.0
    assert sim.energy().total == pytest.approx(sim.work(), rel=0.03)
    assert np.abs(sim.momentum_drift()).max() < 0.02 * np.abs(sim.momentum()).max()


@ti.data_oriented
class Look:
    def __init__(self, maxima):
        self.maxima = maxima
        self.found = ti.field(float, maxima.geometry.blocks)

    @ti.kernel
    def at(self, now: ti.i32, tick: float):
        for block in self.found:
            self.found[block] = ti.sqrt(self.maxima.wall_speed2(block, now, tick))


def test_blocks_know_the_speed_of_a_body_before_it_arrives(simulate, unstarted):
    path = rts.Keyframes((0.1, 0.2, 0.5), ((0, 0), (0.3, 0), (0.3, 0)), rotations=(0, 0, 90))
    disc = rts.SphereObstacle((0.2, 0.5), 0.1, motion=path)
    scene = rts.Scene(UNIT, (rts.Block((0, 0), (1, 0.2)),), 0.025, sound_speed=50.0, obstacles=(disc,))
    sim = simulate(scene, rts.Uniform())
    look = Look(BlockMaxima(scene, sim.particles, sim.grid))
    for part in parts(look.maxima, Ticking):
        part.count_in(1e-4)
    x = scene.support * (0.5 + np.arange(-1, 22))  # middles of a row of blocks at y = 0.475
    row = slice(10 * 23, 11 * 23)

    def speeds(time):
        look.at(round(time * 1e4), 1e-4)
        return look.found.to_numpy()[row]

    assert (speeds(0.09) == 0.0).all()  # at rest for longer than any step lasts
    np.testing.assert_allclose(speeds(0.0995)[np.abs(x - 0.2) < 0.15], 3.0, rtol=1e-6)  # about to move
    found = speeds(0.15)  # its middle at x = 0.35
    np.testing.assert_allclose(found[np.abs(x - 0.35) < 0.15], 3.0, rtol=1e-6)
    assert (found[np.abs(x - 0.35) > 0.3] == 0.0).all()
    turning = speeds(0.3)
    np.testing.assert_allclose(turning[np.abs(x - 0.5) < 0.15], 0.5 * np.pi / 0.3 * np.hypot(0.1, 0.1), rtol=1e-6)


@ti.data_oriented
class Hold:
    def __init__(self, motion, points):
        self.motion, self.count = motion, len(points)
        self.x = ti.Vector.field(2, float, self.count)
        self.x.from_numpy(points)

    @ti.kernel
    def all(self):
        for k in range(self.count):
            for keeper in ti.static(self.motion.keepers):
                self.x[k], _v, _times = keeper.hold(self.x[k], ti.zero(self.x[k]), 0, 1.0, 0.0)


def test_obstacles_at_rest_are_data(simulate, unstarted, monkeypatch):
    """Forty times as many obstacles are no more code and no more fields, and each of them keeps out what comes into it."""
    traced, sizes, every = [], [], np.ndindex
    monkeypatch.setattr(np, "ndindex", lambda *shape: (traced.append(shape), every(*shape))[1])
    for count in (5, 200):
        discs = tuple(rts.SphereObstacle((0.1 + 0.1 * (k % 9), 0.1 + 0.03 * (k // 9)), 0.012) for k in range(count))
        scene = rts.Scene(UNIT, (rts.Block((0, 0.85), (1, 1)),), 0.02, sound_speed=40.0, obstacles=discs)
        sim = simulate(scene, rts.Uniform())
        middles = np.array([disc.centre for disc in discs]) + np.array([0.004, 0.003])
        points = np.concatenate([middles, [[0.95, 0.9], [0.15, 0.1]]])
        hold = Hold(sim.motion, points)
        traced.clear()
        hold.all()
        sizes.append((len(traced), len(State(sim.solver, everything=True).fields)))
        x = hold.x.to_numpy()
        far = np.linalg.norm(x[:-2] - [disc.centre for disc in discs], axis=1)
        np.testing.assert_allclose(far, 0.012, atol=0.002)
        np.testing.assert_array_equal(x[-2:], points[-2:])
    assert sizes[0] == sizes[1]
    assert sizes[0][0] > 0


@pytest.mark.slow
def test_no_particle_gets_into_meshes_or_a_paddle_in_a_dam_break(simulate):
    trimesh = pytest.importorskip("trimesh")
    scene = rts.load_scene(MESHES / "dam_break_meshes.toml", spacing=0.05)
    paddle = rts.BoxObstacle((0.9, 0.15, 0.2), (1.1, 0.25, 0.4), motion=scene.obstacles[2].motion)
    scene = scene.replace(obstacles=(*scene.obstacles[:2], paddle), fluids=(rts.Block((0, 0, 0), (0.4, 0.6, 0.6)),))
    meshes = [trimesh.load_mesh(obstacle.file) for obstacle in scene.obstacles[:2]]
    sim = simulate(scene, rts.Asynchronous())
    for time in (0.25, 0.4, 0.6):
        sim.advance_to(time)
        x = sim.positions()
        assert inside(scene, x, time)[2] == 0
        assert in_meshes(scene, meshes, x) == [0, 0]
    assert x[:, 0].max() > 1.3  # it has come past all of them
    assert sim.statistics["runaways"] == 0


@pytest.mark.slow
def test_no_particle_is_in_a_ball_or_a_wedge_after_two_seconds_at_the_scenes_own_spacing(taichi_cpu):
    trimesh = pytest.importorskip("trimesh")
    scene = rts.load_scene(MESHES / "dam_break_meshes.toml")
    scene = scene.replace(obstacles=scene.obstacles[:2])
    sim = rts.Simulation(scene, rts.Uniform())
    meshes = [trimesh.load_mesh(obstacle.file) for obstacle in scene.obstacles]
    for time in (0.5, 1.0, 1.5, 2.0):
        sim.advance_to(time)
        assert in_meshes(scene, meshes, sim.positions()) == [0, 0]
    assert sim.count == 6144
    assert sim.statistics["runaways"] == 0
