"""What schedules take: the parameters of a stepper in one scene, with nothing left open. They know no description."""

from __future__ import annotations

from dataclasses import dataclass


def lengths(steps: str, most: int) -> list[int]:
    """Levels up to `most` that blocks may have."""
    keep = {
        "integers": lambda n: True,
        "powers_of_two": lambda n: n & (n - 1) == 0,
        "half_octaves": lambda n: n & (n - 1) == 0 or (n % 3 == 0 and (n // 3) & (n // 3 - 1) == 0),
    }[steps]
    return [n for n in range(1, most + 1) if keep(n)]


@dataclass(frozen=True)
class Settled:
    """Parameters of steps that differ from block to block.

    Attributes:
        levels: base steps in the longest step.
        longest_courant: Courant number of the longest step in water at rest density.
        lambda_f: factor of the force limit (Eq. 2).
        limiter: whether the neighbour limiter acts.
    """

    levels: int
    longest_courant: float
    lambda_f: float
    limiter: bool


@dataclass(frozen=True)
class SettledRegions(Settled):
    """Parameters of `Regional` in one scene.

    Attributes:
        courant: lambda_v of Eq. 1.
        strict_cfl: whether the base step is divided by `levels`.
        aligned: whether steps end at multiples of themselves.
        lengths: levels that blocks may have, ascending.
        fractions: right sides of Eq. 3, alpha beta_n, of n = 2 to `levels`.
        local_sound: whether Eq. 1 holds with the sound speed of compressed water.
        grading: whether levels of neighbours differ by one at most.
    """

    courant: float
    strict_cfl: bool
    aligned: bool
    lengths: tuple[int, ...]
    fractions: tuple[float, ...]
    local_sound: bool
    grading: bool


@dataclass(frozen=True)
class SettledCells(Settled):
    """Parameters of `Asynchronous` in one scene; its base steps are ticks.

    Attributes:
        powers_of_two: whether steps have lengths of 1, 2, 4 ... ticks.
        staggered: whether first steps are random, with the seed `seed`.
    """

    powers_of_two: bool
    staggered: bool
    seed: int
