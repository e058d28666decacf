"""In which steps a feature is reported: the lattice through 0 on which its values lie."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray

__all__ = ["quantisation_step"]

SHARE = 0.99
"""So many of the values must lie on the lattice: echoes that something moved afterwards may be off it."""
_MOST_VALUES = 4096
"""So many distinct values, evenly picked, are looked at for candidates; all are for the verdict."""
_GAPS = 6
"""Gaps between neighbours that are tried, the commonest and the smallest, and the smallest values."""
_PARTS = 12
"""A gap may be so many steps."""
_DIGITS = 6


def quantisation_step(values: npt.ArrayLike, tolerance: float = 1e-6) -> float:
    """The largest step of which 99 % of the values are multiples, shape (n,), in the feature's unit.

    `tolerance`: how far a value may lie off its multiple; of ranges 1e-4 m. 0: no step above four tolerances, below
    which nearly everything is a multiple, or none found: some neighbours must lie within 12 steps of each other, as of
    some dozens of ranges in centimetres do. NaN without a value other than 0.
    """
    size, count = np.unique(np.abs(np.asarray(values, dtype=np.float64)), return_counts=True)
    size, count = size[size > tolerance], count[size > tolerance]
    if not size.size:
        return float("nan")
    some = size[:: -(-size.size // _MOST_VALUES)]
    zeros = np.size(values) - int(count.sum())
    for candidate in sorted({_rounded(step) for step in _candidates(some, tolerance)}, reverse=True):
        step = _rounded(_fitted(some, candidate))
        off = np.abs(size - step * np.rint(size / step))
        if step > 4.0 * tolerance and zeros + count[off <= tolerance].sum() >= SHARE * np.size(values):
            return step
    return 0.0


def _candidates(size: FloatArray, tolerance: float) -> Iterator[float]:
    """Steps that the values, ascending, may have: gaps between neighbours and the smallest values, and parts of them.

    A lattice's gaps are multiples of its step, small ones where values are many.
    """
    gap = np.diff(size)
    gap = gap[gap > 2.0 * tolerance]
    _, first, count = np.unique(np.rint(gap / (2.0 * tolerance)), return_index=True, return_counts=True)
    common = first[np.argsort(-count, kind="stable")[:_GAPS]]
    for base in (*gap[common], *gap[first[:_GAPS]], *size[:_GAPS]):
        for parts in range(1, _PARTS + 1):
            if base / parts > 2.0 * tolerance:
                yield float(base / parts)


def _fitted(size: FloatArray, step: float) -> float:
    """The step made as exact as the values tell: from near ones to far ones, whose number of steps it then gives."""
    reach = size - size[0]
    known = 8.0 * step
    while True:
        near = (reach > 0.5 * step) & (reach <= known)
        if near.any():
            step = _middle(reach[near] / np.rint(reach[near] / step))
        if known >= reach[-1]:
            break
        known *= 4.0
    return _middle(size / np.maximum(np.rint(size / step), 1.0))


def _middle(steps: FloatArray) -> float:
    """The median, the upper one of two; values off the lattice do not move it."""
    return float(np.partition(steps, len(steps) // 2)[len(steps) // 2])


def _rounded(step: float) -> float:
    """Without the digits that the values' rounding makes."""
    return float(f"{step:.{_DIGITS}g}")
