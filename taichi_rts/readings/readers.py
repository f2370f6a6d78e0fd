"""What a simulation tells of its particles: each a copy out of the one `Reading` of the present time."""

from __future__ import annotations

import weakref

import numpy as np

from taichi_rts.assembly.run import Run
from taichi_rts.device.ownership import guarded
from taichi_rts.medium.energy import Energy
from taichi_rts.readings.diagnosis import require_whole
from taichi_rts.readings.reading import Moment, Reading
from taichi_rts.scene.placing import placed


@guarded()
class Readers(Run):
    """The readers of `Simulation`: arrays are in order of particle id, N is the number of particles that are there."""

    transient = frozenset({"_latest"})
    _latest: weakref.ref[Reading] | None = None

    def read(self) -> Reading:
        """Return the present state: one object for all that ask at one time, as long as any of them holds it."""
        found = self._latest() if self._latest else None
        if found is None or found.moment != Moment.of(self):
            found = Reading.of(self)
            self._latest = weakref.ref(found)
        return found

    def restored(self) -> None:
        """Take note that fields and values have been put back to what they were at another time."""
        self.grid.restored()
        for extra in self.solver.extras:
            extra.restored()
        self._latest = None

    def ids(self) -> np.ndarray:
        """Stable ids, (N,), of the particles that all readers speak of, ascending; an outlet takes some out for good."""
        return self.read().ids.copy()

    def placed(self, x: np.ndarray) -> np.ndarray:
        """Positions `x` [m], (..., dim), counted from `origin`, as the scene counts: in double precision unless that is 0."""
        return placed(self.scene, x)

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s], (N, dim), densities [kg/m^3] and levels, (N,), at `time`, by particle id.

        Reals have the run's precision, positions in a domain far from 0 double precision.
        """
        now = self.read()
        return now.positions.copy(), now.velocities.copy(), now.densities.copy(), now.levels.copy()

    def local_state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """As `state`, with positions [m], (N, dim), counted from `origin`: all reals have the run's precision."""
        now = self.read()
        return now.local_positions.copy(), now.velocities.copy(), now.densities.copy(), now.levels.copy()

    def positions(self) -> np.ndarray:
        """Positions [m], (N, dim), predicted to `time`, in order of particle id; far from 0 in double precision (`state`)."""
        return self.read().positions.copy()

    def velocities(self) -> np.ndarray:
        """Velocities [m/s], (N, dim), predicted to `time`, in order of particle id."""
        return self.read().velocities.copy()

    def densities(self) -> np.ndarray:
        """Densities [kg/m^3], (N,), by particle id: of each particle's last evaluation, with `Asynchronous` at `time`."""
        return self.read().densities.copy()

    def pressures(self) -> np.ndarray:
        """Pressures [Pa], (N,), by particle id, that belong to `densities`."""
        return self.read().pressures.copy()

    def sound_speeds(self) -> np.ndarray:
        """Sound speeds [m/s], (N,), at each particle's last evaluation, by particle id."""
        return self.read().sound_speeds.copy()

    def levels(self) -> np.ndarray:
        """Levels n, (N,): each particle's step is n base steps. In order of particle id."""
        return self.read().levels.copy()

    def fluids(self) -> np.ndarray:
        """Place of each particle's fluid in the scene, (N,), len(fluids) for what has flowed in. In order of particle id."""
        return self.read().fluids.copy()

    def steps(self) -> np.ndarray:
        """Steps [s], (N,): level times base step (`Uniform(adaptive=True)`: at most). In order of particle id."""
        return self.read().steps.copy()

    def cell_times(self) -> np.ndarray:
        """Time [s] of each particle's last force evaluation, (N,), by particle id: asynchronous cells run ahead of `time`."""
        return self.read().cell_times.copy()

    def leads(self) -> np.ndarray:
        """How far [s] the end of each particle's step lies ahead of the earliest end, (N,). In order of particle id."""
        return self.read().leads.copy()

    def energy(self) -> Energy:
        """Kinetic, potential and internal energy [J] at `time`."""
        return self.read().energy

    def momentum(self) -> np.ndarray:
        """Total momentum [kg m/s], (dim,), at `time`."""
        return self.read().momentum.copy()

    def check(self) -> None:
        """Raise `SimulationDivergedError` with a diagnosis if the run has blown up, as a recording does at every frame.

        That is: a state is not finite, speeds or accelerations had to be limited, or a density is not between 0.02 and 2 of
        rest. It reads the state, so it is for once in a while; `advance_to` itself notices only what is not finite.
        """
        require_whole(self.read())
