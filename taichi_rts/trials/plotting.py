"""Colours and markers of plots, and the extra that they need."""

from __future__ import annotations

import importlib.util

from taichi_rts.errors import OutputError

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe & Ito 2008: told apart with any common form of colour blindness; markers differ as well."""
MARKERS = "osD^vPX"


def require_plots(otherwise: str = "give --no-plot") -> None:
    """Raise `OutputError` if the extra is not installed, before any work is done."""
    if importlib.util.find_spec("matplotlib") is None:
        raise OutputError(
            f"the plot needs the package matplotlib; run: pip install 'taichi_rts[plots]', or {otherwise}"
        )
