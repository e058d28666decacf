"""Percentiles of a feature, and how far chance may have moved them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

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
    """Of a sample, shape (n,), linear between its values; `level` in %. NaN where it is empty."""
    sample = np.asarray(values, dtype=np.float64)
    return float(np.percentile(sample, level)) if sample.size else float("nan")


def percentiles(values: npt.ArrayLike) -> dict[int, Percentile]:
    """The percentiles of `LEVELS` of a sample, shape (n,), each with its interval.

    The interval goes from one value of the sample to another, by the number of values below a quantile, which is
    binomial whatever the distribution (Conover, *Practical Nonparametric Statistics*, 1999, section 3.2).
    """
    sample = ordered(values)
    return {level: Percentile(percentile(sample, level), *_interval(sample, level)) for level in LEVELS}


def _interval(sample: npt.NDArray[np.float64], level: int) -> tuple[float, float]:
    n, p = sample.size, level / 100.0
    half = _Z * np.sqrt(n * p * (1.0 - p))
    low, high = (int(np.ceil(rank)) for rank in (n * p - half, n * p + half))
    return (
        float(sample[low - 1]) if low >= 1 else float("nan"),
        float(sample[high - 1]) if 1 <= high <= n else float("nan"),
    )
