from types import SimpleNamespace

import numpy as np
import pytest

import taichi_rts as rts
from taichi_rts.assembly import build
from taichi_rts.device.backend import ti
from taichi_rts.medium.energy import measure_energy
from taichi_rts.medium.equation_of_state import Tait
from taichi_rts.medium.medium import Medium
from taichi_rts.sampling.sampling import sample
from taichi_rts.solver.physics.momentum import MomentumEquation, Pressure
from taichi_rts.solver.physics.viscosity import ArtificialViscosity, LaminarViscosity, viscosity_terms

S = 0.1
STILL = {"gravity": (0, 0), "sound_speed": 20.0, "spacing": S, "artificial_viscosity": 0.0}


def make_scene(dim=2, **changes):
    fluids = [rts.Block((0,) * dim, (0.6,) * dim)]
    fields = STILL | {"domain": rts.Box((0,) * dim, (1,) * dim), "fluids": fluids, "gravity": (0.0,) * dim}
    return rts.Scene(**(fields | changes))


def evaluate(sim, x, v):
    """Accelerations and densities for a state put in by hand; the clock stands still, so nothing moves."""
    sim.particles.identity.from_numpy(np.arange(sim.count, dtype=np.int32))
    sim.particles.x.from_numpy(x)
    sim.particles.v.from_numpy(v)
    sim.step()
    return sim.particles.a.to_numpy(), sim.particles.rho.to_numpy()


def jittered(scene, scale, seed=0):
    rng = np.random.default_rng(seed)
    x = scale * sample(scene).positions
    x += rng.uniform(-0.15 * S, 0.15 * S, x.shape)
    return np.clip(x, 0, 1), rng.normal(size=x.shape)


def test_tait(taichi_cpu_f64):
    tait = Tait(1000.0, 20.0)
    rho = np.array([1e-3, 500.0, 999.9, 1000.0, 1000.1, 1010.0, 1500.0])
    p = np.empty_like(rho)

    @ti.kernel
    def run(rho: ti.types.ndarray(), p: ti.types.ndarray()):
        for k in range(rho.shape[0]):
            p[k] = tait.pressure(rho[k])

    run(rho, p)
    np.testing.assert_allclose(p, tait.pressure_numpy(rho), rtol=1e-11)
    assert p[:4].tolist() == [0, 0, 0, 0]
    assert (np.diff(p[3:]) > 0).all()
    slope = tait.pressure_numpy(1000.0 + 1e-4) / 1e-4
    assert slope == pytest.approx(20.0**2, rel=1e-5)


def test_specific_energy_is_the_integral_of_p_over_rho_squared():
    tait = Tait(1000.0, 20.0)
    rho = np.array([1005.0, 1050.0, 1200.0])
    slope = (tait.specific_energy(rho + 1e-3) - tait.specific_energy(rho - 1e-3)) / 2e-3
    np.testing.assert_allclose(slope, tait.pressure_numpy(rho) / rho**2, rtol=1e-6)
    assert tait.specific_energy(np.array([500.0, 1000.0])).tolist() == [0, 0]


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_pressure_force_is_the_slope_of_the_internal_energy_walls_included(taichi_cpu_f64, dim, monkeypatch):
    built = SimpleNamespace(terms=None)

    def watch(pressure, viscosities, *others, **options):
        built.terms = [pressure, *viscosities]
        return MomentumEquation(pressure, viscosities, *others, **options)

    monkeypatch.setattr(build, "MomentumEquation", watch)
    scene = make_scene(dim)
    sim = rts.Simulation(scene, rts.Uniform())
    assert [type(term) for term in built.terms] == [Pressure]  # without viscosity, no viscosity code

    x, v = jittered(scene, 0.95)
    a, _ = evaluate(sim, x, v)

    def energy(x):
        rho = evaluate(sim, x, v)[1]
        return sim.medium.mass * sim.medium.equation_of_state.specific_energy(rho).sum()

    step = 1e-6 * S
    corner, middle = np.argmin(x.sum(axis=1)), np.argmin(abs(x - 0.3).sum(axis=1))
    for i in (corner, middle):
        for d in range(dim):
            ahead, behind = x.copy(), x.copy()
            ahead[i, d] += step
            behind[i, d] -= step
            force = -(energy(ahead) - energy(behind)) / (2 * step)
            assert sim.medium.mass * a[i, d] == pytest.approx(force, rel=1e-5, abs=1e-6 * abs(a).max())


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_pair_forces_conserve_momentum_to_rounding(taichi_cpu_f64, dim):
    scene = make_scene(dim, walls=False, artificial_viscosity=0.1, kinematic_viscosity=0.01)
    sim = rts.Simulation(scene, rts.Uniform())
    x, v = jittered(scene, 0.95)
    a, rho = evaluate(sim, x + 0.1, v)
    assert (rho > 1000).any()
    assert np.abs(a.sum(axis=0)).max() < 1e-13 * np.abs(a).sum()
    if dim == 2:
        assert sim.walls == []
        assert len(sim.particles.reals) == 3 * dim + 1  # x, v, a, rho and nothing else
        assert {field.n for field in (sim.particles.x, sim.particles.v, sim.particles.a, sim.near.x)} == {2}


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_body_force_is_added_to_gravity_and_is_the_slope_of_the_potential_energy(taichi_cpu_f64, dim):
    gradient = ((-3, 0.5, 0), (0.5, 2, -1), (0, -1, 4))
    field = rts.LinearField([row[:dim] for row in gradient[:dim]], value=(1, -2, 3)[:dim], origin=(0.2, 0.1, 0.4)[:dim])
    gravity = (0.3, -9.81, 0.7)[:dim]
    scene = make_scene(dim, walls=False, gravity=gravity, body_force=field)
    sim = rts.Simulation(scene, rts.Uniform())
    x = 1.05 * sample(scene).positions  # too thin for any pressure
    a, rho = evaluate(sim, x, np.zeros_like(x))
    assert rho.max() < 1000
    y = x - np.array(field.origin)
    wanted = np.array(gravity) + np.array(field.value) + y @ np.array(field.gradient).T
    np.testing.assert_allclose(a, wanted, rtol=1e-12, atol=1e-12)

    step = 1e-4
    for d in range(dim):
        ahead, behind = (measure_energy(scene, sim.medium, x + e * np.eye(dim)[d], x, rho) for e in (step, -step))
        force = (behind.potential - ahead.potential) / (2 * step)
        assert force == pytest.approx(sim.medium.mass * wanted[:, d].sum(), rel=1e-7)


def test_without_a_body_force_there_is_no_code_for_it(taichi_cpu_f64, unstarted):
    assert not rts.Simulation(make_scene(), rts.Uniform()).motion.momentum.gravity.has_body_force


@pytest.fixture
def stretched(taichi_cpu_f64):
    """A lattice too thin for any pressure, in which only viscosity acts."""

    def build(**viscosity):
        scene = make_scene(walls=False, **viscosity)
        sim = rts.Simulation(scene, rts.Uniform())
        x = 1.05 * sample(scene).positions
        return sim, x

    return build


def test_artificial_viscosity_damps_approach_and_nothing_else(stretched):
    sim, x = stretched(artificial_viscosity=0.1)
    v = np.random.default_rng(3).normal(size=x.shape)
    a, rho = evaluate(sim, x, v)
    assert rho.max() < 1000
    assert (a * v).sum() < -1e-2 * np.abs(a * v).sum()
    offset = x - x.mean(axis=0)
    scale = np.abs(a).max()
    spinning = np.stack([-offset[:, 1], offset[:, 0]], axis=1)
    for harmless in (np.ones_like(x), offset, spinning):
        assert np.abs(evaluate(sim, x, harmless)[0]).max() < 1e-12 * scale
    squeezed = evaluate(sim, x, -offset)[0]
    assert (squeezed * -offset).sum() < 0
    assert np.abs(squeezed).max() > 1e-3 * scale
    a, _ = evaluate(sim, x, v)
    torque = (offset[:, 0] * a[:, 1] - offset[:, 1] * a[:, 0]).sum()
    assert abs(torque) < 1e-12 * np.abs(a).sum()


def test_laminar_viscosity_is_nu_times_the_laplacian(stretched):
    nu = 0.01
    sim, x = stretched(kinematic_viscosity=nu)
    v = np.random.default_rng(4).normal(size=x.shape)
    a, _ = evaluate(sim, x, v)
    assert (a * v).sum() < -1e-2 * np.abs(a * v).sum()
    scale = np.abs(a).max()
    middle = np.argmin(np.abs(x - x.mean(axis=0)).sum(axis=1))
    assert np.abs(evaluate(sim, x, np.ones_like(v))[0]).max() < 1e-12 * scale
    y = x[:, 1] - x[middle, 1]
    shear = np.stack([y, np.zeros_like(y)], axis=1)
    assert abs(evaluate(sim, x, shear)[0][middle, 0]) < 1e-12 * scale
    parabola = np.stack([y**2, np.zeros_like(y)], axis=1)
    assert evaluate(sim, x, parabola)[0][middle, 0] == pytest.approx(2 * nu, rel=0.15)


@pytest.mark.parametrize(
    ("alpha", "nu", "kinds"),
    [
        (0.0, 0.0, []),
        (0.1, 0.0, [ArtificialViscosity]),
        (0.0, 0.1, [LaminarViscosity]),
        (0.1, 0.1, [ArtificialViscosity, LaminarViscosity]),
    ],
)
def test_scene_builds_only_the_viscosity_it_asks_for(alpha, nu, kinds):
    scene = make_scene(artificial_viscosity=alpha, kinematic_viscosity=nu)
    terms = viscosity_terms(scene, Medium.of(scene, 1.0), SimpleNamespace())
    assert [type(term) for term in terms] == kinds
