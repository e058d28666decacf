"""The numbers of echoes as they are written: in which order a beam's echoes are counted, and how often each occurs."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray

__all__ = ["beams_in_order", "number_counts", "number_share"]

MOST = 255
"""The largest number that an echo may have."""


def beams_in_order(beam: npt.NDArray[Any], number: npt.NDArray[Any], range_m: FloatArray) -> BoolArray:
    """Of each beam with two echoes or more, in ascending order: whether its numbers ascend with range.

    Echoes (n,) each, in any order; `beam`: a number for each. No order have two echoes of one number. Of two echoes at
    one range either may come first.
    """
    by_number = np.lexsort((range_m, number, beam))
    key, in_order, range_m = beam[by_number], number[by_number], range_m[by_number]
    same = key[1:] == key[:-1]
    wrong = same & ((in_order[1:] == in_order[:-1]) | (range_m[1:] < range_m[:-1]))
    several, index = np.unique(key[1:][same], return_inverse=True)
    return np.asarray(np.bincount(index, weights=wrong[same], minlength=len(several)) == 0.0)


def number_counts(number: npt.NDArray[Any]) -> IndexArray:
    """How many echoes have the numbers 0, 1, ... up to the largest there is, shape (k,), of numbers of shape (n,).

    What no echo can be numbered, below 0, above 255 or not a whole number, is not counted.
    """
    if number.dtype.kind not in "iub":
        number = number[(number >= 0) & (number <= MOST) & (number == np.floor(number))].astype(np.int64)
    elif len(number) and (number.min() < 0 or number.max() > MOST):
        number = number[(number >= 0) & (number <= MOST)]
    return np.bincount(number)


def number_share(number: npt.NDArray[Any], which: int) -> float:
    """Echoes of that number / all echoes, shape (n,); NaN without an echo."""
    return float(np.mean(number == which)) if len(number) else float("nan")
