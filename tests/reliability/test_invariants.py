"""Runs give what they gave when they were last found right, and what is stored is fine enough to notice wrong forces."""

import pytest
import stored_invariants as stored

import taichi_rts as rts
from taichi_rts.device.backend import ti
from taichi_rts.medium import smoothing

QUICK = ("dam_break_2d asynchronous",)
CASES = [
    f"{name} {stepper}"
    for k, name in enumerate(stored.names())
    for n, stepper in enumerate(stored.STEPPERS)
    if k % len(stored.STEPPERS) == n or f"{name} {stepper}" in QUICK
]
"""Each scene with one stepper; studies/invariants.py runs all of them."""


@ti.data_oriented
class StrongerSpline(smoothing.CubicSpline):
    """Pushes 5 % too much."""

    @ti.func
    def derivative(self, d):
        q = d * (1.0 / self.h)
        outer, inner = smoothing.positive(2.0 - q), smoothing.positive(1.0 - q)
        return 1.05 * (3.0 * self.sigma / self.h) * (inner * inner - 0.25 * outer * outer)


def found(name, stepper, start_taichi, quick, scene=None):
    with start_taichi("cpu", "f64", **quick):
        return stored.measure(scene or stored.small(name), stepper)


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=() if case in QUICK else pytest.mark.slow) for case in CASES]
)
def test_a_run_gives_what_is_stored(case, start_taichi, quick):
    assert not stored.differences(found(*case.split(), start_taichi, quick), stored.read()[case])


def test_every_scene_and_stepper_is_stored():
    assert set(stored.read()) == {f"{name} {stepper}" for name in stored.names() for stepper in stored.STEPPERS}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dam_break_2d", "hydrostatic_column", "elliptical_drop", "poiseuille"])
def test_forces_that_are_5_percent_too_large_are_noticed(name, start_taichi, quick, monkeypatch):
    monkeypatch.setitem(smoothing.KERNELS, "cubic_spline", StrongerSpline)
    said = stored.differences(found(name, "uniform", start_taichi, quick), stored.read()[f"{name} uniform"])
    assert any("kinetic" in each or "internal" in each for each in said), said


@pytest.mark.slow
def test_gravity_that_is_5_percent_too_large_is_noticed(start_taichi, quick):
    scene = stored.small("dam_break_2d")
    heavy = scene.replace(gravity=tuple(1.05 * g for g in scene.acceleration), sound_speed=scene.wave_speed)
    said = stored.differences(
        found("dam_break_2d", "uniform", start_taichi, quick, heavy), stored.read()["dam_break_2d uniform"]
    )
    assert any("potential" in each for each in said), said
    assert rts.Uniform().timeline(heavy).tick == rts.Uniform().timeline(scene).tick
