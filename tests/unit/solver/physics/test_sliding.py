"""Faces and bodies that slide along themselves, turn or cross a periodic axis: fluid follows them as it must."""

import numpy as np
import pytest

import taichi_rts as rts

UNIT = rts.Box((0, 0), (1, 1))
STILL = {"gravity": (0, 0), "sound_speed": 10.0, "density": "continuity", "kernel": "wendland_c2"}
VISCOUS = STILL | {"artificial_viscosity": 0.0, "background_pressure": 500.0}


def lid_driven(spacing, nu, **more):
    lid = rts.MovingWall("y+", velocity=(1.0, 0.0))
    return rts.Scene(UNIT, (rts.Block((0, 0), (1, 1)),), spacing, kinematic_viscosity=nu, moving_walls=(lid,), **more)


def test_couette_flow_under_a_box_that_spans_the_periodic_axis(simulate):
    box = rts.BoxObstacle((0, 1), (1, 1.2), motion=rts.ConstantMotion(velocity=(1.0, 0.0)))
    medium = VISCOUS | {"kinematic_viscosity": 0.1, "periodic": ("x",), "obstacles": (box,)}
    sim = simulate(rts.Scene(rts.Box((0, 0), (1, 1.2)), (rts.Block((0, 0), (1, 1)),), 0.1, **medium), rts.Uniform())
    sim.advance_to(8.0)  # eight times around
    x, v = sim.positions(), sim.velocities()
    np.testing.assert_allclose(v[:, 0], x[:, 1], atol=0.01)  # u = y
    assert sim.statistics["stopped_by_obstacles"] == 0


def test_couette_flow_under_a_face_that_slides(simulate):
    sim = simulate(lid_driven(0.1, 0.1, periodic=("x",), **VISCOUS), rts.Uniform(), debug=True)
    sim.advance_to(7.0)
    work = sim.work()
    sim.advance_to(8.0)
    x, v = sim.positions(), sim.velocities()
    np.testing.assert_allclose(v[:, 0], x[:, 1], atol=0.01)  # u = y
    assert sim.work() - work == pytest.approx(1000.0 * 0.1, rel=0.15)  # rho nu u^2 [W] over 1 s


@pytest.mark.slow
def test_lid_driven_cavity(simulate):
    """With 40 particles across the least velocity is 5 % too small: not yet the 3 % that are wanted."""
    medium = VISCOUS | {"support_ratio": 3.0, "background_pressure": 1000.0}
    sim = simulate(lid_driven(0.025, 0.01, **medium), rts.Uniform())
    rows = []
    for time in np.arange(15.0, 25.1, 0.5):
        sim.advance_to(time)
        x, v = sim.positions(), sim.velocities()
        middle = np.abs(x[:, 0] - 0.5) < 0.025
        row = np.digitize(x[middle, 1], np.linspace(0, 1, 21))
        rows.append([v[middle, 0][row == k].mean() for k in range(1, 21)])
    assert np.mean(rows, axis=0).min() == pytest.approx(-0.211, rel=0.08)  # Ghia, Ghia & Shin 1982, Re 100


@pytest.mark.parametrize("shape", ["disc", pytest.param("bar", marks=pytest.mark.slow)])
def test_a_body_may_lie_across_a_periodic_face(simulate, shape):
    """It does what it does amid the domain, and the water around it as well."""
    states = []
    for middle in (0.5, 0.0):
        motion = rts.ConstantMotion(velocity=(1.0, 0.3), angular_velocity=8.0)
        disc = rts.SphereObstacle((middle, 0.4), 0.12, motion=motion)
        bar = rts.BoxObstacle((middle - 0.2, 0.35), (middle + 0.2, 0.45), motion=motion)
        scene = rts.Scene(
            UNIT,
            (rts.Block((0, 0), (1, 0.8)),),
            0.05,
            periodic=("x",),
            kinematic_viscosity=0.02,
            sound_speed=40.0,
            obstacles=(disc if shape == "disc" else bar,),
        )
        sim = simulate(scene, rts.Uniform())
        sim.advance_to(0.05)
        x, v = sim.positions(), sim.velocities()
        x[:, 0] = (x[:, 0] - middle) % 1.0
        order = np.lexsort((x[:, 0], x[:, 1]))
        states.append((x[order], v[order], sim.obstacle_forces().torques))
    (x, v, torque), (x_too, v_too, torque_too) = states
    assert np.linalg.norm(v, axis=1).max() > 0.5
    np.testing.assert_allclose(x_too, x, atol=1e-9)
    np.testing.assert_allclose(v_too, v, atol=1e-7)
    np.testing.assert_allclose(torque_too, torque, rtol=1e-7)


def ring_of_water(spacing, rate, density):
    """A ring in two dimensions, cut open by a hair, that turns at `rate` [rad/s] with water of 0.02 m^2/s inside."""
    angle = np.linspace(1e-3, 2.0 * np.pi + 1e-3 - 1e-6, 97)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = 0.5 + np.concatenate([0.34 * circle, 0.24 * circle[::-1]])
    rings = []
    for radius in (np.arange(round(0.24 / spacing)) + 0.5) * spacing:
        turns = 2.0 * np.pi * (np.arange(round(2.0 * np.pi * radius / spacing)) / round(2.0 * np.pi * radius / spacing))
        rings.append(0.5 + radius * np.stack([np.cos(turns), np.sin(turns)], axis=1))
    turning = rts.ConstantMotion(angular_velocity=rate, pivot=(0.5, 0.5))
    return rts.Scene(
        UNIT,
        (rts.Particles(np.concatenate(rings)),),
        spacing,
        gravity=(0, 0),
        sound_speed=15.0,
        density=density,
        kinematic_viscosity=0.02,
        background_pressure=2000.0,
        obstacles=(rts.PolygonObstacle(tuple(map(tuple, points)), motion=turning),),
        walls=False,
    )


@pytest.mark.parametrize(
    ("density", "spacing", "off"),
    [("summation", 0.02, 0.01), pytest.param("continuity", 0.012, 0.015, marks=pytest.mark.slow)],
)
def test_water_in_a_ring_that_turns_is_as_fast_as_its_inside(simulate, density, spacing, off):
    """Its wall particles are a seventh faster. Around a cavity in the middle water turns with A r + B/r: taken at the face."""
    sim = simulate(ring_of_water(spacing, 5.0, density), rts.Uniform())
    fits = []
    for time in (2.0, 2.25, 2.5, 2.75, 3.0):
        sim.advance_to(time)
        (x, y), v = (sim.positions() - 0.5).T, sim.velocities()
        r2, spin = x * x + y * y, x * v[:, 1] - y * v[:, 0]
        outer = r2 > 0.12**2
        a, b = np.linalg.lstsq(np.stack([r2, np.ones_like(r2)], axis=1)[outer], spin[outer], rcond=None)[0]
        fits.append(a + b / 0.24**2)
    assert np.mean(fits) == pytest.approx(5.0, rel=off)


@pytest.mark.slow
def test_water_in_a_cup_that_turns(simulate, tmp_path):
    """It turns as the cup, whose wall particles are faster, and its rim stands as high as it must."""
    trimesh = pytest.importorskip("trimesh")
    spacing, rate, radius, outer, floor = 0.03, 5.0, 0.24, 0.32, 0.08
    profile = [[0, 0], [outer, 0], [outer, 0.6], [radius, 0.6], [radius, floor], [0, floor]]
    cup = trimesh.creation.revolve(np.array(profile), sections=64)
    cup.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2.0, [1, 0, 0]))
    cup.apply_translation((0.5, 0.05, 0.5))
    if cup.volume < 0.0:
        cup.invert()
    cup.export(tmp_path / "cup.stl")
    across = np.arange(0.5 * spacing, 1.0, spacing)
    heights = np.arange(0.05 + floor + 0.5 * spacing, 0.05 + floor + 0.3, spacing)
    x = np.stack(np.meshgrid(across, heights, across, indexing="ij"), axis=-1).reshape(-1, 3)
    x = x[np.hypot(x[:, 0] - 0.5, x[:, 2] - 0.5) < radius - 0.5 * spacing]
    body = rts.MeshObstacle(str(tmp_path / "cup.stl"), motion=rts.ConstantMotion(angular_velocity=(0, rate, 0)))
    scene = rts.Scene(
        rts.Box((0, 0, 0), (1, 1, 1)), (rts.Particles(x),), spacing, kinematic_viscosity=0.02, obstacles=(body,)
    )
    sim = simulate(scene, rts.Regional())
    sim.advance_to(3.2)
    x, v = sim.positions() - 0.5, sim.velocities()
    r = np.hypot(x[:, 0], x[:, 2])
    spin = (x[:, 2] * v[:, 0] - x[:, 0] * v[:, 2]) / r**2
    assert np.median(spin) == pytest.approx(rate, rel=0.01)
    rim, middle = (np.sort(x[(r >= a) & (r < b), 1])[-6:].mean() for a, b in ((radius - 0.05, radius), (0.0, 0.06)))
    rise = rate**2 * ((radius - 0.005) ** 2 - 0.03**2) / (2.0 * 9.81)  # between where the highest particles stand
    assert rim - middle == pytest.approx(rise, rel=0.1)
