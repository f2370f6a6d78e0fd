"""Scenes that drive their fluid: periodic axes, changes of gravity, moving walls, inflows, viscosity per fluid."""

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.sampling.faces import line_walls
from taichi_rts.sampling.sampling import compress, fill_patch, patch_steps, sample

UNIT = rts.Box((0, 0), (1, 1))
POOL = rts.Block((0, 0), (1, 0.4))
PISTON = rts.MovingWall("x-", (0.1, 0.5), (0.0, 0.4))
JET = rts.Inflow((0.4, 1.0), (0.5, 1.0), (0, -3), stop=0.1)
STEPPERS = {
    "uniform": rts.Uniform(),
    "regional": rts.Regional(levels=3),
    "asynchronous": rts.Asynchronous(steps="integers", stagger=1),
}
each_stepper = pytest.mark.parametrize(
    "stepper",
    [
        pytest.param(stepper, id=name, marks=[] if name == "regional" else pytest.mark.slow)
        for name, stepper in STEPPERS.items()
    ],
)


def scene(**changes):
    return rts.Scene(**({"domain": UNIT, "fluids": [POOL], "spacing": 0.05} | changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"periodic": ("x",), "spacing": 0.2}, "1 long along 'x'; it must hold 4 support radii of 0.4.*at most 0.125"),
        (
            {"periodic": ("x",), "spacing": 0.03},
            "0.03 does not divide the periodic length 1 along 'x'; use 0.0303030303",
        ),
        ({"moving_walls": [PISTON], "periodic": ("x",)}, "moving_walls.0: the domain has no wall 'x-'"),
        ({"moving_walls": [PISTON], "walls": False}, "moving_walls.0: the domain has no wall 'x-'"),
        ({"moving_walls": [PISTON, PISTON]}, "moving_walls: two of them are the same face"),
        ({"inflows": [rts.Inflow((0.4, 0.9), (0.5, 0.9), (0, -3))]}, "inflows.0: the patch must lie on face 'y\\+'"),
        ({"inflows": [rts.Inflow((0.4, 1), (0.5, 1), (0, 3))]}, "inflows.0: the patch must lie on face 'y-'"),
        ({"inflows": [rts.Inflow((0.4, 1), (0.42, 1), (0, -3))]}, "narrower than the spacing 0.05"),
        ({"inflows": [rts.Inflow((0.9, 1), (1.1, 1), (0, -3))]}, "inflows.0: the patch leaves the domain"),
        ({"gravity_changes": [rts.GravityChange(0.2, (0, 1, 0))]}, "gravity has 3 components; the domain has 2"),
        ({"gravity_changes": [rts.GravityChange(t, (0, 1)) for t in (0.2, 0.1)]}, r"times \[0.2, 0.1\] must ascend"),
    ],
)
def test_contradictions_name_value_limit_and_remedy(changes, message):
    with pytest.raises(rts.SceneError, match=message):
        scene(**changes)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rts.MovingWall("x-", (0, 1), (0.1, 0.2)), "must begin with 0"),
        (lambda: rts.MovingWall("x-", (0, 1, 2), (0, 0.2)), "times has 3 entries, displacements 2"),
        (lambda: rts.MovingWall("x+", (0, 1), (0, 0.2)), "take face 'x\\+' out of the domain"),
        (lambda: rts.MovingWall("w", (0, 1), (0, 0.2)), "'x-', 'x\\+'"),
        (lambda: rts.Inflow((0, 0), (1, 1), (0, 1)), "is not flat"),
        (lambda: rts.Inflow((0, 0), (1, 0), (1, 0)), "does not cross the patch; give it a component along y"),
        (lambda: rts.Inflow((0, 0), (1, 0), (0, 1, 0)), "differ in dimension"),
    ],
)
def test_parts_are_checked_by_themselves(make, message):
    with pytest.raises(rts.SceneError, match=message):
        make()


def test_particles_on_request_divide_a_periodic_length():
    made = rts.load_scene("taylor_green", particles=1000)
    assert made.spacing == pytest.approx(1 / 32)


def test_default_sound_speed_knows_walls_inflows_and_changes_of_gravity():
    still = {"gravity": (0, 0), "fluids": [POOL]}
    assert scene(**still, moving_walls=[PISTON]).wave_speed == pytest.approx(10.0)  # 0.4 m in 0.4 s
    assert scene(**still, inflows=[JET]).wave_speed == pytest.approx(30.0)
    flip = rts.GravityChange(1.0, (0, 5.0))
    assert scene(**still, gravity_changes=[flip]).wave_speed == pytest.approx(10 * np.sqrt(2 * 5.0 * 1.0))


def test_fields_are_what_their_formulas_say():
    x = np.random.default_rng(0).uniform(size=(50, 2))
    vortices = rts.TaylorGreen(2.0, 0.5)
    assert np.linalg.norm(vortices.at(x), axis=1).max() <= vortices.top_speed(x) == 2.0
    wave = rts.StandingWave(0.3, 2.0, 0.5)
    np.testing.assert_allclose(wave.at(np.array([[0.0, 0.5], [1.0, 0.5]])), [[0, 0.3], [0, -0.3]], atol=1e-12)
    for field in (vortices, wave):
        step = 1e-5
        ahead, behind = ([field.at(x + e * step * np.eye(2)[d]) for d in (0, 1)] for e in (1, -1))
        divergence = sum((a - b)[:, d] for d, (a, b) in enumerate(zip(ahead, behind, strict=True))) / (2 * step)
        np.testing.assert_allclose(divergence, 0, atol=1e-8)


def test_walls_are_missing_on_periodic_axes_and_behind_inflows_and_know_which_move():
    layer, owners = line_walls(scene(periodic=("x",)))
    assert set(layer.normals[:, 0]) == {0.0}  # no face across x
    assert len(layer.positions) == 2 * 20
    layer, owners = line_walls(scene(moving_walls=[rts.MovingWall("y+", (0, 1), (0, -0.2)), PISTON]))
    assert (layer.normals[owners == 0] == [0, -1]).all()
    assert (layer.normals[owners == 1] == [1, 0]).all()
    assert (owners == 0).sum() == 20
    assert (owners == 1).sum() == 22  # it owns its edges
    everywhere, _ = line_walls(scene())
    layer, _ = line_walls(scene(inflows=[JET]))
    gone = set(map(tuple, everywhere.positions.round(9))) - set(map(tuple, layer.positions.round(9)))
    assert {x for x, _ in gone} == {0.375, 0.425, 0.475, 0.525}
    assert min(y for _, y in gone) > 1


def test_wide_supports_have_as_many_planes_behind_every_face_but_the_inflows():
    wide = {"support_ratio": 3.0, "kernel": "wendland_c2"}
    layer, owners = line_walls(scene(moving_walls=[PISTON], **wide))
    assert (owners == 0).sum() == 2 * 24  # it owns its edges
    assert (layer.normals[owners == 0] == [1, 0]).all()
    everywhere, _ = line_walls(scene(**wide))
    layer, _ = line_walls(scene(inflows=[JET], **wide))
    gone = set(map(tuple, everywhere.positions.round(9))) - set(map(tuple, layer.positions.round(9)))
    assert {x for x, _ in gone} == {0.375, 0.425, 0.475, 0.525}
    assert len(gone) == 2 * 4
    layer, _ = line_walls(scene(periodic=("x",), **wide))
    assert len(layer.positions) == 2 * 2 * 20


@pytest.mark.parametrize("density", ["summation", pytest.param("continuity", marks=pytest.mark.slow)])
def test_a_face_that_may_move_pushes_as_one_at_rest(simulate, density):
    """With several planes, and friction on them. The work of moving walls needs a debug run, which this is not."""
    medium = {"support_ratio": 3.0, "kernel": "wendland_c2", "kinematic_viscosity": 0.01, "density": density}
    slid = rts.Block((0, 0), (0.5, 0.4), velocity=(0.3, -0.5))
    pushes = []
    for walls in ([], [rts.MovingWall("x-", (5, 6), (0, 0.1)), rts.MovingWall("y-", (5, 6), (0, 0.1))]):
        sim = simulate(scene(fluids=[slid], moving_walls=walls, sound_speed=20.0, **medium), rts.Uniform())
        pushes.append(sim.particles.to_numpy(sim.particles.a))
    with pytest.raises(rts.Error, match="debug=True"):
        sim.work()
    assert np.abs(pushes[0][:, 0]).max() > 3.0
    np.testing.assert_allclose(pushes[1], pushes[0], rtol=1e-9, atol=1e-9)


def test_fluid_may_start_under_its_own_weight():
    pool = scene(hydrostatic=True, gravity=(0, -10))
    x, rho = compress(pool, POOL, np.array([[0.5, 0.0], [0.5, 0.4], [0.5, 0.2]]))
    c2 = pool.wave_speed**2
    assert rho[1] == 1000.0
    assert rho[0] == pytest.approx(1000 * (1 + 10 * 0.4 / c2), rel=1e-4)
    assert x[0, 1] == 0
    assert x[1, 1] == pytest.approx(0.4 - 10 / c2 * 0.4**2 / 2)  # the sum of what all layers give way
    sideways = scene(hydrostatic=True, gravity=(10, 0), fluids=[rts.Block((0.5, 0), (1, 1))])
    start = sample(sideways)
    assert start.densities[start.positions[:, 0].argmax()] > start.densities[start.positions[:, 0].argmin()] > 1000
    assert start.positions[:, 0].min() > 0.525


def drop(periodic, velocity):
    """A stretching drop without walls that crosses the domain's faces, if it moves."""
    motion = rts.LinearField(((-2.0, 0.0), (0.0, 2.0)), value=velocity, origin=(0.5, 0.5))
    ball = rts.Sphere((0.5, 0.5), 0.15, velocity=motion)
    still = {"gravity": (0, 0), "walls": False, "sound_speed": 20, "spacing": 1 / 32}
    return scene(fluids=[ball], periodic=periodic, **still)


@pytest.mark.parametrize("density", ["summation", pytest.param("continuity", marks=pytest.mark.slow)])
def test_crossing_a_periodic_face_changes_nothing(simulate, density):
    end, states = 0.125, []
    for velocity in ((0, 0), (4, 4)):
        sim = simulate(drop(("x", "y"), velocity).replace(density=density), rts.Uniform())
        sim.advance_to(end)
        states.append((sim.positions(), sim.velocities() - velocity, sim.densities()))
    (x, v, rho), (shifted, v_too, rho_too) = states
    assert shifted.min() < 0.15  # it went around
    assert shifted.max() > 0.85
    moved = shifted - x - 0.5
    np.testing.assert_allclose(moved - np.round(moved), 0, atol=1e-12)
    np.testing.assert_allclose(v_too, v, atol=1e-11)
    np.testing.assert_allclose(rho_too, rho, rtol=1e-11)


@pytest.mark.slow
def test_asynchronous_steps_look_back_across_a_periodic_face(simulate):
    stepper, widths = rts.Asynchronous(steps="integers", stagger=1), []
    for velocity in ((0, 0), (1, 0)):  # both slow enough that |v| shortens no step
        sim = simulate(drop(("x",), velocity), stepper, debug=True)
        sim.advance_to(0.4)
        x = sim.positions()
        widths.append(np.ptp((x - velocity * np.array([0.4, 0]) + 0.25) % 1.0, axis=0))
        assert sim.statistics["extrapolations"] == 0
    np.testing.assert_allclose(widths[0], widths[1], rtol=1e-3)  # cells lie elsewhere, so steps differ a little


@each_stepper
def test_gravity_changes_in_flight(simulate, stepper):
    ball = rts.Block((0.4, 0.4), (0.6, 0.6))
    flying = scene(fluids=[ball], gravity_changes=[rts.GravityChange(0.1, (2.0, 4.0))], walls=False)
    sim = simulate(flying, stepper)
    start, energy = sim.positions(), sim.energy().total
    assert sim.work() == 0
    sim.advance_to(0.3)
    g, h, early, late = np.array([0, -9.81]), np.array([2.0, 4.0]), 0.1, 0.2
    exact = g * early * late + 0.5 * g * early**2 + 0.5 * h * late**2
    step = sim.steps().max()
    np.testing.assert_allclose((sim.positions() - start).mean(axis=0), exact, atol=15 * late * step)
    assert sim.energy().total - sim.work() == pytest.approx(energy, rel=0.02)
    assert abs(sim.work()) > 0.5 * energy


@pytest.mark.parametrize(
    "stepper",
    [
        pytest.param(rts.Uniform(courant=0.1), marks=pytest.mark.slow),
        rts.Regional(levels=3, courant=0.05),
        pytest.param(rts.Asynchronous(courant=0.1, stagger=1), marks=pytest.mark.slow),
    ],
    ids=STEPPERS,
)
def test_a_piston_pushes_and_its_work_is_counted(simulate, stepper):
    # without viscosity, so that nothing but the work changes the energy (at courant 0.4 the impacts cost 13 % of it)
    quiet = {"artificial_viscosity": 0.0, "sound_speed": 20.0, "gravity": (0, 0)}
    piston = rts.MovingWall("x-", (0.05, 0.25), (0, 0.2))
    pushed = scene(fluids=[rts.Block((0, 0.3), (0.3, 0.7))], moving_walls=[piston], **quiet)
    sim = simulate(pushed, stepper, debug=True)
    sim.advance_to(0.3)
    x, v = sim.positions(), sim.velocities()
    assert x[:, 0].min() > 0.2
    assert 0.8 < v[:, 0].mean() < 1.6  # between sticking to the piston and bouncing off it
    assert sim.statistics["stopped_by_domain"] == 0
    assert sim.work() > 100.0
    assert sim.energy().total == pytest.approx(sim.work(), rel=0.03)
    assert np.abs(sim.momentum_drift()).max() < 0.02 * np.abs(sim.momentum()).max()


@each_stepper
def test_fluid_flows_in_layer_by_layer(simulate, stepper):
    fountain = scene(inflows=[JET], gravity=(0, 0), sound_speed=30.0)
    layer = len(fill_patch(fountain, JET))
    assert layer == 2
    jet = simulate(fountain, stepper, debug=True)
    pool, start = jet.count, jet.energy().total
    for time in (0.02, 0.06, 0.09):
        jet.advance_to(time)
        layers = np.floor(time * 3.0 / 0.05 + 0.5)
        assert jet.count - pool == 2 * layers == len(jet.positions()) - pool == len(jet.levels()) - pool
    x, v = jet.positions()[pool:], jet.velocities()[pool:]
    np.testing.assert_allclose(v[-6:], np.tile((0, -3), (6, 1)), atol=1e-12)  # guided for one support radius
    crossed = (np.repeat(np.arange(5), 2) + 0.5) * 0.05 / 3.0
    np.testing.assert_allclose(x[-6:, 1], (1.0 - 3.0 * (0.09 - crossed))[-6:], atol=1e-12)
    assert jet.energy().total - jet.work() == pytest.approx(start, rel=0.05)
    jet.advance_to(0.3)
    assert jet.count - pool == 2 * 6  # 0.1 s at 3 m/s are 6 layers 0.05 apart
    assert (jet.densities()[pool:] > 500).any()


@pytest.mark.parametrize(("width", "rows"), [(0.1, 2), (0.13, 3), (0.17, 3), (0.06, 1), (0.09, 2)])
def test_area_times_speed_flows_in(simulate, width, rows):
    """Also where the patch is no multiple of the spacing: one of 0.09 m let in 56 % of its water."""
    jet = rts.Inflow((0.4, 1.0), (0.4 + width, 1.0), (0, -3))
    fountain = scene(inflows=[jet], gravity=(0, 0), sound_speed=30.0, end_time=2.0)
    x = fill_patch(fountain, jet)
    assert len(x) == rows
    assert x[:, 0].mean() == pytest.approx(0.4 + 0.5 * width)
    layer = patch_steps(fountain, jet)[1]
    assert rows * 0.05**2 == pytest.approx(width * layer)
    sim = simulate(fountain, rts.Uniform())
    before = sim.count
    sim.advance_to(0.2)
    assert (sim.count - before) * 0.05**2 == pytest.approx(width * 3 * 0.2, abs=0.5 * width * layer + 1e-9)


def test_a_time_beyond_that_of_which_memory_was_reserved_for_an_inflow_is_one_error(simulate):
    endless = rts.Inflow((0.4, 1.0), (0.5, 1.0), (0, -3))
    sim = simulate(scene(inflows=[JET, endless], gravity=(0, 0), sound_speed=30.0, end_time=0.05), rts.Uniform())
    start, said = (
        sim.count,
        r"time 3 s lies after the scene's end_time 0\.05 s, .* inflows\.1; start with scene.replace\(end_time=3",
    )
    frames = []
    with pytest.raises(rts.TimeError, match=said):
        sim.advance_to(3.0)
    with pytest.raises(rts.TimeError, match=said):
        sim.run(3.0, frames.append)
    assert (sim.time, sim.count, frames) == (0.0, start, [])
    sim.advance_to(0.05)
    assert sim.count == start + 2 * 2 * 3
    longer = simulate(sim.scene.replace(end_time=0.1), rts.Uniform())
    longer.advance_to(0.1)
    assert longer.count == start + 2 * 2 * 6
    stopped = simulate(scene(inflows=[JET], gravity=(0, 0), sound_speed=30.0, end_time=0.05), rts.Uniform())
    stopped.advance_to(0.2)  # its inflow has an end of its own
    assert stopped.count == start + 2 * 6


@pytest.mark.slow
def test_viscosity_belongs_to_the_fluid(simulate):
    quiet = {"gravity": (0, 0), "artificial_viscosity": 0.0, "sound_speed": 20.0, "walls": False}
    lower, upper = rts.LinearField(((0, 0), (0, 0)), value=(1, 0)), rts.LinearField(((0, 0), (0, 0)), value=(-1, 0))

    def shear(*nus, scene_nu=0.0):
        blocks = [
            rts.Block((0.2, y), (0.8, y + 0.2), velocity=u, kinematic_viscosity=nu)
            for y, u, nu in zip((0.2, 0.4), (lower, upper), nus, strict=True)
        ]
        sim = simulate(scene(fluids=blocks, kinematic_viscosity=scene_nu, **quiet), rts.Uniform())
        return sim.particles.to_numpy(sim.particles.a)

    same = shear(None, None, scene_nu=0.02)
    assert np.abs(same).max() > 1
    np.testing.assert_allclose(shear(0.02, 0.02), same, rtol=1e-12)
    assert np.abs(shear(0.02, 0.0)).max() < 1e-9  # thin water lets the other slip, and each is at rest in itself
    np.testing.assert_allclose(shear(0.06, 0.02), 1.5 * same, rtol=1e-9, atol=1e-12)  # the harmonic mean 0.03


@pytest.mark.slow
def test_only_viscous_blocks_step_short(simulate):
    still = {"gravity": (0, 0), "sound_speed": 20.0, "walls": False}
    blocks = [rts.Block((0.1, 0.1), (0.3, 0.3), kinematic_viscosity=1.0), rts.Block((0.7, 0.7), (0.9, 0.9))]
    split = scene(fluids=blocks, **still)
    viscous = 0.125 * 0.05**2 / 1.0
    acoustic = 0.4 * 0.1 / 20.0
    thick = np.arange(32) < 16
    assert rts.Uniform().timeline(split).tick == pytest.approx(viscous)
    for stepper in (rts.Regional(levels=6, courant=0.4), rts.Asynchronous()):
        sim = simulate(split, stepper)
        sim.advance_to(0.05)
        steps = sim.steps()
        assert steps[thick].max() <= viscous * (1 + 1e-6)
        assert steps[~thick].min() >= min(6 * viscous, acoustic) * (1 - 1e-6)


@pytest.mark.slow
def test_walls_do_not_let_fluid_slip(simulate):
    """A linear profile over a lattice at rest on the wall feels no viscous force (Morris, Fox & Zhu 1997)."""
    quiet = {"gravity": (0, 0), "artificial_viscosity": 0.0, "sound_speed": 20.0}
    for density, ratio, kernel, most in (
        ("continuity", 2.0, "cubic_spline", 1e-8),
        ("continuity", 3.0, "wendland_c2", 1e-8),
        ("summation", 4.0, "wendland_c2", 0.02),
        ("summation", 2.5, "wendland_c2", 0.02),
    ):
        flow = rts.LinearField(((0, 1), (0, 0)))
        block = rts.Block((0, 0), (1, 0.5), velocity=flow)
        medium = {"density": density, "support_ratio": ratio, "kernel": kernel, "kinematic_viscosity": 0.01}
        sim = simulate(scene(fluids=[block], **medium, **quiet), rts.Uniform())
        x, a = sim.positions(), sim.particles.to_numpy(sim.particles.a)
        first = (x[:, 1] < 0.05) & (abs(x[:, 0] - 0.5) < 0.3)
        slip = simulate(scene(fluids=[block], walls=False, **medium, **quiet), rts.Uniform())
        without = slip.particles.to_numpy(slip.particles.a)
        assert np.abs(a[first, 0]).max() < most * np.abs(without[first, 0]).max()
