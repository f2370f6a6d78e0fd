"""What levels mean to a reader: octaves, and which levels are shown as one."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


def milliseconds(time: float) -> str:
    """Return a time [s] as text in ms: with three decimals, or three digits where that would be too coarse."""
    value = 1e3 * time
    return f"{value:.3f}" if value >= 0.1 else f"{value:.3g}"


class LevelClass(NamedTuple):
    """Levels that readers see as one: those from `first` to `last`, and how much of the whole they have."""

    first: int
    last: int
    share: float

    def __str__(self) -> str:
        """Return "4", or "4–7"."""
        return str(self.first) if self.first == self.last else f"{self.first}–{self.last}"


def level_classes(shares: Sequence[float] | np.ndarray, doubling: bool) -> list[LevelClass]:
    """Return a class for each level, or with `doubling` for each octave, which then names only levels that have a share."""
    share = np.asarray(shares, float)
    if not doubling:
        return [LevelClass(n, n, float(part)) for n, part in enumerate(share, start=1)]
    levels = np.arange(1, len(share) + 1)
    classes = []
    for octave in np.unique(octaves(levels)):
        members = levels[octaves(levels) == octave]
        some = members[share[members - 1] > 0.0] if share[members - 1].any() else members[:1]
        classes.append(LevelClass(int(some[0]), int(some[-1]), float(share[members - 1].sum())))
    return classes


def octaves(levels) -> np.ndarray:
    """Return 1 + floor(log2 n) of levels n: 1 is in octave 1, 2 and 3 are in octave 2, 4 to 7 in octave 3."""
    return np.frexp(np.asarray(levels, float))[1]  # exact, unlike a logarithm
