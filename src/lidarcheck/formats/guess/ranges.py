"""The step that reported ranges are multiples of."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.assign.columns import circular_median

__all__ = ["range_step_m"]

_STEPS_M = tuple(k * 10.0**e for e in (-1, -2, -3) for k in (5.0, 4.0, 2.5, 2.0, 1.0, 0.8, 0.7, 0.6))
"""What sensors report in, the coarsest first: 4 mm, 2 mm, 8 mm among them."""
_ON_STEP, _NEAR, _BLUR = 0.99, 0.05, 0.1
_FEWEST = 200
_LOOKED_AT = 20_000
_FLOAT32 = 2.0**-23


def range_step_m(range_m: FloatArray, error_m: float = 0.0) -> float | None:
    """The coarsest step of which the ranges, shape (n,) [m], are multiples, but for one offset of all; None for none.

    `error_m`: how far rounding may have moved a range.
    """
    values = range_m[:: max(1, len(range_m) // _LOOKED_AT)]
    if len(np.unique(np.round(values, 6))) < _FEWEST:
        return None
    for step in _STEPS_M:
        blur = (2.0 * _FLOAT32 * values + error_m) / step
        if float(np.median(blur)) > _BLUR:
            return None
        off = values / step
        off = off - circular_median(off, 1.0)
        if float(np.mean(np.abs(off - np.rint(off)) <= _NEAR + blur)) >= _ON_STEP:
            return step
    return None
