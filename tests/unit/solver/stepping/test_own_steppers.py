"""A stepper defined in a script: the same bits as `Uniform` where it takes the same steps, checkpoints, lists, refusals."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

import taichi_rts as rts
from taichi_rts.compare import sweeps
from taichi_rts.compare.variants import make_variants
from taichi_rts.device.backend import ti
from taichi_rts.solver.stepping import steppers
from taichi_rts.solver.stepping.timeline import Timeline
from taichi_rts.solver.stepping.uniform import UniformSchedule

SCENE = rts.Scene(
    domain=rts.Box((0, 0), (0.6, 0.6)), fluids=[rts.Block((0, 0), (0.3, 0.4))], spacing=0.04, sound_speed=20.0
)


@dataclass(frozen=True)
class Gentle(rts.Stepper):
    """One step for all, of half the length the first `gentle` times."""

    courant: float = 0.4
    gentle: int = 10

    name: ClassVar[str] = "gentle"

    def timeline(self, scene):
        return Timeline(0.5 * (self.courant * scene.support / scene.wave_speed))

    def schedule(self, scene, particles, grid, timeline):
        return GentleSchedule(self.gentle, particles, grid)


@ti.data_oriented
class GentleSchedule(UniformSchedule):
    base_ticks = 2

    def __init__(self, gentle, particles, grid):
        super().__init__(particles, grid)
        self.gentle = gentle
        self.seen = ti.field(ti.i32, ())

    def next_ticks(self):
        return 1 if self.steps < self.gentle else 2

    def observe(self, now, tick):
        self.seen[None] += 1


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setattr(steppers, "STEPPERS", dict(steppers.STEPPERS))
    return rts.register_stepper(Gentle)


def states(sim, until=0.05):
    sim.advance_to(until)
    return [array.tobytes() for array in sim.state()[:3]]


def test_with_the_same_steps_it_has_the_bits_of_uniform(simulate):
    there = states(simulate(SCENE, rts.Uniform()))
    sim = simulate(SCENE, Gentle(gentle=0))
    assert states(sim) == there
    assert sim.base_step == rts.Uniform().timeline(SCENE).tick
    assert sim.statistics["active_fraction"] == 1.0


def test_a_checkpoint_goes_on_with_the_same_bits(simulate, registered, tmp_path):
    path = tmp_path / "own.npz"
    sim = simulate(SCENE, Gentle(gentle=40))
    sim.advance_to(0.01)
    assert 0 < sim.schedule.steps < 40  # so that the number of steps decides the next
    rts.save_checkpoint(sim, path)
    steps, seen = sim.schedule.steps, int(sim.schedule.seen[None])
    there = states(sim)
    assert sim.schedule.steps > 40
    rts.init("cpu", "f64", restart=True, advanced_optimization=False)
    again = rts.load_checkpoint(path)
    assert (again.stepper, again.schedule.steps, int(again.schedule.seen[None])) == (Gentle(gentle=40), steps, seen)
    assert states(again) == there
    del steppers.STEPPERS["gentle"]
    with pytest.raises(
        rts.CheckpointError,
        match=r"own.npz: stepper 'gentle' is none of uniform, regional, asynchronous; .*load_checkpoint\(..., steppers",
    ):
        rts.load_checkpoint(path)
    rts.init("cpu", "f64", restart=True, advanced_optimization=False)
    assert rts.load_checkpoint(path, steppers=[Gentle]).schedule.steps == steps


def test_comparisons_know_what_is_registered(registered):
    assert sweeps.choose("uniform,gentle") == ["uniform", "gentle"]
    assert sweeps.known_keys("gentle") == ["gentle"]
    options = [sweeps.parse_sweep("gentle.gentle=5,6")]
    found = make_variants([(SCENE, {})], ["uniform", "gentle"], [0.4], options)
    own = [variant for variant in found if variant.family == "gentle"]
    assert [variant.stepper["gentle"] for variant in own] == [5, 6]
    assert [steppers.stepper_from(variant.stepper) for variant in own] == [Gentle(0.4, 5), Gentle(0.4, 6)]
    assert {variant.equal_step for variant in own} == {0.2}
    assert "gentle" in steppers.setups("mapped")


class NoDataclass(rts.Stepper):
    name = "plain"


@dataclass(frozen=True)
class Nameless(rts.Stepper):
    courant: float = 0.4


@dataclass(frozen=True)
class Double(rts.Stepper):
    name: ClassVar[str] = "regional"


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Gentle(), r"is no class derived from taichi_rts.Stepper; give the class, not an object of it"),
        (dict, r"is no class derived from taichi_rts.Stepper"),
        (NoDataclass, r"NoDataclass is no dataclass; write @dataclass\(frozen=True\) above it"),
        (Nameless, r"Nameless has no name; give it a class attribute, name = 'own'"),
        (Double, r"Double has the name 'regional' of Regional; give it another one"),
    ],
)
def test_what_is_no_stepper_is_refused(kind, message):
    with pytest.raises(rts.StepperError, match=message):
        rts.register_stepper(kind)
    with pytest.raises(rts.StepperError, match=message):
        steppers.stepper_from({"name": "uniform"}, [kind])


def test_one_list_serves_all():
    names = list(steppers.STEPPERS)
    assert names == ["uniform", "regional", "asynchronous"]
    assert list(sweeps.kinds())[:4] == list(sweeps.ONE_SOUND_SPEED) == ["uniform", "regional", "paper", "asynchronous"]
    assert list(sweeps.kinds())[4:] == ["uniform-c", "regional-c", "asynchronous-c"]
    assert {setup.name for _kind, setup in steppers.setups("mapped").values() if setup.regional_sound} == {
        "uniform-c",
        "regional-c",
        "asynchronous-c",
    }


def test_a_name_means_the_same_stepper_in_comparisons_and_in_the_map():
    compared, mapped = steppers.setups("compared"), steppers.setups("mapped")
    assert set(compared) <= set(mapped)
    for name, (kind, setup) in compared.items():
        assert (mapped[name][0], mapped[name][1].parameters) == (kind, setup.parameters), name


def test_a_stepper_may_be_given_by_its_name():
    assert steppers.as_stepper("uniform") == rts.Uniform()
    assert steppers.as_stepper(None) == rts.Regional()
    own = rts.Asynchronous(courant=0.3)
    assert steppers.as_stepper(own) is own


@pytest.mark.parametrize(
    ("stepper", "said"),
    [
        ("regionl", "stepper 'regionl' is none of uniform, regional, asynchronous; did you mean 'regional'"),
        (rts.Regional, r"stepper Regional is a class; give an object of it, Regional\(\)"),
        (0.4, "stepper 0.4 is none; give e.g. rts.Regional"),
    ],
)
def test_what_is_meant_by_no_stepper_is_said(stepper, said):
    with pytest.raises(rts.StepperError, match=said):
        steppers.as_stepper(stepper)


def test_the_package_lists_what_is_public():
    assert set(dir(rts)) == {*rts.__all__, "__version__"}
