"""The numbers of echoes as they are written: in which order a beam's echoes are counted, and how often each occurs."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.sensor import Sensor

__all__ = ["beams_in_order", "number_counts", "number_share", "with_copies"]

MOST = 255
"""The largest number that an echo may have."""


def beams_in_order(
    beam: npt.NDArray[Any],
    number: npt.NDArray[Any],
    range_m: FloatArray,
    strength: FloatArray | None = None,
    sensor: Sensor | None = None,
) -> BoolArray:
    """Of each beam with two echoes or more, in ascending order: whether its numbers are as the sensor orders echoes.

    Echoes (n,) each, in any order; `beam`: a number for each. Numbers ascend with range, or, where the `sensor` writes
    echoes as it keeps them, as its `keep` names them: by falling `strength`, from the farthest on, or of a pair the
    first named first. No order have two echoes of one number. Of two echoes alike either may come first.
    """
    by_number = np.lexsort((range_m, number, beam))
    key, in_order, range_m = beam[by_number], number[by_number], range_m[by_number]
    same = key[1:] == key[:-1]
    farther, nearer = range_m[1:] > range_m[:-1], range_m[1:] < range_m[:-1]
    keep = sensor.keep if sensor is not None and sensor.return_order == "as_kept" else "first"
    misplaced = farther if keep == "last" else nearer
    if keep.startswith("strongest"):
        stronger = np.zeros(len(farther), dtype=np.bool_)
        if strength is not None:
            stronger = strength[by_number][1:] > strength[by_number][:-1]
        # Where the strongest is the last itself, the second strongest stands behind it, nearer.
        misplaced = stronger & nearer if keep == "strongest_last" else stronger
    wrong = same & ((in_order[1:] == in_order[:-1]) | misplaced)
    several, index = np.unique(key[1:][same], return_inverse=True)
    return np.asarray(np.bincount(index, weights=wrong[same], minlength=len(several)) == 0.0)


def with_copies(beam: npt.NDArray[Any], number: npt.NDArray[Any]) -> tuple[IndexArray, npt.NDArray[Any]]:
    """The numbers of a sensor that writes the only echo of a beam twice, its copy as number 2: echo of each, number.

    `beam`, `number`: of the echoes (n,), without copies; the result has (n + copies,).
    """
    _, first, count = np.unique(beam, return_index=True, return_counts=True)
    alone = first[count == 1]
    rows = np.concatenate([np.arange(len(beam)), alone])
    return rows, np.concatenate([number, np.full(len(alone), 2, dtype=number.dtype)])


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
