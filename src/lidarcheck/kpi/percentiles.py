"""Percentiles of a feature, and how far chance may have moved them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.kpi.distances import ordered

__all__ = ["LEVELS", "Percentile", "percentile", "percentiles"]

LEVELS = (5, 50, 95)
"""The percentiles that are reported [%]."""
_Z = 1.959963984540054
"""Normal quantile of a two-sided 95 %."""


class Percentile(NamedTuple):
    """A percentile of a sample, and its 95 % interval; all in the feature's unit.

    NaN: an empty sample; of the interval also a sample too small to hold it.
    """

    value: float
    low: float
    high: float


def percentile(values: npt.ArrayLike, level: float) -> float:
    """Of a sample, shape (n,), where its mid-distribution function reaches `level` in %. NaN where it is empty.

    Half of the values that are equal count as below (Ma, Genton and Parzen, 2011): between two steps of a feature that
    comes in steps, so that it moves with the feature and does not wait for the next step. Linear between the values,
    and Hazen's percentile where all differ.
    """
    sample = ordered(values)
    return _at(sample, level / 100.0) if sample.size else float("nan")


def percentiles(values: npt.ArrayLike) -> dict[int, Percentile]:
    """The percentiles of `LEVELS` of a sample, shape (n,), each with its interval.

    The interval goes from the percentile of one level to that of another, by the share of values below a quantile,
    which is binomial whatever the distribution (Conover, *Practical Nonparametric Statistics*, 1999, section 3.2).
    """
    sample = ordered(values)
    return {level: Percentile(percentile(sample, level), *_interval(sample, level / 100.0)) for level in LEVELS}


def _interval(sample: FloatArray, share: float) -> tuple[float, float]:
    half = _Z * float(np.sqrt(share * (1.0 - share) / max(sample.size, 1)))
    if not sample.size or not 0.0 < share - half < share + half < 1.0:
        return float("nan"), float("nan")
    return _at(sample, share - half), _at(sample, share + half)


def _at(sample: FloatArray, share: float) -> float:
    """Where the mid-distribution function of an ascending sample reaches the share."""
    n = sample.size
    value, middle = _block(sample, min(int(share * n), n - 1))
    first, last = _ends(sample, value)
    beside = last if middle <= share else first - 1
    if not 0 <= beside < n:
        return value
    other, its_middle = _block(sample, beside)
    return value + (other - value) * (share - middle) / (its_middle - middle)


def _ends(sample: FloatArray, value: float) -> tuple[int, int]:
    return int(np.searchsorted(sample, value, "left")), int(np.searchsorted(sample, value, "right"))


def _block(sample: FloatArray, row: int) -> tuple[float, float]:
    """The value in that row, and the share of values below the middle of those that equal it."""
    value = float(sample[row])
    first, last = _ends(sample, value)
    return value, 0.5 * (first + last) / sample.size
