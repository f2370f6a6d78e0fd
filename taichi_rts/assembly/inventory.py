"""The state of a simulation: every field and every plain value of its parts, found by walking through them.

No list is kept by hand: every attribute of a part is saved, unless its class names it in `transient`, because it holds nothing
between two steps or follows from the scene and the stepper. An entry forgotten there costs a few bytes, not the bits of a run.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np

from taichi_rts.device.backend import ti
from taichi_rts.scene.scene import Scene

PACKAGE = "taichi_rts"
PLAIN = (bool, int, float, str, type(None), np.ndarray, np.generic)


class State:
    """The fields and plain values that can be reached from `root`, by their paths, such as "schedule.youngest".

    Attributes:
        fields: Taichi's fields, each once, under the first path that leads to it.
        owners: the attributes of each part that may change, by the part's path.
        parts: all parts.

    With `everything` also what is called transient.
    """

    def __init__(self, root: Any, *, everything: bool = False) -> None:
        self._everything = everything
        self.fields: dict[str, Any] = {}
        self.owners: dict[str, dict[str, Any]] = {}
        self.parts: list[Any] = []
        self._skipped: dict[str, frozenset[str]] = {}
        seen: set[int] = set()
        queue = deque([("", root)])
        while queue:  # the nearest first, so that paths are short
            queue.extend(self._look_at(*queue.popleft(), seen))

    def values(self) -> Iterator[tuple[str, str, Any]]:
        """Yield owner, name and present value of every plain attribute."""
        for path, owner in self.owners.items():
            for name, value in owner.items():
                if name not in self._skipped[path] and is_plain(value):
                    yield path, name, value

    def _look_at(self, path: str, thing: Any, seen: set[int]) -> list[tuple[str, Any]]:
        """Take note of `thing` and return what it is made of."""
        if id(thing) in seen or isinstance(thing, Scene):  # a description: it never changes, and may have 100,000 parts
            return []
        seen.add(id(thing))
        if isinstance(thing, ti.Field):
            self.fields[path] = thing
        elif isinstance(thing, (list, tuple)):
            return [(join(path, str(number)), each) for number, each in enumerate(thing)]
        elif isinstance(thing, dict):
            return [(join(path, str(number)), each) for number, each in enumerate(thing.values())]
        elif is_part(thing):
            self.parts.append(thing)
            skipped = frozenset() if self._everything else transient_names(type(thing))
            if not is_frozen(thing):
                self.owners[path], self._skipped[path] = vars(thing), skipped
            return [(join(path, name), value) for name, value in vars(thing).items() if name not in skipped]
        return []


def parts(root: Any, kind: type) -> list[Any]:
    """List all parts of class `kind` that can be reached from `root`, each once."""
    return [part for part in State(root, everything=True).parts if isinstance(part, kind)]


def transient_names(kind: type) -> frozenset[str]:
    """Names that a class and its base classes list in `transient`."""
    return frozenset(name for cls in kind.__mro__ for name in vars(cls).get("transient", ()))


def join(path: str, name: str) -> str:
    """Return the path of `name` in the part at `path`."""
    return f"{path}.{name}" if path else name


def is_part(thing: Any) -> bool:
    """Whether `thing` is an object of this package, of a class derived from one of its, or of a user's class with ti.funcs."""
    kind = type(thing)
    ours = getattr(kind, "_data_oriented", False) or any(c.__module__.split(".")[0] == PACKAGE for c in kind.__mro__)
    return ours and hasattr(thing, "__dict__")


def is_frozen(thing: Any) -> bool:
    """Whether the values of `thing` never change."""
    parameters = getattr(type(thing), "__dataclass_params__", None)  # of dataclasses, pydantic's too
    return parameters is not None and parameters.frozen


def is_plain(value: Any) -> bool:
    """Whether `value` is a number, a text, an array, or consists of such."""
    if isinstance(value, (list, tuple)):
        return all(is_plain(each) for each in value)
    if isinstance(value, dict):
        return all(is_plain(each) for each in value.values())
    return isinstance(value, PLAIN)
