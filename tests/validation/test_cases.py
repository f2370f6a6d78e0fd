"""The validation cases at a coarse size (docs/validation.md has two sizes and all steppers).

Each bound would catch a factor of 1.1 in what the comment beside it names; errors with a wrong factor come from runs with it.
"""

import numpy as np
import pytest
from cases import CASES, run
from exact import poiseuille

import taichi_rts as rts

STEPPERS = {
    "uniform": rts.Uniform(),
    "regional": rts.Regional(),
    "paper": rts.Regional(preset="paper"),
    "asynchronous": rts.Asynchronous(steps="integers", stagger=1),
}
"""The default regions keep calm water on its longest step; the paper's setting steps regions apart."""


@pytest.fixture
def errors(start_taichi, quick):
    """Return a function that runs a case and returns its errors."""

    def measure(case, stepper, **wrong):
        with start_taichi("cpu", "f64", **quick):
            found, statistics = run(CASES[case], STEPPERS[stepper], **wrong)
        assert statistics["stopped_by_domain"] == statistics["runaways"] == 0
        return found

    return measure


def test_poiseuille_series():
    y = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(poiseuille(y, 1e3, 0.8, 0.1), 4.0 * y * (1.0 - y), atol=1e-9)
    np.testing.assert_allclose(poiseuille(y[1:-1], 0.0, 0.8, 0.1), 0.0, atol=1e-4)
    assert poiseuille(0.5, 0.01, 0.8, 0.1) == pytest.approx(0.8 * 0.01, rel=1e-4)  # too early for the walls to be felt


@pytest.mark.parametrize("stepper", ["uniform", "regional", "asynchronous"])
def test_hydrostatic_column(errors, stepper):
    assert errors("hydrostatic_column", stepper)["pressure"] < 0.045


@pytest.mark.parametrize("stepper", ["uniform", "paper", "asynchronous"])
def test_taylor_green(errors, stepper):
    found = errors("taylor_green", stepper)
    assert found["speed"] < 0.05
    assert found["velocities"] < 0.08


@pytest.mark.parametrize("stepper", ["uniform", "paper", "asynchronous"])
def test_poiseuille(errors, stepper):
    found = errors("poiseuille", stepper)
    assert found["velocity, largest"] < 0.03
    assert found["velocity, start-up"] < 0.03
    assert found["velocity, steady"] < 0.03


@pytest.mark.parametrize("stepper", ["uniform", "regional", "asynchronous"])
def test_standing_wave(errors, stepper):
    found = errors("standing_wave", stepper)
    assert abs(found["period"]) < 0.03
    assert -0.1 < found["crest"] < 0.02


@pytest.mark.parametrize("stepper", ["uniform", "paper"])
def test_koshizuka_oka(errors, stepper):
    found = errors("koshizuka_oka", stepper)
    assert found["front"] < 0.08
    assert abs(found["front, signed"]) < 0.05
