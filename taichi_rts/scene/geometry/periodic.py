"""Distances along periodic axes."""

from __future__ import annotations

import numpy as np

from taichi_rts.scene.fields import SceneFields


def periods(scene: SceneFields) -> np.ndarray:
    """Lengths of the periodic axes [m], infinity for others, (dim,)."""
    lengths = zip(scene.domain.size, scene.is_periodic, strict=True)
    return np.asarray([length if periodic else np.inf for length, periodic in lengths])


def nearest_image(gap: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Differences of positions [m], (..., dim), to the nearest image; `lengths` is what `periods` returns."""
    wrapped = np.isfinite(lengths)
    gap[..., wrapped] -= lengths[wrapped] * np.round(gap[..., wrapped] / lengths[wrapped])
    return gap
