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
