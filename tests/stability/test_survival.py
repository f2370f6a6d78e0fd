from types import SimpleNamespace

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.readings.diagnosis import diagnose
from taichi_rts.stability.cases import CASES
from taichi_rts.trials import survival
from taichi_rts.trials.survival import largest_stable, watch

BY_NAME = {case.name: case for case in CASES}


@pytest.fixture
def taichi(start_taichi, quick):
    with start_taichi("cpu", "f32", **quick):
        yield


def search(limit, **options):
    """Bisect where everything up to `limit` survives."""
    fake = SimpleNamespace(calls=0)

    def run(scene, courant):
        assert scene == "scene"
        return SimpleNamespace(survived=courant <= limit, reason=f"failed at {courant:.3f}")

    def fresh():
        fake.calls += 1

    bracket = largest_stable("scene", lambda courant: courant, fresh=fresh, run=run, **options)
    assert fake.calls == len(bracket.runs)
    return bracket


@pytest.mark.parametrize("limit", [0.13, 0.31, 0.4, 0.66, 1.2, 1.99])
def test_bisection_brackets_the_limit(limit):
    bracket = search(limit)
    assert bracket.stable <= limit < bracket.unstable <= 1.05 * bracket.stable * (1 + 1e-9)
    assert bracket.reason == f"failed at {bracket.unstable:.3f}"
    assert len(bracket.runs) <= 9


def test_bisection_starts_at_the_default_and_doubles():
    assert [courant for courant, _ in search(0.9, first=0.2, tolerance=0.2).runs][:4] == [0.2, 0.4, 0.8, 1.6]


def test_bisection_stops_at_its_bounds():
    low, high = search(0.01), search(9.0)
    assert (low.stable, low.unstable) == (None, 0.1)
    assert (high.stable, high.unstable, high.reason) == (2.0, None, "")


def test_bounds_that_are_no_interval():
    with pytest.raises(rts.Error, match=r"lowest 3, highest 2.*need 0 < lowest < highest"):
        search(1.0, lowest=3.0)


def test_a_run_that_blows_up_ends_with_its_reason_and_a_diagnosis(taichi):
    scene = BY_NAME["wall_impact_0.7"].scene
    seen = []
    outcome = watch(scene, rts.Uniform(courant=1.2), on_sample=lambda sim: seen.append(sim.time))
    assert not outcome.survived
    assert len(seen) <= 4  # it stops at the first violation
    assert f"t = {outcome.time:.4g} s" in outcome.reason

    sim = rts.Simulation(scene, rts.Uniform(courant=1.2))
    assert diagnose(sim) is None
    sim.advance_to(0.01)
    found = diagnose(sim)
    assert 0 <= found.particle < sim.count
    assert np.allclose(found.position, sim.positions()[found.particle])
    assert found.level == 1
    for words in (f"particle {found.particle}", "c_s", "level 1", "smaller courant", "sound_speed"):
        assert words in str(found)


class FrozenRun:
    """Looks like a `Simulation` of one particle that only gains energy; it may say that a wall did the work."""

    def __init__(self, scene, end):
        self.scene, self.end, self.time, self.count, self.removed_count = scene, end, 0.0, 1, 0
        self.medium = SimpleNamespace(mass=1.0, sound_speed=1.0, rest_density=1000.0, support=0.2)
        self.runaways, self.gain, self.works, self.base_step = 0, 0.0, False, 0.01

    def advance_to(self, time):
        self.time = time

    def read(self):
        x, rest = np.full((1, 2), 0.5), np.zeros((1, 2))
        state = {"positions": x, "velocities": rest, "densities": np.full(1, 1000.0), "steps": np.full(1, 0.01)}
        return SimpleNamespace(energy=self.energy(), runaways=self.runaways, **state)

    def energy(self):
        return SimpleNamespace(total=10.0 * (1.0 + self.gain * self.time / self.end))

    def work(self):
        return 10.0 * self.gain * self.time / self.end if self.works else 0.0

    @property
    def statistics(self):
        return {"runaways": self.runaways, "base_steps": 1}


def test_each_criterion_can_fail(taichi, monkeypatch):
    scene = rts.Scene(
        domain=rts.Box((0, 0), (1, 1)), fluids=[rts.Block((0, 0), (1, 0.3))], spacing=0.1, sound_speed=20.0
    )
    outcome = watch(scene, rts.Uniform(), end_time=0.02, samples=2)
    assert outcome.survived
    assert outcome.time == 0.02
    assert outcome.energy == pytest.approx(1.0, abs=0.01)
    assert outcome.courant == pytest.approx(0.4)
    assert outcome.runaways == 0

    x = np.array([[0.5, 0.5], [1.2, 0.5], [0.5, -0.1]])
    sim = SimpleNamespace(scene=scene, count=3, removed_count=0, time=0.0)
    assert survival.lost_particles(sim, x, 4) == "1 of 4 particles gone"
    assert survival.lost_particles(sim, x, 3) == "2 particles outside the walls"
    assert survival.lost_particles(sim, x[:1], 1) == ""
    monkeypatch.setattr(
        survival, "Simulation", lambda *args, **options: built
    )  # whose present state is looked at again
    short = {"end_time": 0.02, "samples": 1}
    built = FrozenRun(scene, outcome.time)
    outcome = watch(scene, rts.Uniform(), demanded_density=0.9, **short)
    assert outcome.reason == "density 1.000 of rest at t = 0 s, at most 1.05 x 0.900 allowed"
    built.runaways = 3
    assert watch(scene, rts.Uniform(), **short).reason == "3 speeds or accelerations limited at t = 0 s"
    built.runaways, built.gain = 0, 0.06
    assert watch(scene, rts.Uniform(), **short).reason == "energy +6.0% at t = 0.02 s, at most +5% of 10 J allowed"
    built.works = True
    assert watch(scene, rts.Uniform(), **short).survived


def test_samples_lie_at_ends_of_base_steps_and_at_the_end():
    times = survival.sample_times(SimpleNamespace(base_step=0.03), 0.2, 4)
    assert times == pytest.approx([0.0, 0.03, 0.09, 0.15, 0.18, 0.2])
    assert survival.sample_times(SimpleNamespace(base_step=0.01), 0.02, 40) == pytest.approx([0.0, 0.01, 0.02])


def test_a_particle_behind_a_moving_wall_is_lost():
    wall = rts.MovingWall("x-", times=(0.0, 1.0), displacements=(0.0, 0.3))
    block = rts.Block((0.4, 0), (1, 1))
    scene = rts.Scene(rts.Box((0, 0), (1, 1)), (block,), 0.1, moving_walls=(wall,), periodic=("y",), sound_speed=10.0)
    x = np.array([[0.1, 0.5], [0.2, 0.5], [0.5, 1.5]])
    sim = SimpleNamespace(scene=scene, count=3, removed_count=0, time=0.5)
    assert survival.lost_particles(sim, x, 3) == "1 particles outside the walls"
