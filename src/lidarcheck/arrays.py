"""The types of numpy arrays that the package's signatures name, and how a table's columns are frozen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import UsageError

__all__ = [
    "BoolArray",
    "FloatArray",
    "IndexArray",
    "IntArray",
    "ShortArray",
    "SingleArray",
    "WordArray",
    "freeze",
    "freeze_extra",
]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]
"""Indices, counts and keys: 64 bits."""
IntArray = npt.NDArray[np.int32]
"""Layers, points, materials and objects: 32 bits."""
ShortArray = npt.NDArray[np.int16]
SingleArray = npt.NDArray[np.float32]
BoolArray = npt.NDArray[np.bool_]
WordArray = npt.NDArray[np.uint64]


def freeze(table: Any, dtypes: Mapping[str, Any], length: int) -> None:
    """Cast the named columns, check their length and make them read-only."""
    for name, dtype in dtypes.items():
        value = getattr(table, name)
        if value is None:
            continue
        column = np.ascontiguousarray(value, dtype=dtype)
        if np.issubdtype(dtype, np.integer) and np.asarray(value).dtype.kind == "f" and np.any(column != value):
            raise UsageError(
                f"column {name} holds a number that is not whole", fix="round it yourself, if that is meant"
            )
        if column.shape != (length,):
            raise UsageError(f"column {name} has shape {column.shape}, the table has {length} rows")
        if column is value and column.flags.writeable:
            column = column.view()
        column.flags.writeable = False
        object.__setattr__(table, name, column)


def freeze_extra(table: Any, length: int, field: str = "extra") -> None:
    """The same for the columns in a mapping, whatever their types."""
    frozen = {}
    for name, value in getattr(table, field).items():
        column = np.asarray(value).view()
        if column.shape != (length,):
            raise UsageError(f"column {name} has shape {column.shape}, the table has {length} rows")
        column.flags.writeable = False
        frozen[name] = column
    object.__setattr__(table, field, frozen)
