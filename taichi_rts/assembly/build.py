"""The parts of a run, from its scene."""

from __future__ import annotations

from typing import Any

from taichi_rts.solver.physics.continuity import ContinuityDensity
from taichi_rts.solver.physics.density import SummationDensity

DENSITIES: dict[str, Any] = {"summation": SummationDensity, "continuity": ContinuityDensity}
