"""Pictures of several panels: the same scene by different steppers or in different views, at the same physical time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from taichi_rts.solver.stepping.asynchronous import Asynchronous
from taichi_rts.solver.stepping.regional import Regional
from taichi_rts.solver.stepping.uniform import Uniform


@dataclass(frozen=True)
class Panel:
    """One panel: its caption, its stepper, and what it changes in the picture's options."""

    caption: str
    stepper: Any
    options: dict[str, Any] = field(default_factory=dict)


PAPER = Regional(preset="paper")

LAYOUTS: dict[str, list[Panel]] = {
    "figure3": [
        Panel("Regional time stepping, coloured by region", PAPER),
        Panel("The same from another viewpoint", PAPER, {"colour_by": "plain", "azimuth": 35.0}),
        Panel("Standard method at the base step", Uniform(), {"colour_by": "plain", "azimuth": 35.0}),
    ],
    "ablation": [
        Panel("Without the corrector", Regional(preset="paper", corrector=False)),
        Panel("With the corrector", PAPER),
    ],
    "steppers": [
        Panel("Uniform: every step is 0.4 r/c_s", Uniform()),
        Panel("Regional, the paper's preset: steps of 1 to 3 times 0.4 r/c_s", PAPER),
        Panel(
            "Asynchronous, courant 0.8, lambda_f 0.05: steps of 1 to 16 times 0.05 r/c_s",
            Asynchronous(courant=0.8, levels=16, lambda_f=0.05),
        ),
    ],
}
"""`figure3` and `ablation` are Figures 3 and 2 of Goswami & Batty 2014; `steppers` shows what each stepper makes of a scene."""

DEFAULT_LAYOUT = {"serna_ablation": "ablation"}
"""Scenes that are about a comparison, and the layout that shows it."""
