"""Spares Taichi's front end from reading the source of a function again at every call that a kernel inlines."""

import functools
import sys
import textwrap
import types
from typing import Any


@functools.cache
def _wrapped(width: int, text: str) -> tuple[str, ...]:
    return tuple(textwrap.wrap(text, width))


class RememberingWrapper:
    """What Taichi uses of `textwrap.TextWrapper`, wrapping each text only once."""

    def __init__(self, width: int) -> None:
        self.width = width

    def wrap(self, text: str) -> list[str]:
        """Return the lines of `text`, as `textwrap.wrap` does."""
        return list(_wrapped(self.width, text))


def remember(transformer: Any, kernels: Any) -> None:
    """Have Taichi's modules `ast_transformer_utils` and `kernel_impl` remember what they read of sources.

    They look up and lay out the source of a function at every call of it, and of every node of it for messages of errors: some
    60 000 lines until the first frame of a double dam break, where there are a few hundred. What they say and compile is the
    same. Nor need they read a file to know whether a function is being defined in a class. Where another version of Taichi does
    it otherwise nothing changes.
    """
    if getattr(transformer, "TextWrapper", None) is textwrap.TextWrapper:
        transformer.TextWrapper = RememberingWrapper
    if getattr(kernels, "textwrap", None) is textwrap:
        kernels.textwrap = types.SimpleNamespace(
            fill=functools.cache(textwrap.fill), dedent=functools.cache(textwrap.dedent)
        )
    if isinstance(getattr(kernels, "_inside_class", None), types.FunctionType):
        kernels._inside_class = is_in_class
    for name in ("getsourcefile", "getsourcelines"):
        function = getattr(kernels, name, None)
        if isinstance(function, types.FunctionType):
            setattr(kernels, name, functools.cache(function))


def is_in_class(level_of_class_stackframe: int) -> bool:
    """Whether the code that decorates a function is a class's body; the level is that of the frame around it, from here."""
    return "__qualname__" in sys._getframe(level_of_class_stackframe - 1).f_locals
