"""What follows from the fields of a scene: lengths, speeds and potentials. Nothing here samples or checks anything."""

from __future__ import annotations

import functools
import math

import numpy as np

from taichi_rts.scene.fields import SceneFields
from taichi_rts.scene.geometry.bodies import bodies
from taichi_rts.scene.parts.gravity import GravityTable
from taichi_rts.scene.parts.sound import FLOOR, RegionalSound

LARGEST_RATIO = 32.0  # of sound speeds in one scene


class SceneScales(SceneFields):
    """A scene's fields and what follows from them, without a check that they go together: what the checks work with."""

    @property
    def support(self) -> float:
        """Support radius r [m], also the side of a block."""
        return self.support_ratio * self.spacing

    @property
    def wall_planes(self) -> int:
        """How many planes of wall particles lie behind a face: as many as the lattice has there in reach of a resting layer.

        The lattice's planes lie s, 2s, ... from the layer that rests half a spacing from the face, and those nearer than r count:
        one up to r = 2s, two up to 3s, three up to 4s. One plane that has their density and slope in a lattice at rest will
        not do: a still pool at r = 3s falls through it (docs/evidence/validation.md).
        """
        return math.ceil(self.support_ratio - 1e-9) - 1

    @property
    def acceleration(self) -> tuple[float, ...]:
        """Gravity [m/s^2], (dim,), at the start, with the default filled in."""
        return self.gravity if self.gravity is not None else (0.0, -9.81, 0.0)[: self.dim]

    def acceleration_at(self, time: float) -> tuple[float, ...]:
        """Gravity [m/s^2], (dim,), at `time` [s]."""
        return tuple(self.gravity_table.at(np.array([time]))[0].tolist())

    @functools.cached_property
    def gravity_table(self) -> GravityTable:
        """Gravity as a function of time, with that of the start."""
        times = np.array([0.0, *(change.time for change in self.gravity_changes)])
        values = np.array([self.acceleration, *(change.gravity for change in self.gravity_changes)])
        return GravityTable(times, values, self.gravity_interpolation == "linear")

    @property
    def up(self) -> tuple[float, float, float]:
        """Unit vector, (3,), against gravity, or the first change of it that is not 0; y without gravity.

        A component along a periodic axis drives a flow and is no weight: it does not count.
        """
        for gravity in (self.acceleration, *(change.gravity for change in self.gravity_changes)):
            against = [0.0 if repeats else 0.0 - g for g, repeats in zip(gravity, self.is_periodic, strict=True)]
            if length := math.hypot(*against):
                x, y, z = (g / length for g in (*against, 0.0)[:3])
                return x, y, z
        return 0.0, 1.0, 0.0

    @property
    def viscosities(self) -> tuple[float, ...]:
        """Kinematic viscosity [m^2/s] of each fluid, (len(fluids),), and of what flows in, if anything does."""
        own = (fluid.kinematic_viscosity for fluid in self.fluids)
        inflow = (self.kinematic_viscosity,) * bool(self.inflows)
        return (*(self.kinematic_viscosity if nu is None else nu for nu in own), *inflow)

    @property
    def fluid_names(self) -> tuple[str, ...]:
        """What legends call each fluid, (len(fluids),), and what flows in, if anything does."""
        return (*(f"fluid {k}" for k in range(1, len(self.fluids) + 1)), *("inflow",) * bool(self.inflows))

    @property
    def fluid_colours(self) -> tuple[str | None, ...]:
        """Colour of each of `fluid_names`, None for the palette's."""
        return (*(fluid.colour for fluid in self.fluids), *(None,) * bool(self.inflows))

    @property
    def volume(self) -> float:
        """Volume [m^3] (area [m^2] in two dimensions) of all fluid at the start."""
        return sum(fluid.volume_at(self.spacing) for fluid in self.fluids)

    @property
    def regional_sound(self) -> RegionalSound | None:
        """What governs the regional sound speed, if there is one."""
        if self.sound_speed == "regional":
            return RegionalSound()
        return self.sound_speed if isinstance(self.sound_speed, RegionalSound) else None

    @property
    def bears_regional_sound(self) -> bool:
        """Whether the sound speed may be regional: it needs summed densities and no background pressure."""
        return self.density == "summation" and self.background_pressure == 0.0

    @property
    def wave_speed(self) -> float:
        """Sound speed c_s [m/s]: as given, or ten times `estimate_max_speed` (Becker & Teschner 2007, for 1 % compression).

        The largest, where it is regional: it sets the base step.
        """
        regional = self.regional_sound
        if regional is not None:
            return regional.cap if regional.cap is not None else 2.0 / regional.mach * self.estimate_max_speed()
        given = self.sound_speed
        return float(given) if isinstance(given, (int, float)) else 10.0 * self.estimate_max_speed()

    @property
    def viscous_wave_speed(self) -> float:
        """Sound speed [m/s] in the artificial viscosity alpha h c: that of the scene with one sound speed.

        It must not follow the region, or calm water would get less viscosity and the flow would be another.
        """
        return self.wave_speed if self.regional_sound is None else 10.0 * self.estimate_max_speed()

    @property
    def least_wave_speed(self) -> float:
        """Smallest sound speed [m/s] that any region may have; `wave_speed` where it is the same everywhere."""
        regional = self.regional_sound
        if regional is None:
            return self.wave_speed
        floor = regional.floor if regional.floor is not None else FLOOR * math.sqrt(self.depth_potential)
        return min(max(floor, self.wave_speed / LARGEST_RATIO), self.wave_speed)

    @property
    def depth_potential(self) -> float:
        """Product g H [m^2/s^2], H being the largest depth of the fluids, one on top of the other, under any gravity."""
        pulls = np.abs(self.gravity_table.values)
        mains = pulls.argmax(axis=1)
        return max(self._stack(pulls[mains == main], main) for main in set(mains.tolist()))

    def _stack(self, pulls: np.ndarray, main: int) -> float:
        """Largest product g H [m^2/s^2] under `pulls`, magnitudes of gravity [m/s^2], (K, dim), with the main axis `main`.

        Fluids that overlap across that axis stand on each other.
        """
        across = [d for d in range(self.dim) if d != main]
        thickness = [
            sum(pulls[:, d] * (fluid.upper[d] - fluid.lower[d]) for d in range(self.dim)) for fluid in self.fluids
        ]
        stacks = [
            sum(
                (
                    thickness[k]
                    for k, other in enumerate(self.fluids)
                    if all(other.lower[d] < fluid.upper[d] and fluid.lower[d] < other.upper[d] for d in across)
                ),
                start=np.zeros(len(pulls)),
            )
            for fluid in self.fluids
        ]
        return float(np.max(stacks))

    @property
    def wall_speed(self) -> float:
        """Largest speed [m/s] of a moving wall or of a point of a moving obstacle."""
        return max([0.0, *(wall.top_speed for wall in self.moving_walls), *(body.top_speed for body in bodies(self))])

    def estimate_max_speed(self) -> float:
        """Largest speed [m/s] any fluid can reach by falling from where it is: max of sqrt(|v|^2 + 2 g H).

        H [m] is the height of a fluid's top above the lowest corner of the domain, along gravity, |v| the largest speed in
        its bounding box, or of an inflow, a moving wall or an obstacle. After a change of gravity fluid may fall through all
        of the domain; along a periodic axis it falls once around. A body force is left out.
        """
        uphill = tuple(-a for a in self.acceleration)
        starts = [(fluid.top_speed, fluid.reach(uphill)) for fluid in self.fluids]
        starts += [(math.hypot(*inflow.velocity), inflow.reach(uphill)) for inflow in self.inflows]
        falls = [(speed, max(height - self.floor_potential, 0.0)) for speed, height in starts]
        top = max(speed for speed, _ in falls)
        if self.gravity_changes:
            pulls = np.abs(self.gravity_table.values[1:])
            falls.append((top, float(sum(pulls[:, d] * length for d, length in enumerate(self.domain.size)).max())))
        return max(self.wall_speed, *(math.sqrt(speed**2 + 2.0 * fall) for speed, fall in falls))

    @property
    def floor_potential(self) -> float:
        """Smallest value of -g.x over the domain [m^2/s^2], with the gravity of the start: there the potential energy is 0."""
        return -self.domain.reach(self.acceleration)
