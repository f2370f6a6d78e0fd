"""Scalar device arrays that outlive a restart of Taichi without harm."""

from typing import Any

from taichi_rts.device.backend import ti

_impl = ti.lang.impl  # None while the interpreter ends


class Buffer(ti.ScalarNdarray):
    """A `ti.ndarray` of scalars that is freed only in the runtime it was made in.

    Taichi 1.7.4 finds the array to free by its address. One of before a `ti.init` that Python collects after it
    therefore frees whatever array the new runtime has put at that address, whose next use in a kernel fails with
    "argument not found".
    """

    def __init__(self, dtype: Any, count: int) -> None:
        super().__init__(dtype, (count,))
        self._runtime = _impl.get_runtime()

    def __del__(self) -> None:
        if _impl is not None and getattr(self, "_runtime", None) is _impl.get_runtime():
            super().__del__()
