"""All steppers by name."""

import dataclasses
from typing import Any

from taichi_rts.solver.stepping.asynchronous import Asynchronous
from taichi_rts.solver.stepping.regional import Regional
from taichi_rts.solver.stepping.uniform import Uniform

STEPPERS: dict[str, Any] = {kind.name: kind for kind in (Uniform, Regional, Asynchronous)}


def stepper_data(stepper: Any) -> dict[str, Any]:
    """Return a stepper as plain data: its name and every parameter."""
    return {"name": stepper.name, **dataclasses.asdict(stepper)}


def stepper_from(data: dict[str, Any]) -> Any:
    """Build the stepper that `stepper_data` described; raises `StepperError` for parameters that are not valid."""
    return STEPPERS[data["name"]](**{key: value for key, value in data.items() if key != "name"})
