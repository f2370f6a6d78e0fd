"""All steppers by name."""

from typing import Any

from taichi_rts.stepping.asynchronous import Asynchronous
from taichi_rts.stepping.regional import Regional
from taichi_rts.stepping.uniform import Uniform

STEPPERS: dict[str, Any] = {kind.name: kind for kind in (Uniform, Regional, Asynchronous)}
