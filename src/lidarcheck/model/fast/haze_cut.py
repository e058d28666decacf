"""The haze that a beam sees up to where it ends, bin by bin: a little coarser than `add_haze` of the exact chain."""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import inlined
from lidarcheck.model.exact.haze_rates import HazeRates, add_haze
from lidarcheck.model.exact.pulse_form import PHASES
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.lane_math import whole_below

__all__ = ["put_haze"]

_LONGEST = 0.5
"""Bins up to which the light of a cell may stand in its middle."""


@inlined
def _add_part(weight: float, source: FloatArray, at: int, low: int, high: int, origin: int, rates: FloatArray) -> None:
    """Add `weight` times a row that begins in bin `at` to the bins `low` ... `high - 1` of rates from `origin` on."""
    # An unsigned index cannot count from the array's end, which saves the test for it.
    column, bin_ = np.uint64(low - at), np.uint64(low - origin)
    for k in range(np.uint64(max(high - low, 0))):
        rates[bin_ + k] += weight * source[column + k]


@inlined
def _cell(haze: HazeRates, row: Any) -> Any:
    """The cell that a row of the haze ends in; none of the profile's where it does not end there."""
    return int(min(haze.end[row] / haze.step, 1e9))


@inlined
def put_haze(pulses: Pulses, per_bin: float, i: Any, begin: int, end: int, rates: FloatArray) -> None:
    """Put background and a beam's haze into `rates`; see `add_haze`."""
    haze = pulses.haze
    for k in range(np.uint64(end - begin)):
        rates[k] = per_bin
    row, rows_end = haze.first[i], haze.first[i + np.uint64(1)]
    if haze.stride > 1 or haze.step > _LONGEST:
        add_haze(haze, i, begin, end, rates)
        row = rows_end
    while row < rows_end:
        cell = _cell(haze, row)
        start, share, light, moment = cell * haze.step, 0.0, 0.0, 0.0
        # Rows that end in one cell are one.
        while row < rows_end and (cell >= len(haze.density) or _cell(haze, row) == cell):
            part = haze.share[row] * (haze.end[row] - start)
            share, light, moment = share + haze.share[row], light + part, moment + part * (haze.end[row] + start)
            row += 1
        if cell >= len(haze.density):
            _add_part(share, haze.whole, 0, begin, max(min(end, haze.last), begin), begin, rates)
        else:
            first = whole_below(start) - haze.before - 1
            low = max(min(first, end), begin)
            high = max(min(first + haze.cut.shape[1], end), low)
            _add_part(share, haze.whole, 0, begin, low, begin, rates)
            _add_part(share, haze.cut[cell], first, low, high, begin, rates)
            # What a row has of its last cell is a pulse's light in the middle.
            if light > 0.0:
                centre = 0.5 * moment / light
                middle = whole_below(centre)
                shares = pulses.shares[int((centre - middle) * PHASES)]
                at = middle - pulses.middle
                low, high = max(at, begin), min(at + len(shares), end)
                _add_part(light * haze.density[cell], shares, at, low, high, begin, rates)
