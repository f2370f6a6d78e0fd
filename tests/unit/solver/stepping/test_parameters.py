"""Parameters of steppers."""

import pytest

import taichi_rts as rts


def test_stepper_parameters_are_validated_together():
    with pytest.raises(rts.StepperError) as caught:
        rts.Regional(levels=0, courant=3, preset="papr", alpa=1)
    for part in ("levels", "courant", "(got 3)", "preset", "'paper'", "did you mean 'alpha'?"):
        assert part in str(caught.value)
    with pytest.raises(rts.StepperError, match="'serna' or 'symplectic_euler'"):
        rts.Uniform(integrator="euler")


def test_presets_of_the_regional_stepper():
    paper = rts.Regional(preset="paper")
    assert [paper.resolved(key) for key in ("courant", "levels", "strict_cfl")] == [0.4, 3, False]
    assert rts.Regional(preset="paper", levels=5, courant=0.2).resolved("levels") == 5
    assert rts.Regional(preset="paper", levels=5, courant=0.2).resolved("courant") == 0.2
    assert rts.Regional(levels=1).resolved("courant") == rts.Uniform().courant
