"""A grid that follows the particles: the bits of one that covers the domain, in memory that does not grow with the domain."""

import subprocess
import sys

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.assembly import following, memory, resources
from taichi_rts.assembly.rewind import Rewind
from taichi_rts.medium.medium import Medium
from taichi_rts.readings.measures import FaceForces
from taichi_rts.sampling.sampling import calibrate_mass
from taichi_rts.solver.grid import tiles

FLAT = {
    "domain": rts.Box((0.0, 0.0), (8.0, 3.0)),
    "fluids": (rts.Block((2.0, 0.5), (3.0, 1.1), velocity=(4.0, 1.0)), rts.Block((0.0, 0.0), (0.6, 0.8))),
    "spacing": 0.1,
}
DEEP = {
    "domain": rts.Box((0.0, 0.0, 0.0), (5.0, 2.0, 4.0)),
    "fluids": (
        rts.Block((1.0, 0.5, 1.0), (1.8, 1.1, 1.8), velocity=(3.0, 0.0, 2.0)),
        rts.Block((0.0, 0.0, 0.0), (0.4, 0.6, 0.6)),
    ),
    "spacing": 0.2,
}
FLOWING = FLAT | {
    "inflows": (rts.Inflow((8.0, 1.0), (8.0, 1.6), (-3.0, 0.0)),),
    "outlets": (rts.Outlet((0.0, 0.0), (0.3, 1.0)),),
    "sound_speed": "regional",
    "end_time": 0.5,
}
RUNS = {
    "uniform": (FLAT, rts.Uniform()),
    "regional": (DEEP, rts.Regional()),
    "wide": (FLAT | {"support_ratio": 3.0}, rts.Regional(preset="paper")),
    "regional sound, flowing": (FLOWING, rts.Regional()),
    "asynchronous, flowing": (FLOWING, rts.Asynchronous(stagger=3, steps="integers")),
}
QUICK = ("regional sound, flowing",)
every_run = pytest.mark.parametrize(
    "name", [each if each in QUICK else pytest.param(each, marks=pytest.mark.slow) for each in RUNS]
)
HALL = rts.Scene(
    domain=rts.Box((-50.0, 0.0, -50.0), (50.0, 100.0, 50.0)),
    fluids=(rts.Block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),),
    spacing=0.1,
    end_time=0.02,
)


@pytest.fixture
def everywhere(monkeypatch):
    """Have the grid follow the particles in small domains, too."""

    def follow():
        monkeypatch.setattr(following, "MANY", 0)
        monkeypatch.setattr(following, "GAIN", 0.0)

    return follow


@every_run
def test_bits_are_those_of_a_grid_of_the_whole_domain(name, everywhere, taichi_cpu):
    parameters, stepper = RUNS[name]
    scene, times, found = rts.Scene(**parameters), (0.05, 0.2, 0.45), []
    for follows in (False, True):
        if follows:
            everywhere()
        sim = rts.Simulation(scene, stepper)
        assert ("blocks_kept" in sim.statistics) == follows
        for time in times:
            sim.advance_to(time)
            found.append((*sim.state(), sim.ids(), sim.momentum()))
    for whole, some in zip(found[: len(times)], found[len(times) :], strict=True):
        for one, two in zip(whole, some, strict=True):
            np.testing.assert_array_equal(one, two)
    assert sim.statistics["grid_changes"] >= 2


def test_a_run_that_is_put_back_or_taken_up_again_goes_on_with_the_same_bits(everywhere, taichi_cpu, tmp_path):
    everywhere()
    sim = rts.Simulation(rts.Scene(**FLAT), rts.Uniform())
    rewind = Rewind(sim)
    sim.advance_to(0.3)
    rts.save_checkpoint(sim, tmp_path / "halfway.ckpt")
    sim.advance_to(0.5)
    wanted = sim.state()
    rewind.restore()
    sim.advance_to(0.5)
    again = rts.load_checkpoint(tmp_path / "halfway.ckpt")
    again.advance_to(0.5)
    for one, two, three in zip(wanted, sim.state(), again.state(), strict=True):
        np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(one, three)
    present = again.snapshot()
    sim.continue_from(present)
    sim.advance_to(present.time + 0.1)
    assert np.isfinite(sim.positions()).all()


def test_water_that_has_no_room_to_spread_is_said(everywhere, taichi_cpu, monkeypatch):
    everywhere()
    monkeypatch.setattr(tiles, "slots_for", lambda particles, shape: 30 + tiles.OUTSIDE)
    sim = rts.Simulation(rts.Scene(**FLAT), rts.Uniform())
    with pytest.raises(rts.ResourceError, match=r"spread over \d+ pieces of the grid, of which there is room for 30"):
        sim.advance_to(0.5)


@pytest.mark.parametrize(("spacing", "most"), [(0.1, 32), (0.05, 128)])
@pytest.mark.parametrize("stepper", [rts.Uniform(), rts.Regional(), rts.Asynchronous()], ids=lambda each: each.name)
def test_a_cubic_metre_in_a_hall(spacing, most, stepper):
    """All fields, and what sampling takes [MiB]; a grid of the whole hall takes 4.4 GiB, at half the spacing 34."""
    scene = HALL.replace(spacing=spacing)
    needed = memory.device_bytes(scene, stepper, "f32") + memory.host_bytes(scene)
    assert needed < most * 2**20
    assert following.follows(scene)


def test_memory_does_not_depend_on_the_height_of_the_hall():
    counts = [
        memory.count(HALL.replace(domain=rts.Box((-50.0, 0.0, -50.0), (50.0, top, 50.0))), rts.Uniform())
        for top in (50.0, 100.0)
    ]
    assert counts[0].blocks == counts[1].blocks


def test_what_moves_walls_or_repeats_has_the_whole_grid():
    for more in (
        {"periodic": ("x",)},
        {"moving_walls": (rts.MovingWall("x-", (0.0, 1.0), (0.0, 0.1)),)},
        {"obstacles": (rts.SphereObstacle((5.0, 5.0, 5.0), 1.0),)},
    ):
        assert not following.follows(HALL.replace(**more))
    assert not any(following.follows(rts.load_scene(name)) for name in rts.scene_names())


@pytest.mark.slow
@pytest.mark.parametrize("spacing", [0.1, 0.05])
def test_a_process_that_runs_the_hall(spacing, quick_environment):
    """Taichi's compiler takes some 70 MiB; a run in a domain of 4 m takes as much."""
    program = f"""
import taichi_rts as rts
from taichi_rts.trials.memory import peak_memory
rts.init("cpu")
before = peak_memory()
scene = rts.Scene(domain=rts.Box({HALL.domain.lower}, {HALL.domain.upper}), fluids=[rts.Block((0, 0, 0), (1, 1, 1))],
                  spacing={spacing}, end_time=0.02)
sim = rts.Simulation(scene).run(0.02)
print(sim.count, peak_memory() - before)
"""
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    count, taken = map(int, said.split()[-2:])
    assert count == round(1.0 / spacing**3)
    assert taken < 300 * 2**20


def test_the_hall_fits_into_little_memory(monkeypatch):
    monkeypatch.setattr(resources, "free_host_memory", lambda: float(resources.COMPILED + (64 << 20)))
    resources.require(HALL, [rts.Regional()], resources.Backend("cpu", "f32"))


def test_forces_on_faces_need_only_the_walls_near_the_water(everywhere):
    scene = rts.Scene(**DEEP)
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.uniform((0.0, 0.0, 0.0), (1.0, 1.0, 4.0), (400, 3)), [[5.0, 2.0, 4.0]]])
    medium = Medium.of(scene, calibrate_mass(scene))
    found = []
    for follows in (False, True):
        if follows:
            everywhere()
        forces = FaceForces(scene, medium)
        found.append((forces.faces, forces.at(0.0, x, np.full(401, 1000.0), np.linspace(1.0, 2e4, 401))))
    assert found[0][0] == found[1][0]
    assert len(forces.layer.positions) < 700
    np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-9)
    assert forces.at(0.0, np.array([[2.5, 1.0, 2.0]]), np.array([1000.0]), np.array([5.0])) == [0.0] * 6
