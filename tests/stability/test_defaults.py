"""The cheapest hard cases at the steppers' defaults; `taichi-rts stability` runs them all and finds the largest step."""

import pytest

import taichi_rts as rts
from taichi_rts.stability import chart
from taichi_rts.stability.cases import CASES
from taichi_rts.stability.suite import SETTINGS, Plan
from taichi_rts.trials.survival import watch

BY_NAME = {case.name: case for case in CASES}
BY_STEPPER = {setting.name: setting for setting in SETTINGS}


def run(start_taichi, quick, case, stepper, demanded=None):
    setting = BY_STEPPER[stepper]
    with start_taichi("cpu", "f32", **quick):
        return watch(BY_NAME[case].scene, setting.make(setting.default), samples=160, demanded_density=demanded)


@pytest.mark.slow
@pytest.mark.parametrize("stepper", ["regional", "uniform", "uniform-adaptive"])
def test_a_block_at_mach_one_half_on_a_pool(start_taichi, quick, stepper):
    outcome = run(start_taichi, quick, "pool_impact_0.5", stepper, demanded=1.46)  # of `suite.reference_density`
    assert outcome.reason == ""
    assert outcome.energy <= 1.005
    assert 1.25 < outcome.density < 1.53
    assert 0.6 * 40 < outcome.speed < 1.2 * 40


@pytest.mark.parametrize("stepper", ["regional", pytest.param("asynchronous", marks=pytest.mark.slow)])
def test_a_block_at_mach_0_7_on_a_wall(start_taichi, quick, stepper):
    outcome = run(start_taichi, quick, "wall_impact_0.7", stepper, demanded=1.66)
    assert outcome.reason == ""
    assert outcome.runaways == 0


@pytest.mark.slow
def test_a_fixed_step_cannot_stop_a_block_at_mach_0_7(start_taichi, quick):
    """Documented in docs/evidence/stability.md; should it survive one day, the docs have to change."""
    outcome = run(start_taichi, quick, "wall_impact_0.7", "uniform", demanded=1.66)
    assert not outcome.survived
    assert outcome.time < 0.02


def test_the_regional_sound_speed_changes_the_scene_and_skips_what_it_cannot_serve():
    setting, case = BY_STEPPER["regional-c"], BY_NAME["pool_impact_0.5"]
    assert setting.scene(case).regional_sound == rts.RegionalSound()
    assert BY_STEPPER["regional"].scene(case) == case.scene
    plan = Plan([case, BY_NAME["still_pool_continuity"]], [BY_STEPPER["regional"], setting])
    assert [(one.name, other.name) for one, other in plan.cells] == [
        ("pool_impact_0.5", "regional"),
        ("pool_impact_0.5", "regional-c"),
        ("still_pool_continuity", "regional"),
    ]
    assert plan.key(case, setting) != plan.key(case, BY_STEPPER["regional"])
    (note,) = chart.notes(plan)
    assert note.startswith("left out: still_pool_continuity with regional-c: sound_speed: ")
    assert "use density 'summation'" in note


@pytest.mark.slow
@pytest.mark.parametrize("stepper", ["regional-c", "asynchronous-c"])
def test_a_block_at_20_m_s_on_a_pool_with_the_regional_sound_speed(start_taichi, quick, stepper):
    setting = BY_STEPPER[stepper]
    with start_taichi("cpu", "f32", **quick):
        outcome = watch(setting.scene(BY_NAME["pool_impact_0.5"]), setting.make(setting.default), demanded_density=1.2)
    assert outcome.reason == ""
    assert outcome.energy <= 1.005
