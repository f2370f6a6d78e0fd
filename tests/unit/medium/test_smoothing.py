import numpy as np
import pytest

from taichi_rts.device.backend import ti
from taichi_rts.medium.smoothing import KERNELS, lattice_sum, make_kernel

SUPPORT = 0.3
every_kernel = pytest.mark.parametrize(("name", "dim"), [(name, dim) for name in KERNELS for dim in (2, 3)])


def evaluate(kernel, distances):
    value, factor = np.empty_like(distances), np.empty_like(distances)

    @ti.kernel
    def run(d: ti.types.ndarray(), w: ti.types.ndarray(), f: ti.types.ndarray()):
        for k in range(d.shape[0]):
            w[k] = kernel.value(d[k])
            f[k] = kernel.gradient_factor(d[k])

    run(distances, value, factor)
    return value, factor


@every_kernel
def test_integral_is_one(name, dim):
    kernel = make_kernel(name, dim, SUPPORT)
    d = (np.arange(20_000) + 0.5) * (SUPPORT / 20_000)
    shell = {2: 2 * np.pi * d, 3: 4 * np.pi * d**2}[dim]
    assert (kernel.sample(d) * shell).sum() * (SUPPORT / 20_000) == pytest.approx(1.0, abs=1e-7)


@every_kernel
def test_device_agrees_with_numpy_and_gradient_with_differences(taichi_cpu_f64, name, dim):
    kernel = make_kernel(name, dim, SUPPORT)
    d = np.linspace(0.02, 1.2, 60) * SUPPORT
    value, factor = evaluate(kernel, d)
    peak = kernel.sample(0.0)
    np.testing.assert_allclose(value, kernel.sample(d), rtol=1e-13, atol=1e-14 * peak)
    step = 1e-6 * SUPPORT
    slope = (kernel.sample(d + step) - kernel.sample(d - step)) / (2 * step)
    np.testing.assert_allclose(factor * d, slope, atol=1e-6 * peak / SUPPORT)
    outside = d >= SUPPORT
    assert outside.any()
    assert not value[outside].any()
    assert not factor[outside].any()
    assert (np.diff(value[~outside]) < 0).all()


@every_kernel
def test_both_vanish_smoothly_at_the_support(taichi_cpu_f64, name, dim):
    kernel = make_kernel(name, dim, SUPPORT)
    value, factor = evaluate(kernel, np.array([SUPPORT * (1 - 1e-5)]))
    assert 0 <= value[0] < 1e-9 * kernel.sample(0.0)
    assert abs(factor[0]) < 1e-3 * kernel.sample(0.0) / SUPPORT**2


def test_lattice_sum_counts_every_neighbour():
    kernel = make_kernel("cubic_spline", 2, 2.0)  # h = 1: of a unit lattice only 4 sides and 4 corners are inside
    expected = kernel.sample(0.0) + 4 * kernel.sample(1.0) + 4 * kernel.sample(np.sqrt(2.0))
    assert lattice_sum(kernel, (1.0, 1.0)) == pytest.approx(expected, rel=1e-14)
