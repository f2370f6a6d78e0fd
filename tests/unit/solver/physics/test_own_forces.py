"""Forces of a user's own: the same bits as the scene's where both can say it, momentum, checkpoints, and what is refused."""

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.device.backend import ti

SCENE = rts.Scene(
    domain=rts.Box((0, 0), (0.6, 0.6)), fluids=[rts.Block((0, 0), (0.3, 0.4))], spacing=0.04, sound_speed=20.0
)
STEPPERS = {"uniform": rts.Uniform(), "regional": rts.Regional(), "asynchronous": rts.Asynchronous()}
UNTIL = 0.05
PULL, STRAIN = (1.5, -0.75), ((0.5, 3.0), (3.0, -2.0))


@ti.func
def pull(x, t):
    return ti.Vector([1.5, -0.75])


@ti.func
def strain(x, t):
    """As `rts.LinearField` adds it up."""
    return ti.Vector([1.5 + 0.5 * x[0] + 3.0 * x[1], -0.75 + 3.0 * x[0] - 2.0 * x[1]])


@ti.func
def gravity(x, t):
    return ti.Vector([0.0, -9.81])


@ti.func
def flip(x, t):
    return ti.Vector([0.0, -9.81 if t < 0.02 else 4.0])


@ti.func
def one_sided(x, t):
    return ti.Vector([5.0 if x[0] > 1000.12 else 0.0, 0.0])


@ti.data_oriented
class Spring:
    """Pulls pairs together that are further apart than `rest` [m], and pushes those apart that are nearer."""

    def __init__(self, stiffness, rest=0.04):
        self.stiffness, self.rest = stiffness, rest  # [1/s^2], [m]

    @ti.func
    def fluid_pair(self, near, i, j, x_ij, v_ij, d2):
        return self.stiffness * (self.rest / ti.sqrt(d2) - 1.0) * x_ij

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall):
        return ti.zero(x_ib)


@ti.data_oriented
class Sticky:
    """Holds fluid back at walls."""

    def __init__(self, rate):
        self.rate = np.float64(rate)  # [1/s]
        self.counts = ti.field(ti.i32, ())

    @ti.func
    def fluid_pair(self, near, i, j, x_ij, v_ij, d2):
        return ti.zero(x_ij)

    @ti.func
    def wall_pair(self, i, b, x_ib, v_ib, d2, wall):
        return -self.rate * wall.volume[b] / self.area() * v_ib

    @ti.func
    def area(self):
        return 0.0016


def states(sim, until=UNTIL):
    sim.advance_to(until)
    return [array.tobytes() for array in sim.state()]


@pytest.mark.parametrize(
    "stepper", ["uniform", *(pytest.param(name, marks=pytest.mark.slow) for name in ("regional", "asynchronous"))]
)
def test_a_constant_body_force_has_the_bits_of_the_scenes(simulate, stepper):
    field = rts.LinearField(((0.0, 0.0), (0.0, 0.0)), value=PULL)
    there = states(simulate(SCENE.replace(body_force=field), STEPPERS[stepper]))
    here = simulate(SCENE, STEPPERS[stepper], forces=[pull])
    assert states(here) == there
    assert not here.keeps_momentum_budget


@pytest.mark.slow
def test_gravity_by_itself_and_with_another(simulate):
    calm = SCENE.replace(gravity=(0.0, 0.0), fluids=[rts.Block((0.1, 0.1), (0.4, 0.5))])
    there = states(simulate(calm.replace(gravity=(0.0, -9.81)), rts.Uniform()))
    assert states(simulate(calm, rts.Uniform(), forces=[gravity])) == there
    sim = simulate(calm, rts.Uniform(), forces=[pull, gravity])
    sim.advance_to(UNTIL)
    fall = np.array(PULL) + np.array([0.0, -9.81])
    assert np.allclose(sim.velocities().mean(axis=0), UNTIL * fall, rtol=1e-12)


@pytest.mark.slow
def test_a_body_force_sees_place_and_time(simulate):
    field = rts.LinearField(STRAIN, value=PULL)
    found = []
    for scene, forces in ((SCENE.replace(body_force=field), []), (SCENE, [strain])):
        sim = simulate(scene, rts.Uniform(), forces=forces)
        sim.advance_to(UNTIL)
        found.append(sim.positions())
    assert np.allclose(*found, atol=1e-12)
    blob = SCENE.replace(fluids=[rts.Block((0.1, 0.1), (0.4, 0.5))])
    changes = (rts.GravityChange(time=0.02, gravity=(0.0, 4.0)),)
    there = states(simulate(blob.replace(gravity_changes=changes), rts.Uniform()))
    assert states(simulate(blob.replace(gravity=(0.0, 0.0)), rts.Uniform(), forces=[flip])) == there


def test_places_are_the_scenes_however_far_from_0(simulate):
    scene = SCENE.replace(
        domain=rts.Box((1000, 0), (1000.6, 0.6)), fluids=[rts.Block((1000.04, 0.2), (1000.24, 0.3))], gravity=(0.0, 0.0)
    )
    sim = simulate(scene, rts.Uniform(), forces=[one_sided])
    assert sim.origin[0] == 1000.0
    x = sim.positions()[:, 0]
    right = x > 1000.12
    assert 0 < right.sum() < len(x)
    a = sim.particles.to_numpy(sim.particles.a)[:, 0]
    assert (a[right] > 4.0).all()
    assert (a[~right] < 1.0).all()


def test_a_pair_force_keeps_momentum_and_does_something(simulate):
    blob = SCENE.replace(fluids=[rts.Block((0.1, 0.1), (0.42, 0.42), velocity=(0.4, -0.2))], gravity=(0.0, 0.0))
    sim = simulate(blob, rts.Uniform(), forces=[Spring(-400.0)])
    before, size = sim.momentum(), np.ptp(sim.positions(), axis=0)
    sim.advance_to(UNTIL)
    scale = sim.medium.mass * np.abs(sim.velocities()).sum()
    assert np.abs(sim.momentum() - before).max() < 1e-13 * scale
    assert np.ptp(sim.positions(), axis=0).max() > 1.05 * size.max()  # a negative stiffness drives it apart
    assert sim.keeps_momentum_budget is False  # not a debug run


@pytest.mark.slow
@pytest.mark.parametrize("forces", [[Spring], [Spring, Sticky]])
def test_windows_and_plain_loops_agree(taichi_cpu_f64, forces):
    """On a CPU the fluid's share comes through windows; here it is worked out again, of all pairs, in NumPy."""
    without = rts.Simulation(SCENE, rts.Uniform())
    expected = np.zeros((without.count, 2))
    x, support = without.positions(), SCENE.support
    a = without.particles.to_numpy(without.particles.a)
    with_forces = rts.Simulation(SCENE, rts.Uniform(), forces=[kind(50.0) for kind in forces])
    found = with_forces.particles.to_numpy(with_forces.particles.a) - a
    for i in range(len(x)):
        x_ij = x[i] - np.delete(x, i, axis=0)
        d = np.linalg.norm(x_ij, axis=1)
        x_ij, d = x_ij[d < support], d[d < support]
        expected[i] = (50.0 * (0.04 / d - 1.0)[:, None] * x_ij).sum(axis=0)
    assert np.abs(expected).max() > 1.0
    assert np.allclose(found, expected, atol=1e-9 * np.abs(a).max())  # at rest nothing sticks


@pytest.mark.slow
def test_walls_hold_back_what_slides(taichi_cpu_f64):
    slide = SCENE.replace(fluids=[rts.Block((0.1, 0), (0.4, 0.2), velocity=(1.0, 0.0))])
    speeds = []
    for forces in ([], [Sticky(20.0)]):
        sim = rts.Simulation(slide, rts.Uniform(), forces=forces, debug=True)
        sim.advance_to(0.02)
        low = sim.positions()[:, 1] < 0.05
        speeds.append(sim.velocities()[low, 0].mean())
        scale = sim.medium.mass * np.abs(sim.velocities()).sum()
        assert np.abs(sim.momentum_drift()).max() < 1e-11 * scale  # the walls' share is known
    assert speeds[1] < 0.8 * speeds[0]


def test_a_checkpoint_goes_on_with_the_same_bits(taichi_cpu_f64, tmp_path):
    path, forces = tmp_path / "own.npz", lambda: [flip, Spring(30.0), Sticky(4.0)]
    sim = rts.Simulation(SCENE, rts.Uniform(), forces=forces())
    sim.advance_to(0.5 * UNTIL)
    sim.forces[2].counts[None] = 7  # fields of a force are kept too
    rts.save_checkpoint(sim, path)
    there = states(sim)
    rts.init("cpu", "f64", restart=True, advanced_optimization=False)
    again = rts.load_checkpoint(path, forces=forces())
    assert int(again.forces[2].counts[None]) == 7
    assert states(again) == there
    with pytest.raises(
        rts.CheckpointError, match=r"own.npz has forces of its user's own: flip, Spring, Sticky; given are none"
    ):
        rts.load_checkpoint(path)
    with pytest.raises(rts.CheckpointError, match=r"Spring: stiffness 30.0 there and 31.0 here; give the same values"):
        rts.load_checkpoint(path, forces=[flip, Spring(31.0), Sticky(4.0)])


@pytest.mark.slow
def test_another_stepper_goes_on_with_them(simulate):
    sim = simulate(SCENE, rts.Uniform(), forces=[pull])
    assert rts.change_stepper(sim, rts.Uniform(courant=0.2)).forces == (pull,)


class Undecorated:
    fluid_pair, wall_pair = Spring.fluid_pair, Spring.wall_pair


@ti.data_oriented
class OfFluidOnly:
    @ti.func
    def fluid_pair(self, near, i, j, x_ij, v_ij, d2):
        return ti.zero(x_ij)


@ti.func
def of_place(x):
    return x


@pytest.mark.parametrize(
    ("forces", "message"),
    [
        ([3], r"forces\[0\] is int, which is neither a ti.func .* no ti.func fluid_pair and no wall_pair"),
        ([pull, lambda x, t: x], r"forces\[1\] is <lambda>, which is no ti.func; write @ti.func above it"),
        ([Spring], r"forces\[0\] is the class Spring; give an object of it, Spring\(...\)"),
        ([Undecorated()], r"class Undecorated, which Taichi cannot compile; write @ti.data_oriented above the class"),
        ([OfFluidOnly()], r"forces\[0\] is OfFluidOnly, .* it has no ti.func wall_pair"),
        ([of_place], r"forces\[0\], of_place takes 1 arguments \(x\); it is to take \(x, t\)"),
        (pull, r"forces is .*give a list of forces"),
        ("pull", r"forces is 'pull'; give a list of forces"),
    ],
)
def test_what_is_no_force_is_refused(simulate, forces, message):
    with pytest.raises(rts.Error, match=message):
        simulate(SCENE, rts.Uniform(), forces=forces)
