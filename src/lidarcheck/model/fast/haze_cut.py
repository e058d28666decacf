"""The haze that a beam sees up to where it ends, bin by bin: what `add_haze` of the exact chain gives, for one row."""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import inlined
from lidarcheck.model.exact.haze_rates import add_haze
from lidarcheck.model.exact.pulse_form import PHASES
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.lane_math import whole_below

__all__ = ["put_haze"]


@inlined
def _put_part(
    per_bin: float, weight: float, source: FloatArray, at: int, low: int, high: int, origin: int, rates: FloatArray
) -> None:
    """Put background and `weight` times a row that begins in bin `at` into the bins `low` ... `high - 1`; rates begin
    with bin `origin`."""
    # An unsigned index cannot count from the array's end, which saves the test for it.
    column, bin_ = np.uint64(low - at), np.uint64(low - origin)
    for k in range(np.uint64(max(high - low, 0))):
        rates[bin_ + k] = per_bin + weight * source[column + k]


@inlined
def put_haze(pulses: Pulses, per_bin: float, i: Any, begin: int, end: int, rates: FloatArray) -> None:
    """Put background and the haze of a beam that has one row into `rates`; see `add_haze`."""
    haze = pulses.haze
    row = haze.first[i]
    share, at = haze.share[row], haze.end[row]
    cell = int(min(at / haze.step, 1e9))
    if cell >= len(haze.density):
        last = max(min(end, haze.last), begin)
        _put_part(per_bin, share, haze.whole, 0, begin, last, begin, rates)
        _put_part(per_bin, 0.0, haze.whole, 0, last, end, begin, rates)
    elif haze.stride > 1:
        _put_part(per_bin, 0.0, haze.whole, 0, begin, end, begin, rates)
        add_haze(haze, i, begin, end, rates)
    else:
        start = cell * haze.step
        first = whole_below(start) - haze.before - 1
        low = max(min(first, end), begin)
        high = max(min(first + haze.cut.shape[1], end), low)
        _put_part(per_bin, share, haze.whole, 0, begin, low, begin, rates)
        _put_part(per_bin, share, haze.cut[cell], first, low, high, begin, rates)
        _put_part(per_bin, 0.0, haze.whole, 0, high, end, begin, rates)
        # The cell that the row ends in is a third of a bin at most: its light is a pulse's in the middle.
        light, centre = share * haze.density[cell] * (at - start), 0.5 * (start + at)
        middle = whole_below(centre)
        shares = pulses.shares[int((centre - middle) * PHASES)]
        low = max(middle - pulses.middle, begin)
        column, bin_ = np.uint64(low - middle + pulses.middle), np.uint64(low - begin)
        for k in range(np.uint64(max(min(middle - pulses.middle + len(shares), end) - low, 0))):
            rates[bin_ + k] += light * shares[column + k]
