"""How elementary functions go through arrays, and what several of them need."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = ["compiled_for", "in_blocks", "in_blocks_or_compiled", "series", "sum_rest"]

_COMPILED = "lidarcheck.elementary.compiled"
_BLOCK = 8192
"""Elements that are worked on at a time: what stands between them then stays in the processor's cache."""
_LARGE = 16384
"""Elements from which on compiled code is worth being fetched."""


def compiled_for(size: int) -> ModuleType | None:
    """The compiled functions, for so many elements; None where these are too few, or the compiler's package is not
    loaded yet: a process that simulates nothing need not wait for it."""
    return import_module(_COMPILED) if size >= _LARGE and "numba" in sys.modules else None


def in_blocks(function: Callable[..., FloatArray], *, compiled: bool = False) -> Callable[..., Any]:
    """A function of float64 arrays of one shape, made one of numbers and of arrays that are broadcast together.

    `compiled`: it also stands in `compiled.py`, to the same bits.
    """

    @wraps(function)
    def whole(*arguments: Any) -> Any:
        columns = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in arguments))
        shape, flat = columns[0].shape, [np.ravel(c) for c in columns]
        found = np.empty(flat[0].size)
        kernels = compiled_for(found.size) if compiled else None
        if kernels is not None:
            getattr(kernels, function.__name__)(*map(np.ascontiguousarray, flat), found)
            return found.reshape(shape)
        with np.errstate(invalid="ignore", over="ignore", under="ignore", divide="ignore"):
            for start in range(0, found.size, _BLOCK):
                part = slice(start, start + _BLOCK)
                found[part] = function(*(c[part] for c in flat))
        return found.reshape(shape) if shape else found[0]

    return whole


def in_blocks_or_compiled(function: Callable[..., FloatArray]) -> Callable[..., Any]:
    """`in_blocks` of a function that is `compiled`."""
    return in_blocks(function, compiled=True)


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
