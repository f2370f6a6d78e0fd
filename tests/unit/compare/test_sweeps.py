import pytest

import taichi_rts as rts
from taichi_rts.compare import sweeps
from taichi_rts.compare.runner import Settings, plan
from taichi_rts.compare.sweeps import Sweep, parse_sweep
from taichi_rts.compare.variants import smallest_step

SCENE = rts.Scene(domain=rts.Box((0, 0), (2, 2)), fluids=[rts.Block((0, 0), (1, 1))], spacing=0.1)


@pytest.mark.parametrize(
    ("text", "value"),
    [("true", True), ("False", False), ("none", None), ("3", 3), ("0.5", 0.5), ("1e-3", 1e-3), ("stale", "stale"),
     ("'stale'", "stale"), ("[0, -9.81]", [0, -9.81])],
)  # fmt: skip
def test_scalars_are_read_as_in_toml(text, value):
    found = sweeps.parse_scalar(text)
    assert found == value
    assert type(found) is type(value)


def test_a_sweep_has_a_target_a_key_and_values():
    assert parse_sweep("levels=2,3") == Sweep(None, "levels", (2, 3))
    assert parse_sweep("regional.lambda-f=0.1,none") == Sweep("regional", "lambda_f", (0.1, None))
    assert parse_sweep("scene.gravity=[0,-9.81],[0,-1]") == Sweep("scene", "gravity", ([0, -9.81], [0, -1]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("levels", ["levels", "KEY=VALUE"]),
        ("levels=", ["KEY=VALUE"]),
        ("levels=2,,3", ["empty value"]),
        ("levls=2", ["levls", "did you mean levels"]),
        ("regionl.levels=2", ["regionl", "did you mean regional"]),
        ("uniform.alpha=2", ["alpha", "adaptive"]),
        ("courant=0.2", ["--courants"]),
        ("scene.fluids=1", ["fluids"]),
    ],
)
def test_bad_sweeps_are_one_clear_error(text, words):
    with pytest.raises(rts.Error) as caught:
        parse_sweep(text)
    for word in words:
        assert word in str(caught.value)


def families(sets, steppers=("uniform", "regional", "asynchronous"), courants=(0.4,)):
    _, variants = plan(SCENE, Settings(steppers=steppers, courants=courants, sets=tuple(sets)))
    return [v.label for v in variants]


def test_a_key_goes_to_every_stepper_that_has_it_and_sweeps_are_multiplied():
    labels = families(["lambda_f=0.1,0.2", "regional.levels=2,3"])
    assert [label for label in labels if label.startswith("regional")] == [
        f"regional lambda_f={f} levels={n} λ=0.4" for f in (0.1, 0.2) for n in (2, 3)
    ]
    assert sum(label.startswith("asynchronous") for label in labels) == 2


def test_what_no_stepper_has_changes_the_scene():
    scenes, variants = plan(SCENE, Settings(steppers=("uniform",), courants=(0.4,), sets=("sound_speed=30,40",)))
    assert [scene.wave_speed for scene, _ in scenes] == [30.0, 40.0]
    assert [v.label for v in variants] == ["uniform sound_speed=30 λ=0.4", "uniform sound_speed=40 λ=0.4"]


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        (["regional.levels=99"], ["levels", "99"]),
        (["asynchronous.levels=6"], ["levels 6", "4 or 8"]),
        (["alpha=0.1", "alpha=0.2"], ["alpha", "twice"]),
        (["paper.alpha=0.1"], ["alpha", "--steppers"]),
        (["scene.support_ratio=9"], ["support_ratio", "9"]),
        (["scene.kernel=cubic"], ["kernel", "cubic"]),
    ],
)
def test_values_that_do_not_fit_are_named(sets, words):
    with pytest.raises(rts.Error) as caught:
        families(sets)
    for word in words:
        assert word in str(caught.value)


def test_the_number_is_the_courant_number_of_the_longest_step():
    assert sweeps.make_stepper("regional", 0.6, {"levels": 3}) == rts.Regional(courant=0.6 / 3, levels=3)
    assert sweeps.make_stepper("regional", 0.6, {"levels": 3, "strict_cfl": True}).courant == 0.6
    assert sweeps.make_stepper("paper", 0.6, {}) == rts.Regional(preset="paper", courant=0.6)
    assert sweeps.make_stepper("asynchronous", 0.6, {}) == rts.Asynchronous(courant=0.6)
    for options in ({"levels": 3}, {"levels": 3, "strict_cfl": True}):
        assert sweeps.make_stepper("regional", 0.6, options).equal_step(SCENE) == pytest.approx(0.2)
    assert sweeps.make_stepper("paper", 0.4, {}).equal_step(SCENE) == pytest.approx(0.4)
    assert rts.Asynchronous(courant=0.6).equal_step(SCENE) == pytest.approx(0.6)


def test_uniform_runs_at_every_regional_base_step_are_added_once():
    _, variants = plan(SCENE, Settings(steppers=("uniform", "regional", "paper"), courants=(0.4, 0.8)))
    uniform = [(v.courant, v.role) for v in variants if v.family == "uniform"]
    steps = [(0.1333333333, "base step"), (0.2666666667, "base step"), (0.4, "sweep"), (0.8, "sweep")]
    assert uniform == steps
    assert smallest_step(variants) == pytest.approx(0.4 / 3)
    without = families([], steppers=("regional",), courants=(0.4, 0.8))
    assert without[:2] == ["uniform λ=0.1333", "uniform λ=0.2667"]


def test_lists_are_checked():
    assert sweeps.choose("paper, uniform,paper") == ["paper", "uniform"]
    assert sweeps.numbers("0.8,0.2", "--courants") == [0.2, 0.8]
    for bad in ("unifrom", ""):
        with pytest.raises(rts.StepperError, match="uniform"):
            sweeps.choose(bad)
    for bad in ("a", "0", "0.4,", "3", "nan"):
        with pytest.raises(rts.Error, match="--courants"):
            sweeps.numbers(bad, "--courants")
