"""How elementary functions go through arrays, and what several of them need."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = ["in_blocks", "series", "sum_rest"]

_BLOCK = 8192
"""Elements that are worked on at a time: what stands between them then stays in the processor's cache."""


def in_blocks(function: Callable[..., FloatArray]) -> Callable[..., Any]:
    """A function of float64 arrays of one shape, made one of numbers and of arrays that are broadcast together."""

    @wraps(function)
    def whole(*arguments: Any) -> Any:
        columns = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in arguments))
        shape, flat = columns[0].shape, [np.ravel(c) for c in columns]
        found = np.empty(flat[0].size)
        with np.errstate(invalid="ignore", over="ignore", under="ignore", divide="ignore"):
            for start in range(0, found.size, _BLOCK):
                part = slice(start, start + _BLOCK)
                found[part] = function(*(c[part] for c in flat))
        return found.reshape(shape) if shape else found[0]

    return whole


def series(x: FloatArray, coefficients: tuple[float, ...]) -> FloatArray:
    """The sum of coefficient k times x^k, the highest first."""
    found = np.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        found = found * x + coefficient
    return found


def sum_rest(a: FloatArray, b: FloatArray, total: FloatArray) -> FloatArray:
    """What rounding left of a + b = total."""
    part = total - a
    return (a - (total - part)) + (b - part)
