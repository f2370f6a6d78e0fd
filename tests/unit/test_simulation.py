import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.solver.solver import REORDER_EVERY

FALLING = rts.Block((0.2, 0.2), (0.4, 0.6), velocity=(1, -2))
SMALL = rts.Scene(domain=rts.Box((0, 0), (1, 1)), fluids=[FALLING], spacing=0.04)
COLUMN = rts.Block((0, 0), (0.4, 0.8))
DAM = rts.Scene(domain=rts.Box((0, 0), (1, 1)), fluids=[COLUMN], spacing=0.05, sound_speed=40.0)


@pytest.fixture(scope="module")
def started(start_taichi, quick):
    """A simulation and its start, for the tests up to the first that starts Taichi anew."""
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(SMALL)
        yield sim, sim.snapshot()


@pytest.fixture
def sim(started):
    sim, start = started
    sim.continue_from(start)
    return sim


def test_readers_before_the_first_step(sim):
    assert (sim.time, sim.count) == (0.0, 50)
    assert sim.positions().shape == sim.velocities().shape == (50, 2)
    assert sim.densities().shape == sim.pressures().shape == sim.levels().shape == (50,)
    assert sim.momentum() == pytest.approx(sim.medium.mass * 50 * np.array([1, -2]))
    energy = sim.energy()
    assert energy.kinetic == pytest.approx(0.5 * sim.medium.mass * 50 * 5)
    assert energy.potential == pytest.approx(sim.medium.mass * 50 * 9.81 * 0.4)
    assert energy.internal == pytest.approx(0, abs=1e-9)
    assert energy.total == sum(energy)
    assert sim.statistics["base_steps"] == sim.statistics["particle_updates"] == 0
    assert (sim.pressures() == sim.medium.equation_of_state.pressure_numpy(sim.densities())).all()


def test_the_momentum_budget_needs_a_debug_run(sim):
    with pytest.raises(rts.Error, match="debug=True"):
        sim.momentum_drift()


def test_reordering_in_memory_keeps_the_state_and_its_ids(sim):
    sim.advance_to(20 * sim.base_step)
    before = sim.state()
    sim.particles.reorder(sim.grid.order)
    identity = sim.particles.identity.to_numpy()
    assert identity.tolist() != list(range(sim.count))
    assert sorted(identity) == list(range(sim.count))
    assert sim.grid.order.to_numpy().tolist() == list(range(sim.count))
    for one, two in zip(before, sim.state(), strict=True):
        assert one.tobytes() == two.tobytes()


@pytest.mark.parametrize("field", ["x", "v", "a"])
def test_what_is_not_a_number_ends_the_run(sim, field):
    values = getattr(sim.particles, field).to_numpy()
    values[7] = np.nan
    getattr(sim.particles, field).from_numpy(values)
    with pytest.raises(rts.SimulationDivergedError, match=r"no longer finite at t = 0\.02 s; use a smaller courant"):
        sim.advance_to(0.02)


def test_steps_and_leads_are_in_order_of_identity(taichi_cpu_f64, unstarted):
    sim = rts.Simulation(SMALL, rts.Asynchronous(levels=8))
    identity = np.arange(50)[::-1].astype(np.int32)
    sim.particles.identity.from_numpy(identity)
    sim.particles.updated.from_numpy(np.arange(50, dtype=np.int32))
    sim.particles.level.from_numpy((1 + np.arange(50) % 8).astype(np.int32))
    tick = sim.timeline.tick
    assert sim.steps()[identity] == pytest.approx((1 + np.arange(50) % 8) * tick)
    assert sim.leads()[identity] == pytest.approx((np.arange(50) + np.arange(50) % 8) * tick)


@pytest.mark.parametrize(
    "stepper",
    [
        pytest.param(rts.Uniform(), id="uniform", marks=pytest.mark.slow),
        pytest.param(rts.Uniform(adaptive=True), id="adaptive", marks=pytest.mark.slow),
        pytest.param(rts.Regional(levels=3), id="regional"),
        pytest.param(rts.Asynchronous(stagger=1, steps="integers"), id="asynchronous"),
    ],
)
def test_steps_are_levels_of_base_steps_and_leads_count_from_the_youngest(taichi_cpu_f64, stepper):
    sim = rts.Simulation(SMALL, stepper)
    sim.advance_to(5.5 * sim.base_step)
    assert sim.steps() == pytest.approx(sim.levels() * sim.base_step)
    assert sim.steps().max() <= sim.schedule.levels * sim.base_step * (1 + 1e-12)
    leads = sim.leads()
    assert leads.shape == (50,)
    assert leads.min() == 0.0
    if isinstance(stepper, rts.Uniform):
        assert leads.max() == 0.0
    if isinstance(stepper, rts.Asynchronous):
        assert leads.max() >= sim.timeline.tick
        assert leads / sim.timeline.tick == pytest.approx(np.rint(leads / sim.timeline.tick))


def test_reordering_does_not_depend_on_output_times(taichi_cpu_f64, monkeypatch):
    sim = rts.Simulation(SMALL, rts.Uniform())  # which sorts every step
    calls = []
    monkeypatch.setattr(sim.particles, "reorder", calls.append)
    for n in range(8):
        sim.advance_to((n + 1) * 0.25 * REORDER_EVERY * sim.base_step)  # the first sort was at tick 0
    assert len(calls) == 2


@pytest.mark.parametrize(
    ("stepper", "share"),
    [
        (rts.Uniform(), 1e-12),
        pytest.param(rts.Asynchronous(levels=1), 1e-12, marks=pytest.mark.slow),
        (rts.Asynchronous(steps="integers", stagger=1), 1e-3),
    ],
    ids=["uniform", "equal", "integers"],
)
def test_momentum_is_accounted_for_by_gravity_and_walls(taichi_cpu_f64, stepper, share):
    sim = rts.Simulation(DAM, stepper, debug=True)
    assert np.abs(sim.momentum_drift()).max() < 1e-12
    sim.advance_to(0.0503)
    assert np.linalg.norm(sim.momentum()) > 1.0
    weight_times_time = sim.medium.mass * sim.count * 9.81 * 0.0503
    assert np.abs(sim.momentum_drift()).max() < share * weight_times_time


def test_debug_runs_stop_at_what_must_not_happen(taichi_cpu_f64):
    sim = rts.Simulation(DAM, rts.Asynchronous(steps="integers", stagger=1), debug=True)
    while sim.schedule.begin(sim.timeline, 40):
        if not sim.schedule.needs_sorting:
            break
        sim.step()
    level = sim.particles.level.to_numpy()
    level[::2] -= 100
    sim.particles.level.from_numpy(level)  # as if half of the steps had ended long ago
    with pytest.raises(AssertionError, match="particles extrapolated near tick"):
        sim.step()
    sim.schedule.target = -1  # as if no particle were to step up to here
    with pytest.raises(AssertionError, match="no cell may step at tick"):
        sim.step()
