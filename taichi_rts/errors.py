"""Everything a user can cause derives from `Error` and says the value, the limit and the remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class Error(Exception):
    """Base of all errors that a user can cause; the command line turns it into one line and exit code 2."""


class BackendError(Error, RuntimeError):
    """The requested arch or precision is not available, or nothing was initialised."""


class SceneError(Error, ValueError):
    """A scene, or a file or name that should give one, is not valid."""


class StepperError(Error, ValueError):
    """A stepper's parameters are not valid."""


class TimeError(Error, ValueError):
    """A time was asked for that lies in the past or is not a number."""


class ResourceError(Error, MemoryError):
    """A run needs more memory, or more ticks of its clock, than there are."""


class OutputError(Error, OSError):
    """Something cannot be written where it was asked for."""


class CheckpointError(Error, ValueError):
    """A checkpoint cannot be read, is damaged, or belongs to another run."""


class RenderError(Error, RuntimeError):
    """A picture or a window cannot be made."""


class Interrupted(KeyboardInterrupt):
    """A run was asked to stop and has stopped between two steps."""


class SimulationDivergedError(Error, ArithmeticError):
    """The state stopped being finite."""


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for an unknown `name`, with the nearest of the `known`; "" if none is near."""
    near = difflib.get_close_matches(str(name), list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""
