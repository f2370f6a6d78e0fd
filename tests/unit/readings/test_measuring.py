import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.medium.medium import Medium
from taichi_rts.readings import measures
from taichi_rts.readings.measures import FaceForces, interpolate, water_height
from taichi_rts.sampling.sampling import calibrate_mass, sample
from taichi_rts.scene.geometry.periodic import periods


def pool(dim=2, size=(1.0, 0.3), spacing=0.02, **changes):
    """Water at rest of a width and a height, as deep as half of it in three dimensions."""
    lower, upper = np.zeros(dim), np.array([*size, 0.5 * size[0]][:dim])
    domain = rts.Box(tuple(lower), tuple(np.where(np.arange(dim) == 1, 1.0, upper)))
    options = {"domain": domain, "fluids": [rts.Block(tuple(lower), tuple(upper))], "spacing": spacing} | changes
    return rts.Scene(**options)


def medium_of(scene):
    return Medium.of(scene, calibrate_mass(scene))


@pytest.mark.parametrize("kernel", ["cubic_spline", "wendland_c2"])
@pytest.mark.parametrize(("dim", "spacing"), [(2, 0.02), (3, 0.05)])
def test_a_gauge_finds_the_surface_of_a_pool_up_to_its_walls(dim, spacing, kernel):
    scene = pool(dim, spacing=spacing, kernel=kernel)
    x = sample(scene).positions
    for along in (0.5, 0.987, 1.0, 0.0):
        place = np.array([along, 0.7, 0.5][:dim])
        assert water_height(scene, medium_of(scene), x, place) == pytest.approx(0.3, abs=0.05 * spacing)


def test_a_gauge_sees_no_single_drops_and_nothing_where_it_is_dry():
    scene = pool(domain=rts.Box((0, 0), (2, 1)))
    x = np.concatenate([sample(scene).positions, [[0.5, 0.8], [1.6, 0.5]]])
    medium = medium_of(scene)
    assert water_height(scene, medium, x, np.array([0.5, 0.0])) == pytest.approx(0.3, abs=0.001)
    assert water_height(scene, medium, x, np.array([1.6, 0.0])) == 0.0
    thin = np.stack([np.arange(0.01, 1.0, 0.02), np.full(50, 0.01)], axis=1)
    assert water_height(scene, medium, thin, np.array([0.5, 0.0])) == pytest.approx(0.02, abs=0.002)


def test_a_gauge_stands_along_gravity_and_sees_across_periodic_faces():
    scene = pool(periodic=("x",), walls=True)
    x = sample(scene).positions
    assert water_height(scene, medium_of(scene), x, np.array([0.0, 0.0])) == pytest.approx(0.3, abs=0.001)
    hanging = pool(gravity=(0, 9.81))
    turned = sample(hanging).positions * [1, -1] + [0, 1.0]  # it lies under the ceiling
    assert water_height(hanging, medium_of(hanging), turned, np.array([0.5, 0.0])) == pytest.approx(0.3, abs=0.001)
    sideways = pool(gravity=(-9.81, 0))
    x = sample(sideways).positions
    assert water_height(sideways, medium_of(sideways), x, np.array([0.0, 0.1])) == pytest.approx(1.0, abs=0.001)


def test_interpolation_is_exact_for_constants_and_zero_where_it_is_empty():
    scene = pool()
    x, kernel = sample(scene).positions, medium_of(scene).kernel
    points = np.array([[0.5, 0.15], [0.0, 0.0], [0.5, 0.9]])
    np.testing.assert_allclose(interpolate(x, np.full(len(x), 7.0), points, kernel, periods(scene)), [7.0, 7.0, 0.0])
    linear = interpolate(x, 100.0 * x[:, 1], points[:1], kernel, periods(scene))
    np.testing.assert_allclose(linear, [15.0], rtol=1e-9)
    assert measures.front(x) == pytest.approx(0.99)


def test_the_walls_carry_what_hydrostatics_says():
    """Particles on their lattice with the pressure of their depth, against walls that mirror it."""
    scene = pool(density="continuity", size=(1.0, 0.5), sound_speed=60.0)
    x, medium = sample(scene).positions, medium_of(scene)
    p = 1000.0 * 9.81 * (0.5 - x[:, 1])
    forces = FaceForces(scene, medium)
    found = dict(zip(forces.faces, forces.at(0.0, x, np.full(len(x), 1000.0), p), strict=True))
    assert found["y-"] == pytest.approx(1000.0 * 9.81 * 0.5, rel=0.02)
    assert found["x-"] == pytest.approx(found["x+"], rel=1e-9)
    assert found["x-"] == pytest.approx(0.5 * 1000.0 * 9.81 * 0.25, rel=0.03)
    assert found["y+"] == 0.0


def test_faces_without_walls_have_no_force():
    assert FaceForces(pool(walls=False), medium_of(pool())).faces == []
    periodic = pool(periodic=("x",))
    assert FaceForces(periodic, medium_of(periodic)).faces == ["y-", "y+"]
    jet = pool(inflows=[rts.Inflow((0.0, 0.6), (0.0, 0.8), (1.0, 0.0), stop=0.1)])
    assert FaceForces(jet, medium_of(jet)).faces == ["x-", "x+", "y-", "y+"]  # the patch is a part of the face


@pytest.mark.parametrize("density", ["summation", pytest.param("continuity", marks=pytest.mark.slow)])
def test_forces_are_the_reaction_to_what_the_solver_does(start_taichi, quick, density):
    """Against the walls' share of all accelerations in a debug run, with no friction at the walls."""
    piston = rts.MovingWall("x+", times=(0.0, 1.0), displacements=(0.0, -0.5))
    scene = pool(
        size=(0.9, 0.3),
        spacing=0.03,
        density=density,
        artificial_viscosity=0.0,
        moving_walls=[piston],
        sound_speed=40.0,
    )
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(scene, rts.Uniform(), debug=True)
        sim.advance_to(0.25)
        forces = FaceForces(scene, sim.medium)
        x, _v, rho, _level = sim.state()
        found = dict(zip(forces.faces, forces.at(sim.time, x, rho, sim.pressures()), strict=True))
        wanted = -sim.medium.mass * sim.particles.a_walls.to_numpy().sum(axis=0)
    assert found["x+"] > 100.0
    # Not to rounding: states are read after they have been corrected and predicted to the frame's time.
    assert found["x+"] - found["x-"] == pytest.approx(wanted[0], abs=0.05 * found["x+"])
    assert found["y+"] - found["y-"] == pytest.approx(wanted[1], rel=0.03)
