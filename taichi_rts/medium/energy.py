"""Kinetic, potential and internal energy of a state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from taichi_rts.medium.medium import Medium
from taichi_rts.scene.scene import Scene


class Energy(NamedTuple):
    """Energies [J] (per metre of depth in two dimensions).

    `potential` is gravity's, 0 at the domain's floor, and a body force's, 0 at its origin.
    """

    kinetic: float
    potential: float
    internal: float

    @property
    def total(self) -> float:
        """The sum of the three [J]."""
        return self.kinetic + self.potential + self.internal


def measure_energy(
    scene: Scene,
    medium: Medium,
    positions: np.ndarray,
    velocities: np.ndarray,
    densities: np.ndarray,
    time: float = 0.0,
) -> Energy:
    """Sum kinetic, potential (in the gravity of `time` [s]) and internal energy [J] of particles in a fixed order, in f64."""
    x, v, rho = (np.asarray(array, dtype=np.float64) for array in (positions, velocities, densities))
    potential = potential_of(scene, x, time)
    return Energy(
        kinetic=float(0.5 * medium.mass * (v * v).sum()),
        potential=float(medium.mass * potential.sum()),
        internal=float(medium.mass * medium.equation_of_state.specific_energy(rho).sum()),
    )


def potential_of(scene: Scene, x: np.ndarray, time: float) -> np.ndarray:
    """Potential energy [J/kg], (N,), at positions `x` [m], (N, dim), in the gravity of `time` [s] and the body force."""
    potential = -(x @ np.asarray(scene.acceleration_at(time))) - scene.floor_potential
    return potential if scene.body_force is None else potential + scene.body_force.potential(x)
