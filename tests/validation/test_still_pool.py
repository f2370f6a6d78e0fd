"""Water at rest: whatever moves is error."""

import numpy as np
import pytest

import taichi_rts as rts

DEPTH, SPACING = 0.5, 0.1
CALM = np.sqrt(9.81 * DEPTH)

STEPPERS = {stepper.name: stepper for stepper in (rts.Uniform(), rts.Regional(), rts.Asynchronous())}
LONG = [pytest.param(stepper, marks=pytest.mark.slow) for stepper in ("uniform", "asynchronous")]


@pytest.fixture(scope="module")
def pools(start_taichi, quick, on_demand):
    def rest(stepper):
        with start_taichi("cpu", "f32", **quick):
            sim = rts.Simulation(rts.load_scene("still_pool", spacing=SPACING), STEPPERS[stepper])
            sim.advance_to(2.0)
            return (*sim.state(), sim.pressures(), sim.statistics["stopped_by_domain"])

    return on_demand(rest)


def rms_speed(pool):
    return np.sqrt((pool[1].astype(float) ** 2).sum(axis=1).mean())


@pytest.mark.parametrize("stepper", ["regional", *LONG])
def test_it_comes_to_rest(pools, stepper):
    assert rms_speed(pools[stepper]) < 0.05 * CALM


@pytest.mark.parametrize("stepper", ["regional", *LONG])
def test_depth_stays_and_no_particle_is_lost(pools, stepper):
    x, stopped = pools[stepper][0], pools[stepper][-1]
    assert len(x) == 500
    assert np.isfinite(x).all()
    assert (x >= 0).all()
    assert (x <= [1.0, 0.8, 1.0]).all()
    assert stopped == 0
    assert x[:, 1].max() + 0.5 * SPACING == pytest.approx(DEPTH, rel=0.04)


@pytest.mark.parametrize("stepper", ["regional", *LONG])
def test_pressure_carries_the_water_above(pools, stepper):
    x, p = pools[stepper][0], pools[stepper][4]
    inner = (np.abs(x[:, [0, 2]] - 0.5) < 0.3).all(axis=1) & (np.abs(x[:, 1] - 0.25) < 0.15)
    hydrostatic = 1000 * 9.81 * (DEPTH - x[inner, 1])
    assert p[inner].mean() == pytest.approx(hydrostatic.mean(), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("stepper", ["regional", "asynchronous"])
def test_it_is_as_calm_as_with_uniform_steps(pools, stepper):
    assert rms_speed(pools[stepper]) <= 1.2 * rms_speed(pools["uniform"]) + 0.002 * CALM


@pytest.mark.slow
@pytest.mark.parametrize("density", ["summation", "continuity"])
@pytest.mark.parametrize(("size", "rows"), [((1.04, 0.5), (10, 5)), ((0.549, 0.58), (5, 6)), ((1.29, 0.59), (13, 6))])
def test_a_pool_whose_size_is_no_multiple_of_the_spacing_rests_as_well(start_taichi, quick, size, rows, density):
    """It began with gaps of up to a spacing at a wall, and fell into them at 0.5 sqrt(g H)."""
    block = rts.Block((0, 0), size)
    fields = {"spacing": SPACING, "density": density, "hydrostatic": True}
    with start_taichi("cpu", "f32", **quick):
        sim = rts.Simulation(rts.Scene(domain=rts.Box((0, 0), (size[0], 1.0)), fluids=[block], **fields))
        assert sim.count == rows[0] * rows[1]
        fastest = 0.0
        for time in np.linspace(0.05, 1.0, 20):
            sim.advance_to(time)
            fastest = max(fastest, np.linalg.norm(sim.velocities(), axis=1).max())
        height, stopped = sim.positions()[:, 1].mean(), sim.statistics["stopped_by_domain"]
    assert fastest < 0.15 * np.sqrt(9.81 * size[1])
    assert height == pytest.approx(0.5 * size[1], rel=0.03)
    assert stopped == 0
