"""Smoothing kernels W and their gradients, without branches so that loops over neighbours vectorise.

Both kernels are written over q = d/h with h = r/2, r being the support radius, so both vanish at q = 2. They return the
gradient as a factor: grad W = factor * (x_i - x_j), factor = (dW/dq) / (h d).
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from taichi_rts.device.backend import ti


@ti.func
def positive(value):
    """The larger of `value` and 0; one instruction less than max, which also handles NaN."""
    return ti.select(value > 0.0, value, 0.0)


@ti.data_oriented
class CubicSpline:
    """Cubic spline (Monaghan & Lattanzio 1985; Monaghan 1992): W = s (1/4 (2-q)^3+ - (1-q)^3+)."""

    name = "cubic_spline"

    def __init__(self, dim: int, support: float) -> None:
        self.h = 0.5 * support
        self.sigma = {2: 10.0 / (7.0 * math.pi), 3: 1.0 / math.pi}[dim] / self.h**dim

    @ti.func
    def value(self, d):
        """W [1/m^dim] at distance `d` [m]."""
        q = d * (1.0 / self.h)
        outer, inner = positive(2.0 - q), positive(1.0 - q)
        return self.sigma * (0.25 * outer * outer * outer - inner * inner * inner)

    @ti.func
    def derivative(self, d):
        """dW/dd [1/m^(dim+1)] at distance `d` [m]."""
        q = d * (1.0 / self.h)
        outer, inner = positive(2.0 - q), positive(1.0 - q)
        return (3.0 * self.sigma / self.h) * (inner * inner - 0.25 * outer * outer)

    @ti.func
    def gradient_factor(self, d):
        """The factor (dW/dd)/d [1/m^(dim+2)] at distance `d` [m] > 0."""
        return self.derivative(d) / d

    def sample(self, d: Any) -> Any:
        """W [1/m^dim] for a NumPy array of distances [m]."""
        q = np.asarray(d) / self.h
        return self.sigma * (0.25 * np.maximum(2 - q, 0) ** 3 - np.maximum(1 - q, 0) ** 3)


@ti.data_oriented
class WendlandC2:
    """Wendland C2 (Wendland 1995; Dehnen & Aly 2012): W = s (1 - q/2)^4+ (2q + 1)."""

    name = "wendland_c2"

    def __init__(self, dim: int, support: float) -> None:
        self.h = 0.5 * support
        self.sigma = {2: 7.0 / (4.0 * math.pi), 3: 21.0 / (16.0 * math.pi)}[dim] / self.h**dim

    @ti.func
    def value(self, d):
        """W [1/m^dim] at distance `d` [m]."""
        q = d * (1.0 / self.h)
        rest = positive(1.0 - 0.5 * q)
        square = rest * rest
        return self.sigma * square * square * (2.0 * q + 1.0)

    @ti.func
    def derivative(self, d):
        """dW/dd [1/m^(dim+1)] at distance `d` [m]."""
        return d * self.gradient_factor(d)

    @ti.func
    def gradient_factor(self, d):
        """The factor (dW/dd)/d [1/m^(dim+2)] at distance `d` [m]; here it is finite at d = 0."""
        rest = positive(1.0 - d * (0.5 / self.h))
        return (-5.0 * self.sigma / (self.h * self.h)) * rest * rest * rest

    def sample(self, d: Any) -> Any:
        """W [1/m^dim] for a NumPy array of distances [m]."""
        q = np.asarray(d) / self.h
        return self.sigma * np.maximum(1 - q / 2, 0) ** 4 * (2 * q + 1)


KERNELS = {kernel.name: kernel for kernel in (CubicSpline, WendlandC2)}


def make_kernel(name: str, dim: int, support: float) -> Any:
    """Return the kernel `name` for `dim` dimensions and support radius `support` [m]."""
    return KERNELS[name](dim, support)


def lattice_sum(kernel: Any, steps: Sequence[float]) -> float:
    """Sum of W [1/m^dim] over an infinite lattice, seen from one of its points; `steps` [m], (dim,), are its rows' distances."""
    reaches = [math.ceil(2.0 * kernel.h / step) for step in steps]
    axes = [step * np.arange(-reach, reach + 1) for step, reach in zip(steps, reaches, strict=True)]
    distance2 = sum(grid**2 for grid in np.meshgrid(*axes))
    return float(kernel.sample(np.sqrt(distance2)).sum())
