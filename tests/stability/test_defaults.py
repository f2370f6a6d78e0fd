"""The cheapest hard cases at the steppers' defaults; `taichi-rts stability` runs them all and finds the largest step."""

import pytest

from taichi_rts.stability.cases import CASES
from taichi_rts.stability.suite import SETTINGS
from taichi_rts.stability.survival import watch

BY_NAME = {case.name: case for case in CASES}
BY_STEPPER = {setting.name: setting for setting in SETTINGS}


def run(start_taichi, quick, case, stepper, demanded=None):
    setting = BY_STEPPER[stepper]
    with start_taichi("cpu", "f32", **quick):
        return watch(BY_NAME[case].scene, setting.make(setting.default), samples=160, demanded_density=demanded)


@pytest.mark.parametrize("stepper", ["serna", "adaptive", "regional"])
def test_a_block_at_mach_one_half_on_a_pool(start_taichi, quick, stepper):
    outcome = run(start_taichi, quick, "pool_impact_0.5", stepper, demanded=1.46)  # of `suite.reference_density`
    assert outcome.reason == ""
    assert outcome.energy <= 1.005
    assert 1.25 < outcome.density < 1.53
    assert 0.6 * 40 < outcome.speed < 1.2 * 40


@pytest.mark.parametrize("stepper", ["regional", "asynchronous"])
def test_a_block_at_mach_0_7_on_a_wall(start_taichi, quick, stepper):
    outcome = run(start_taichi, quick, "wall_impact_0.7", stepper, demanded=1.66)
    assert outcome.reason == ""
    assert outcome.runaways == 0


def test_a_fixed_step_cannot_stop_a_block_at_mach_0_7(start_taichi, quick):
    """Documented in docs/stability.md; should it survive one day, the docs have to change."""
    outcome = run(start_taichi, quick, "wall_impact_0.7", "serna", demanded=1.66)
    assert not outcome.survived
    assert outcome.time < 0.02
