"""A collapsing column against the experiment of Martin & Moyce 1952 (n^2 = 2, a = 2.25 in)."""

import numpy as np
import pytest
from cases import FRONT_TIMES, HEIGHT, HEIGHT_TIMES
from experiments import MARTIN_MOYCE_A, MARTIN_MOYCE_FRONT, column_height, front

import taichi_rts as rts

SPACING = MARTIN_MOYCE_A / 8
FRONTS = MARTIN_MOYCE_FRONT[:, 1]

STEPPERS = {stepper.name: stepper for stepper in (rts.Uniform(), rts.Regional(), rts.Asynchronous())}
LONG = [pytest.param(stepper, marks=pytest.mark.slow) for stepper in ("uniform", "asynchronous")]


@pytest.fixture(scope="module")
def columns(start_taichi, quick, on_demand):
    """Fronts over a and heights over the first, by stepper."""

    def fall(stepper):
        with start_taichi("cpu", "f32", **quick):
            sim = rts.Simulation(rts.load_scene("martin_moyce", spacing=SPACING), STEPPERS[stepper])
            fronts, heights = {}, {}
            for time in np.union1d(FRONT_TIMES, HEIGHT_TIMES):
                sim.advance_to(time)
                fronts[time] = front(sim.positions()) / MARTIN_MOYCE_A
                heights[time] = column_height(sim.positions(), SPACING) / (2 * MARTIN_MOYCE_A)
        return np.array([fronts[t] for t in FRONT_TIMES]), np.array([heights[t] for t in HEIGHT_TIMES])

    return on_demand(fall)


@pytest.mark.parametrize("stepper", ["regional", *LONG])
def test_front_follows_the_experiment(columns, stepper):
    off = columns[stepper][0] / FRONTS - 1
    assert np.abs(off).mean() <= 0.07  # measured 0.059
    assert -0.075 < off.mean() < -0.038  # measured -0.057; gravity times 1.1: -0.016, over 1.1: -0.095


@pytest.mark.parametrize("stepper", ["regional", *LONG])
def test_column_falls_as_in_the_experiment(columns, stepper):
    off = columns[stepper][1] - HEIGHT[:, 1]
    # SPH columns stand a little higher than the experiment's. Measured 0.070; gravity times 1.1: 0.054, over 1.1: 0.083
    assert 0.06 < off.mean() < 0.08


@pytest.mark.slow
@pytest.mark.parametrize("stepper", ["regional", "asynchronous"])
def test_the_front_is_that_of_uniform_steps(columns, stepper):
    found, uniform = columns[stepper][0], columns["uniform"][0]
    assert abs(np.abs(found / FRONTS - 1).mean() - np.abs(uniform / FRONTS - 1).mean()) < 0.02
    assert found.mean() == pytest.approx(uniform.mean(), rel=0.03)
    assert np.abs(found / uniform - 1).max() < 0.03
