"""Fields that a part of a run declares once: the part makes them from that, and memory is counted from it before a run."""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from taichi_rts.device.backend import ti


def vector_field(dim: int, dtype: Any, count: Any) -> ti.MatrixField:
    """A field of `count` vectors as a struct of arrays: one contiguous array a component."""
    return ti.Vector.field(dim, dtype, count, layout=ti.Layout.SOA)


class Declared(NamedTuple):
    """A field of a part.

    Attributes:
        name: of the part's attribute. With a dot, as in "scan.sums", it belongs to a part of the part, which makes it.
        dtype: Taichi's type; `float` stands for the real numbers of a run's precision.
        entries: how many entries it has, or along each axis.
        shape: of one entry: () is a number, (3,) a vector, (3, 3) a matrix.
        apart: whether each component of a vector is an array of its own (struct of arrays).
    """

    name: str
    dtype: Any
    entries: int | tuple[int, ...]
    shape: tuple[int, ...] = ()
    apart: bool = False

    def make(self, real: Any = float) -> Any:
        """Return the field, its real numbers of type `real`."""
        dtype = real if self.dtype is float else self.dtype
        if not self.shape:
            return ti.field(dtype, self.entries)
        if self.apart:
            return vector_field(self.shape[0], dtype, self.entries)
        kind = ti.Vector if len(self.shape) == 1 else ti.Matrix
        return kind.field(*self.shape, dtype, self.entries)

    def size(self, real: int) -> int:
        """Bytes of the field, where a real number takes `real` of them."""
        entries = self.entries if isinstance(self.entries, tuple) else (self.entries,)
        return math.prod((*entries, *self.shape)) * (real if self.dtype is float else 4)


def reals(entries: int | tuple[int, ...], *names: str) -> list[Declared]:
    """Declare fields of real numbers."""
    return [Declared(name, float, entries) for name in names]


def integers(entries: int, *names: str) -> list[Declared]:
    """Declare fields of 32-bit integers."""
    return [Declared(name, ti.i32, entries) for name in names]


def vectors(dim: int, entries: int, *names: str) -> list[Declared]:
    """Declare fields of vectors of `dim` components, each of which is an array of its own."""
    return [Declared(name, float, entries, (dim,), apart=True) for name in names]


def within(part: str, declared: Iterable[Declared]) -> list[Declared]:
    """Return the same as fields of the attribute `part`; those of the `grid`, which all parts share, keep their name."""
    return [each if each.name.startswith("grid.") else each._replace(name=f"{part}.{each.name}") for each in declared]


class Part:
    """A part of a run with fields that it declares."""

    def make_fields(self, declared: Iterable[Declared], real: Any = float) -> None:
        """Make the declared fields that are not those of a part of this one, in order, as attributes."""
        for each in declared:
            if "." not in each.name:
                setattr(self, each.name, each.make(real))

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...
