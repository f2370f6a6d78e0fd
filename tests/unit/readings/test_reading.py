"""One reading per frame: what it holds, that it stays what it is, and that all that read a frame share it."""

import gc

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.output.panels import Panel
from taichi_rts.output.recorder import Recorder, Recording
from taichi_rts.readings.extremes import Extremes
from taichi_rts.rendering.painter import PictureOptions

SCENE = rts.Scene(
    domain=rts.Box((0, 0), (1, 1)),
    fluids=[rts.Block((0.2, 0.0), (0.4, 0.4))],
    spacing=0.05,
    end_time=0.15,
    inflows=[rts.Inflow((0.8, 1), (0.9, 1), (0, -3))],
    outlets=[rts.Outlet((0.4, 0), (0.6, 0.2))],
)
ARRAYS = ("ids", "positions", "velocities", "densities", "pressures", "levels", "steps", "cell_times", "leads")
READERS = (*ARRAYS, "sound_speeds", "fluids", "momentum")


def exports(sim, monkeypatch):
    """A list that grows by one each time the state is read from the device."""
    seen, export = [], sim.motion.export
    monkeypatch.setattr(sim.motion, "export", lambda *args: (seen.append(sim.time), export(*args)))
    return seen


def check_that_callbacks_read_each_frame_once(sim, monkeypatch, tmp_path):
    series, exporter = rts.Series(tmp_path / "series.csv", sim), rts.Exporter(tmp_path, ["ply"])
    seen = exports(sim, monkeypatch)
    sim.run(0.04, [series, exporter, lambda sim: sim.positions()], fps=50)
    assert seen == [0.0, 0.02, 0.04]
    assert series.times == exporter.times == seen


def test_it_holds_the_state_in_order_of_id_and_stays_when_the_run_goes_on(taichi_cpu_f64):
    sim = rts.Simulation(SCENE, rts.Asynchronous())
    sim.advance_to(0.1)
    assert sim.removed_count > 0
    now, p = sim.read(), sim.particles
    assert now.ids.tolist() == np.sort(p.identity.to_numpy()[: p.count]).tolist()
    assert now.ids.dtype == np.int32
    assert (now.count, now.time, now.base_step) == (sim.count, 0.1, sim.base_step)
    for name, field in (("accelerations", p.a), ("base_steps", p.level), ("evaluated", p.updated)):
        np.testing.assert_array_equal(getattr(now, name), p.to_numpy(field))
    assert now.levels.max() > 1
    np.testing.assert_array_equal(now.steps, now.levels * sim.base_step)
    np.testing.assert_array_equal(now.cell_times, p.to_numpy(p.updated) * sim.timeline.tick)
    assert set(now.fluids.tolist()) == {0, 1}  # the block, and what has flowed in
    assert now.particle_updates == sim.statistics["particle_updates"]
    assert now.inflow == sim.medium.mass * sim.inflows.entered > 0.0
    assert now.outflows == (sim.medium.mass * sim.removed_count,)
    assert now.max_speed == pytest.approx(now.max_mach * sim.medium.sound_speed)
    kept = {name: getattr(sim, name)() for name in READERS}
    energy = sim.energy()
    for name, values in kept.items():
        np.testing.assert_array_equal(getattr(now, name), values)
        values[...] = 0  # the caller's own, as ever
        assert getattr(now, name).any() or name == "leads"
        with pytest.raises(ValueError, match="read-only"):
            getattr(now, name)[...] = 0
    assert now.momentum.any()
    held = now.velocities.copy()
    sim.advance_to(0.15)
    assert sim.read() is not now
    np.testing.assert_array_equal(now.velocities, held)
    assert now.energy == energy != sim.energy()
    assert now.read() is now


def test_with_a_regional_sound_speed_pressures_are_those_of_the_moment(taichi_cpu_f64):
    sim = rts.Simulation(SCENE.replace(inflows=(), outlets=(), sound_speed="regional"), rts.Regional())
    sim.advance_to(0.02)
    pressures, energy, sounds = sim.pressures(), sim.energy(), sim.sound_speeds()  # each of a reading of its own
    now = sim.read()
    assert not {"pressures", "energy"} & set(vars(now))
    sim.advance_to(0.1)  # before anything lazy is asked of the reading
    assert (sim.sound_speeds() != sounds).any()
    np.testing.assert_array_equal(now.sound_speeds, sounds)
    np.testing.assert_array_equal(now.pressures, pressures)
    assert now.pressures.max() > 0.0
    assert now.energy == energy


def test_all_who_look_at_a_frame_share_one_reading_while_it_is_held(taichi_cpu_f64, monkeypatch, tmp_path):
    sim = rts.Simulation(SCENE, rts.Regional())
    start = sim.snapshot()
    check_that_callbacks_read_each_frame_once(sim, monkeypatch, tmp_path)
    sim.continue_from(start)
    seen = exports(sim, monkeypatch)
    now = sim.read()
    assert sim.read() is now
    for name in READERS:
        getattr(sim, name)()
    sim.energy(), sim.state(), sim.local_state(), sim.check()
    assert len(seen) == 1
    sim.advance_to(0.02)
    later = sim.read()
    assert later is not now
    assert sim.read() is later
    sim.restored()
    assert sim.read() is not later  # what was put back may be anything
    later = sim.read()
    sim.continue_from(sim.snapshot())
    assert sim.read() is not later
    del now, later
    gc.collect()
    before = len(seen)
    sim.particles.rho.fill(1500.0)  # from outside: nothing is held that would hide it
    assert sim.densities().tolist() == [1500.0] * sim.count
    assert len(seen) == before + 1


def test_a_recording_reads_each_frame_once(taichi_cpu_f64, monkeypatch, tmp_path):
    stepper = rts.Regional()
    options = PictureOptions(width=160, height=120, colour_by="lead")
    recording = Recording(tmp_path / "out", fps=50, export=("npz",), attributes=("id", "step", "pressure", "fluid"))
    with Recorder(SCENE, [Panel("", stepper)], options, recording) as recorder:
        extremes = Extremes(recorder.runs)
        seen = exports(recorder.runs[stepper], monkeypatch)
        recorder.record(0.1, lambda time: extremes.look())
    assert seen == [*recorder.times, 0.1]  # the last for run.json
    assert len(recorder.times) == 6
    assert extremes.mach[stepper] > 0.0
