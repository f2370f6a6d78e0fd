"""Outlets: particles that come in are removed for good, and the others are as they were."""

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.files.archive import open_archive
from taichi_rts.output.checkpoint import Checkpoint
from taichi_rts.output.export import capture
from taichi_rts.output.series import Series

SPEED = 2.0
CHANNEL = rts.Scene(
    domain=rts.Box((0, 0), (1.2, 0.4)),
    fluids=[rts.Block((0, 0), (1, 0.4), velocity=(SPEED, 0))],
    spacing=0.05,
    gravity=(0, 0),
    sound_speed=20.0,
    artificial_viscosity=0.0,
    inflows=[rts.Inflow((0, 0), (0, 0.4), (SPEED, 0))],
    outlets=[rts.Outlet((1, 0), (1.2, 0.4))],
    end_time=2.0,
)
STEPPERS = {
    "uniform": rts.Uniform(),
    "regional": rts.Regional(levels=3),
    "aligned": rts.Regional(levels=4, steps="powers_of_two"),
    "asynchronous": rts.Asynchronous(stagger=1),
}


def drop(dim, **changes):
    """Two bodies in free flight, of which one meets the outlet."""
    far, near = (0.05, 0.3, 0.3)[:dim], (0.55, 0.3, 0.3)[:dim]
    blocks = [
        rts.Block(corner, tuple(c + 0.2 for c in corner), velocity=(v, 0, 0)[:dim])
        for corner, v in ((far, 0.0), (near, 1.0))
    ]
    outlet = rts.Outlet((0.8, 0.2, 0.2)[:dim], (1, 1, 1)[:dim])
    box = rts.Box((0,) * dim, (1,) * dim)
    common = {"spacing": 0.05, "sound_speed": 20.0, "gravity": (0,) * dim}
    return rts.Scene(**({"domain": box, "fluids": blocks, "outlets": [outlet]} | common | changes))


@pytest.mark.parametrize(
    ("outlet", "message"),
    [
        (rts.Outlet((1, 0, 0), (1.2, 0.4, 1)), "outlets.0: has 3 components; the domain has 2"),
        (rts.Outlet((1, 0), (1.3, 0.4)), "outlets.0: the box leaves the domain along 'x'; shrink it"),
        (rts.Outlet((1, 0), (1.05, 0.4)), "outlets.0: the box is 0.05 thick along 'x'.*at least a support radius, 0.1"),
        (rts.Outlet((0, 0), (0.2, 0.2)), "outlets.0: takes out what inflows.0 lets in; move one of them"),
    ],
)
def test_contradictions_name_value_limit_and_remedy(outlet, message):
    with pytest.raises(rts.SceneError, match=message):
        CHANNEL.replace(outlets=[outlet])


def test_a_box_without_extent_is_refused_and_a_file_may_hold_one(tmp_path):
    with pytest.raises(rts.SceneError, match="has no extent; let every component ascend"):
        rts.Outlet((0, 0), (0, 1))
    with pytest.raises(rts.SceneError, match="differ in dimension"):
        rts.Outlet((0, 0), (1, 1, 1))
    file = tmp_path / "sink.toml"
    file.write_text(
        "spacing = 0.1\ndomain = {lower = [0, 0], upper = [2, 1]}\n"
        "fluids = [{lower = [0, 0], upper = [1, 0.5]}]\n[[outlets]]\nlower = [1.5, 0]\nupper = [2, 0.5]\n"
    )
    assert rts.load_scene(file).outlets == (rts.Outlet((1.5, 0), (2, 0.5)),)
    file.write_text(file.read_text().replace("upper = [2, 0.5]", "uper = [2, 0.5]"))
    with pytest.raises(rts.SceneError, match=r"outlets.0.uper.*did you mean 'upper'"):
        rts.load_scene(file)


@pytest.mark.slow
@pytest.mark.parametrize("stepper", STEPPERS.values(), ids=STEPPERS)
def test_as_much_flows_out_as_in(simulate, stepper):
    sim = simulate(CHANNEL, stepper, debug=True)
    start, energy, mass = sim.count, sim.energy().total, sim.medium.mass
    sim.advance_to(0.5)  # one length of the channel
    early = (sim.inflows.entered, sim.removed_count)
    sim.advance_to(1.5)
    entered, removed = sim.inflows.entered, sim.removed_count
    assert entered == 8 * 60  # 1.5 s at 2 m/s are 60 layers of 8
    assert sim.count == start + entered - removed
    assert removed - early[1] == pytest.approx(entered - early[0], rel=0.03)
    assert sim.statistics["removed_by_outlets"] == [removed]
    x, v = sim.positions(), sim.velocities()
    assert x[:, 0].max() < 1.0 + 0.05  # no particle stays long in the outlet
    np.testing.assert_allclose(v.mean(axis=0), (SPEED, 0), atol=0.05)
    ids = sim.ids()
    assert len(ids) == len(x) == len(sim.steps()) == len(sim.levels()) == sim.count
    assert len(np.unique(ids)) == sim.count
    assert ids.max() < start + entered
    assert ids.min() > 0.9 * removed  # first in, first out
    np.testing.assert_array_equal(sim.fluids(), ids >= start)
    assert sim.energy().total - sim.work() == pytest.approx(energy, abs=0.01 * sim.outlets.energy)
    assert sim.outlets.energy == pytest.approx(0.5 * mass * SPEED**2 * removed, rel=0.05)


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_only_what_comes_in_is_taken_out(simulate, dim, tmp_path):
    sim = simulate(drop(dim), rts.Regional())
    half, energy = sim.count // 2, sim.energy().total
    before = sim.positions()[:half]
    series = Series(tmp_path / "series.csv", sim)
    series()
    sim.advance_to(0.15)
    series()
    assert sim.count == 2 * half - sim.removed_count
    assert 0 < sim.removed_count < half
    sim.advance_to(0.4)
    series()
    assert sim.removed_count == half
    np.testing.assert_array_equal(sim.ids(), np.arange(half))
    np.testing.assert_allclose(sim.positions(), before, atol=2e-3)
    assert sim.energy().total - sim.work() == pytest.approx(energy, rel=1e-3)
    frame = capture(sim, ("id", "velocity", "step", "cell_time"))
    assert {len(values) for values in frame.attributes.values()} == {half}
    rows = np.genfromtxt(tmp_path / "series.csv", delimiter=",", names=True)
    np.testing.assert_allclose(rows["outlet_0"][[0, -1]], (0.0, half * sim.medium.mass), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("stepper", [STEPPERS["uniform"], STEPPERS["asynchronous"]], ids=["uniform", "asynchronous"])
def test_an_emptied_domain_is_filled_again(simulate, stepper):
    rain = rts.Inflow((0.1, 1.0), (0.2, 1.0), (0, -2), start=0.5, stop=0.6)
    whole = rts.Outlet((0.4, 0.0), (1, 1))
    sim = simulate(drop(2, fluids=[rts.Block((0.6, 0.3), (0.8, 0.5))], outlets=[whole], inflows=[rain]), stepper)
    sim.advance_to(0.4)
    assert sim.count == len(sim.positions()) == len(sim.leads()) == 0
    assert sim.energy() == (0.0, 0.0, 0.0)
    sim.advance_to(0.7)
    assert sim.count == 2 * 4
    np.testing.assert_array_equal(sim.ids(), 16 + np.arange(8))


@pytest.mark.slow
def test_a_run_that_goes_on_has_the_same_bits(start_taichi, quick, tmp_path):
    path = tmp_path / "checkpoint.npz"
    with start_taichi("cpu", "f64", **quick):
        sim = rts.Simulation(CHANNEL, STEPPERS["asynchronous"])
        sim.advance_to(0.2)
        assert sim.removed_count > 0
        rts.save_checkpoint(sim, path)
        sim.advance_to(0.4)
        expected = [sim.ids(), *sim.state(), np.array(sim.outlets.removed)]
        with open_archive(path) as archive:
            Checkpoint(archive).restore(sim)
        sim.advance_to(0.4)
        for one, other in zip([sim.ids(), *sim.state(), np.array(sim.outlets.removed)], expected, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.slow
@pytest.mark.parametrize("sound", [20.0, "regional"])
def test_energy_taken_out_is_that_of_the_readers(simulate, sound):
    """Under gravity and pressure; readers sum it in NumPy."""
    dam = drop(2, fluids=[rts.Block((0, 0), (0.3, 0.9))], outlets=[rts.Outlet((0.3, 0), (1, 1))])
    sim = simulate(dam.replace(gravity=(0, -9.81), sound_speed=sound), rts.Uniform())
    find, sim.outlets.find = sim.outlets.find, lambda now, tick: 0
    sim.advance_to(round(0.25 / sim.timeline.tick) * sim.timeline.tick)
    sim.outlets.find, sim.outlets.looks = find, 0
    ids, x, before = sim.ids(), sim.positions(), sim.energy()
    gone = x[:, 0] >= 0.3
    assert before.internal > 0.0
    assert 20 < sim.outlets.find(sim.timeline.now, sim.timeline.tick) == gone.sum() < len(x)
    sim.outlets.take_out(int(gone.sum()), sim.timeline.now, sim.timeline.tick)
    np.testing.assert_array_equal(sim.ids(), ids[~gone])
    np.testing.assert_array_equal(sim.positions(), x[~gone])
    assert sim.outlets.energy == pytest.approx(before.total - sim.energy().total, rel=1e-9)
