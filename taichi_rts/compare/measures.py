"""The errors of a run: each is one number, computed in NumPy from two trajectories of the same particles.

Particles are matched by id; where their number grows during a run, the ids that both runs have are compared. Every error is
a root mean square over the sample times, so that a single moment does not decide. `docs/compare.md` repeats these definitions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_rts.compare.trajectory import Trajectory
from taichi_rts.medium.medium import Medium
from taichi_rts.readings import measures
from taichi_rts.sampling.sampling import calibrate_mass
from taichi_rts.scene.geometry import periodic
from taichi_rts.scene.geometry.periodic import nearest_image
from taichi_rts.scene.scene import Scene

PARTED = 0.01
"""Two runs have diverged when the relative L2 difference of their velocities exceeds this, by default."""


@dataclass(frozen=True)
class Yardstick:
    """What makes errors dimensionless, worked out once for a scene and its reference.

    Attributes:
        length: longest edge of the fluid's bounding box at the start [m].
        energy: largest kinetic energy of the reference [J].
        pressure: rho_0 V^2 / 2 [Pa], with V the scene's estimate of the largest speed, so rho_0 g H for fluid that falls; where
            nothing falls or moves at the start, V is the reference's largest speed.
        momentum: mass of all fluid times the reference's largest speed [kg m/s].
        periods: lengths of the periodic axes [m], infinity for others, (dim,).
        probes: where pressures are compared [m], (P, dim).
        medium: the fluid's constants.
    """

    length: float
    energy: float
    pressure: float
    momentum: float
    periods: np.ndarray
    probes: np.ndarray
    medium: Medium

    @classmethod
    def of(cls, scene: Scene, reference: Trajectory, probes: np.ndarray | None = None) -> Yardstick:
        """Work out the scales of `scene` from its `reference`; `probes` [m], (P, dim), None: `default_probes`."""
        start = reference.positions[0]
        medium = Medium.of(scene, calibrate_mass(scene))
        fastest = max(float(np.linalg.norm(v, axis=1).max()) for v in reference.velocities)
        speed = scene.estimate_max_speed() or fastest
        return cls(
            length=float((start.max(axis=0) - start.min(axis=0)).max()) + scene.spacing,
            energy=max(max(row[0] for row in reference.energies), np.finfo(float).tiny),
            pressure=0.5 * scene.rest_density * speed**2,
            momentum=medium.mass * max(len(x) for x in reference.positions) * max(fastest, np.finfo(float).tiny),
            periods=periodic.periods(scene),
            probes=default_probes(scene, start) if probes is None else probes,
            medium=medium,
        )


def default_probes(scene: Scene, start: np.ndarray) -> np.ndarray:
    """Probes [m], (P, dim), half a spacing inside the walls: on the floor and on the two faces across x.

    On the floor at 1/4, 1/2 and 3/4 of the width the fluid has at the start, and at the middle of the domain; on each face across
    x at 1/10 of the fluid's height above the floor. Middles in z. The floor is the domain's lower face across y.
    """
    lower, upper = np.asarray(scene.domain.lower), np.asarray(scene.domain.upper)
    low, high = start.min(axis=0), start.max(axis=0)
    inset = 0.5 * scene.spacing
    middle = 0.5 * (lower + upper)
    floor = [low[0] + share * (high[0] - low[0]) for share in (0.25, 0.5, 0.75)] + [middle[0]]
    height = lower[1] + max(inset, 0.1 * (high[1] - lower[1]))
    places = [(x, lower[1] + inset) for x in floor] + [(x, height) for x in (lower[0] + inset, upper[0] - inset)]
    return np.array([[*place, *middle[2:]] for place in places])


def differences(one: np.ndarray, two: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """Differences of positions [m] of the ids that both have, (N, dim), to the nearest image across periodic faces."""
    n = min(len(one), len(two))
    return nearest_image(one[:n].astype(np.float64) - two[:n], periods)


def velocity_gap(run: Trajectory, reference: Trajectory, k: int) -> float:
    """||v - v_ref|| / ||v_ref|| at sample k; 0 where the reference rests and the run does too."""
    v, w = run.velocities[k], reference.velocities[k]
    n = min(len(v), len(w))
    return _over(np.linalg.norm(v[:n].astype(np.float64) - w[:n]), np.linalg.norm(w[:n]))


def position_gap(run: Trajectory, reference: Trajectory, k: int, periods: np.ndarray) -> float:
    """||x - x_ref|| / ||x_ref - x_ref(0)|| at sample k: the difference of displacements over displacements.

    Where particles have been added since the start, those of the start are compared. Displacements are to the nearest image, so
    with periodic axes they are meaningful up to half a period.
    """
    n = len(reference.positions[0])
    gap = differences(run.positions[k][:n], reference.positions[k][:n], periods)
    moved = differences(reference.positions[k][:n], reference.positions[0], periods)
    return _over(np.linalg.norm(gap), np.linalg.norm(moved))


def parting(one: Trajectory, two: Trajectory, threshold: float = PARTED) -> int:
    """Number of samples after the start before `velocity_gap` of two runs exceeds `threshold`: 0 where it does at once."""
    for k in range(1, len(two.times)):
        if not velocity_gap(one, two, k) <= threshold:
            return k - 1
    return len(two.times) - 1


def velocities(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Relative L2 norm of the difference of velocities at matched ids, rms over the samples up to t_p.

    None if there is no sample before t_p.
    """
    return _rms([velocity_gap(run, reference, k) for k in range(1, together + 1)])


def positions(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Relative L2 norm of the difference of displacements at matched ids, rms over the samples up to t_p."""
    return _rms([position_gap(run, reference, k, scale.periods) for k in range(1, together + 1)])


def front_position(run: Trajectory, k: int) -> float:
    """Front of the fluid [m] at sample k: its fifth-largest x."""
    return measures.front(run.positions[k])


def front(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Difference of the fronts (fifth-largest x of the fluid) over the fluid's length, rms over the whole run."""
    return _curve(run, reference, front_position, scale.length)


def centre_of_mass(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Distance of the centres of mass over the fluid's length, rms over the whole run; along periodic axes it is left out."""
    free = ~np.isfinite(scale.periods)
    return _curve(run, reference, lambda r, k: r.positions[k][:, free].mean(axis=0, dtype=np.float64), scale.length)


def kinetic_energy(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Difference of kinetic energies over the reference's largest, rms over the whole run."""
    return _curve(run, reference, lambda r, k: r.energies[k][0], scale.energy)


def potential_energy(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Difference of potential energies over the reference's largest kinetic energy, rms over the whole run."""
    return _curve(run, reference, lambda r, k: r.energies[k][1], scale.energy)


def density(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Difference of D, rms over the whole run; D(t) is the rms over all particles of max(rho / rho_0 - 1, 0)."""

    def deviation(r: Trajectory, k: int) -> float:
        excess = np.maximum(r.densities[k].astype(np.float64) / scale.medium.rest_density - 1.0, 0.0)
        return float(np.sqrt((excess**2).mean()))

    return _curve(run, reference, deviation, 1.0)


def pressure(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Difference of the pressures at the probes over rho_0 V^2 / 2, rms over probes and the whole run."""
    root = np.sqrt(max(1, len(scale.probes)))
    return _curve(run, reference, lambda r, k: probe_pressures(r, k, scale) / root, scale.pressure)


def momentum(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> float | None:
    """Difference of total momentum over the fluid's mass times the reference's largest speed, rms over the whole run."""
    return _curve(
        run, reference, lambda r, k: scale.medium.mass * r.velocities[k].sum(axis=0, dtype=np.float64), scale.momentum
    )


def probe_pressures(run: Trajectory, k: int, scale: Yardstick) -> np.ndarray:
    """Pressures [Pa] at the probes, (P,), at sample k: sum_j p_j W_j / sum_j W_j over the support radius, 0 where it is empty."""
    return measures.interpolate(run.positions[k], run.pressures[k], scale.probes, scale.medium.kernel, scale.periods)


ERRORS: dict[str, Callable[[Trajectory, Trajectory, Yardstick, int], float | None]] = {
    measure.__name__: measure
    for measure in (
        velocities, positions, front, centre_of_mass, kinetic_energy, potential_energy, density, pressure, momentum,
    )
}  # fmt: skip
"""Every error by its name; to add one, write a function like these and list it here and in docs/compare.md."""
MATCHED = ("velocities", "positions")
"""Errors that compare particle by particle, and so only until t_p."""


def judge(run: Trajectory, reference: Trajectory, scale: Yardstick, together: int) -> dict[str, float | None]:
    """Return every error of `run` against `reference`; `together` is the number of samples before t_p."""
    return {name: measure(run, reference, scale, together) for name, measure in ERRORS.items()}


def _curve(
    run: Trajectory, reference: Trajectory, read: Callable[[Trajectory, int], Any], scale: float
) -> float | None:
    """Rms over the samples after the start of |read(run) - read(reference)| / scale."""
    gaps = [
        np.linalg.norm(np.asarray(read(run, k)) - read(reference, k)) / scale for k in range(1, len(reference.times))
    ]
    return _rms(gaps)


def _rms(values: list[Any]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _over(gap: Any, size: Any) -> float:
    if size > 0.0:
        return float(gap / size)
    return 0.0 if gap == 0.0 else float("inf")
