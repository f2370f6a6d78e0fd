"""Types of the fields that hold particles."""

from typing import Any

from taichi_rts.device.backend import ti

Values: Any = ti.types.ndarray(ndim=1)
Rows: Any = ti.types.ndarray(ndim=2)


def components(field: ti.MatrixField) -> list[ti.Field]:
    """The scalar fields that a field of vectors is made of."""
    return [field.get_scalar_field(d) for d in range(field.n)]


def batches(fields: list[ti.Field], most: int) -> list[list[ti.Field]]:
    """Fields in order, at most `most` at a time."""
    return [fields[first : first + most] for first in range(0, len(fields), most)]
