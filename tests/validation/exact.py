"""Exact solutions to compare runs with; NumPy only, nothing of the package."""

import numpy as np

STEPS = 2000  # RK4 steps between 0 and the last time: the error is below 1e-9


def drop_axes(times, rate, frequency=0.0):
    """Semi-axes a along x and b along y [m], (T,) each, at ascending `times` [s], (T,), of a disc of radius 1 m.

    An incompressible ellipse with a free surface keeps a velocity (sigma x, -sigma y); sigma(0) is `rate` [1/s]. In a force of
    -Omega^2 x per mass, Omega being `frequency` [1/s]:
    sigma' = (sigma^2 + Omega^2) (b^2 - a^2)/(b^2 + a^2), a' = sigma a, b' = -sigma b.
    Without force these are Monaghan's (1994) for the elliptical drop, with A = -sigma.
    """
    step = times[-1] / STEPS
    states = [np.array([1.0, 1.0, rate])]
    for _ in range(STEPS):
        states.append(_runge_kutta(states[-1], step, frequency))
    grid = step * np.arange(STEPS + 1)
    here = np.minimum((np.asarray(times) / step).astype(int), STEPS)
    ends = [_runge_kutta(states[k], t - grid[k], frequency) for k, t in zip(here, times, strict=True)]
    return np.array(ends)[:, 0], np.array(ends)[:, 1]


def _slope(state, frequency):
    a, b, sigma = state
    return np.array([sigma * a, -sigma * b, (sigma**2 + frequency**2) * (b * b - a * a) / (b * b + a * a)])


def _runge_kutta(state, step, frequency):
    k1 = _slope(state, frequency)
    k2 = _slope(state + 0.5 * step * k1, frequency)
    k3 = _slope(state + 0.5 * step * k2, frequency)
    k4 = _slope(state + step * k3, frequency)
    return state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def poiseuille(y, time, acceleration, viscosity, width=1.0, terms=50):
    """Velocity [m/s] at distances `y` [m] from one of two plates `width` [m] apart, `time` [s] after the flow began from rest.

    u = F/(2 nu) y (d - y) - sum_n 4 F d^2/(nu pi^3 (2n+1)^3) sin(pi y (2n+1)/d) exp(-(2n+1)^2 pi^2 nu t/d^2)
    (Morris, Fox & Zhu 1997, Eq. 36).
    """
    odd = (2 * np.arange(terms) + 1)[:, None]
    scale = acceleration * width**2 / viscosity
    waves = np.sin(np.pi * odd * np.asarray(y) / width) * np.exp(-((odd * np.pi) ** 2) * viscosity * time / width**2)
    steady = 0.5 * np.asarray(y) * (width - np.asarray(y)) / width**2
    return scale * (steady - (4.0 / (np.pi * odd) ** 3 * waves).sum(axis=0))
