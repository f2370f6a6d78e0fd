"""Speed against error: which stepper, at which step, is worth it on a scene. `docs/compare.md` holds all definitions."""

from taichi_rts.compare.analysis import analyse
from taichi_rts.compare.runner import Settings, compare

__all__ = ["Settings", "analyse", "compare"]
