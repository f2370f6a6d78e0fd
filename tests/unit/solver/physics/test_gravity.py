"""Gravity that follows a table: constant or linear in between, its work, tables with many rows and tables in files."""

from types import SimpleNamespace

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.readings.gravity_work import next_look, work_between
from taichi_rts.readings.reading import Reading
from taichi_rts.scene.loading import scene_schema
from taichi_rts.scene.parts.gravity import GravityTable

ROWS = ((0.15, (4.0, 2.0)), (0.3, (-4.0, -9.0)))
TOML = """
spacing = 0.1
domain = { lower = [0.0, 0.0], upper = [1.0, 1.0] }
gravity_changes = { file = "shaken.csv" }
gravity_interpolation = "linear"
[[fluids]]
lower = [0.0, 0.0]
upper = [0.5, 0.4]
"""


def falling(rows, interpolation="linear"):
    changes = [rts.GravityChange(time, gravity) for time, gravity in rows]
    return rts.Scene(
        domain=rts.Box((0, 0), (1, 1)),
        fluids=[rts.Block((0.4, 0.4), (0.6, 0.6))],
        spacing=0.05,
        sound_speed=40.0,
        walls=False,
        gravity_changes=changes,
        gravity_interpolation=interpolation,
    )


def many(rows, count):
    """The same function of time with `count` rows, all but the last of them evenly spaced."""
    table = falling(rows).gravity_table
    times = np.linspace(0.0, rows[-1][0], count + 1)[1:]
    return list(zip(times.tolist(), map(tuple, table.at(times).tolist()), strict=True))


@pytest.mark.parametrize(
    "stepper",
    [
        rts.Regional(levels=3),
        pytest.param(rts.Uniform(), marks=pytest.mark.slow),
        pytest.param(rts.Asynchronous(), marks=pytest.mark.slow),
    ],
    ids=["regional", "uniform", "asynchronous"],
)
def test_free_fall_under_linear_gravity_is_exact(simulate, stepper, monkeypatch):
    looks, read = [], Reading.of
    monkeypatch.setattr(Reading, "of", lambda run, *rest: (looks.append(run.time), read(run, *rest))[1])
    scene = falling(many(ROWS, 3000))
    sim = simulate(scene, stepper)
    start, energy = sim.positions().mean(axis=0), sim.energy().total
    looks.clear()
    sim.advance_to(0.35)
    assert len(looks) < 100  # not 3000
    fine = np.linspace(0.0, 0.35, 35001)
    pull = falling(ROWS).gravity_table.at(fine)
    middles, step = 0.5 * (pull[1:] + pull[:-1]), fine[1]
    speed = np.cumsum(middles, axis=0) * step
    fallen = (speed.sum(axis=0) - 0.5 * speed[-1]) * step
    longest = sim.steps().max()
    np.testing.assert_allclose(sim.velocities().mean(axis=0), speed[-1], atol=100 * longest**2)
    np.testing.assert_allclose(sim.positions().mean(axis=0) - start, fallen, atol=100 * longest**2)
    assert abs(sim.work()) > 0.15 * energy
    assert sim.energy().total - sim.work() == pytest.approx(energy, abs=2e-3 * abs(sim.work()))


@pytest.mark.slow
def test_a_pool_settles_under_a_step_of_gravity(simulate):
    scene = rts.Scene(
        domain=rts.Box((0, 0), (0.6, 1)),
        fluids=[rts.Block((0, 0), (0.6, 0.5))],
        spacing=0.05,
        gravity=(0, -5),
        gravity_changes=[rts.GravityChange(0.2, (0, -10))],
        density="continuity",
        hydrostatic=True,
        sound_speed=40.0,
        artificial_viscosity=0.3,
    )
    sim = simulate(scene, rts.Regional())
    for until, pull in ((0.19, 5.0), (3.0, 10.0)):
        sim.advance_to(until)
        slope = -np.polyfit(sim.positions()[:, 1], sim.pressures(), 1)[0]
        assert slope == pytest.approx(1000.0 * pull, rel=0.06)


def reading(time, moment, momentum):
    return SimpleNamespace(time=time, first_moment=np.array(moment), momentum=np.array(momentum))


def test_work_is_exact_for_a_moment_that_is_cubic_in_time():
    def moment(t):
        return np.stack([1 + t - 2 * t**2 + 3 * t**3, 2 - t**3], axis=-1)

    def slope(t):
        return np.stack([1 - 4 * t + 9 * t**2, -3 * t**2], axis=-1)

    times = np.array([0.0, 0.3, 0.5, 0.9, 2.0])
    values = np.array([[0.0, -9.0], [1.0, -8.0], [-3.0, -8.0], [2.0, 5.0], [0.0, 0.0]])
    before, after = (reading(t, moment(t), slope(t)) for t in (0.4, 1.0))
    jumps = sum(-(values[k] - values[k - 1]) @ moment(times[k]) for k in (2, 3))
    assert work_between(GravityTable(times, values, False), before, after) == pytest.approx(jumps, rel=1e-12)
    fine = np.linspace(0.4, 1.0, 600_001)
    linear = GravityTable(times, values, True)
    middles = 0.5 * (fine[1:] + fine[:-1])
    ramps = -(moment(middles) * np.diff(linear.at(fine), axis=0)).sum()
    assert work_between(linear, before, after) == pytest.approx(ramps, rel=1e-9)
    assert work_between(GravityTable(times, values, False), after, reading(1.5, [5, 5], [1, 1])) == 0.0
    at = reading(0.9, [2.0, 3.0], [9.0, 9.0])
    assert work_between(GravityTable(times, values, False), at, at) == pytest.approx(-(5 * 2 + 13 * 3))


def test_rows_that_lie_close_share_their_readings():
    times = np.concatenate([[0.0, 1.0], 2.0 + np.arange(1000) * 1e-3, [5.0]])
    table = GravityTable(times, np.zeros((len(times), 2)), False)
    present, look, found = 0.0, None, []
    while (at := next_look(table, present, 10.0, look, 0.4)) is not None:
        present, look = at, at
        found.append(at)
    np.testing.assert_allclose(found, [1.0, 2.0, 2.4, 2.8, 2.999, 5.0])


def test_a_table_in_a_file(tmp_path):
    (tmp_path / "tank.toml").write_text(TOML)
    (tmp_path / "shaken.csv").write_text("# measured\ntime,gx,gy\n0.0, 0.5, -9.5\n0.1, 1.0, -9.0\n0.2, 0.0, -9.81\n")
    scene = rts.load_scene(tmp_path / "tank.toml")
    assert scene.gravity == (0.5, -9.5)
    assert scene.gravity_changes == (rts.GravityChange(0.1, (1.0, -9.0)), rts.GravityChange(0.2, (0.0, -9.81)))
    assert scene.acceleration_at(0.05) == pytest.approx((0.75, -9.25))
    assert scene.replace(gravity_interpolation="step").acceleration_at(0.05) == (0.5, -9.5)
    assert {"type", "properties", "required", "additionalProperties"} <= set(
        scene_schema()["properties"]["gravity_changes"]["anyOf"][1]
    )


@pytest.mark.parametrize(
    ("table", "toml", "message"),
    [
        ("0.1, 1.0\n", TOML, "has 2 columns; write time"),
        ("", TOML, "has 0 columns"),
        ("0.1, one, 2\n", TOML, "could not convert string ' one'.*write rows such as"),
        ("0.2, 1, 2\n0.1, 1, 2\n", TOML, "must ascend"),
        ("0, 1, 2\n", TOML.replace("spacing", "gravity = [0.0, -1.0]\nspacing"), "leave gravity out"),
        ("0.1, 1, 2\n", TOML.replace("shaken", "../shaken"), "gravity_changes.file: '../shaken.csv' leaves"),
        ("0.1, 1, 2\n", TOML.replace("shaken", "gone"), "gone.csv' cannot be read: No such file"),
    ],
)
def test_what_is_no_table(tmp_path, table, toml, message):
    (tmp_path / "tank.toml").write_text(toml)
    (tmp_path / "shaken.csv").write_text(table)
    with pytest.raises(rts.SceneError, match=message):
        rts.load_scene(tmp_path / "tank.toml")
