"""The bright front of the haze, the same for most beams: avalanche counts read off a table.

In such a bin, a beam's count depends on how many detectors are armed and on one uniform number. The table knows the
count wherever a whole 128th of the uniform numbers leads to the same one, which is the case nine times in ten; else
it is worked out as everywhere. The counts are the same with the table and without, down to the last bit.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.binomial import binomial, inverses
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_math import fired

__all__ = ["Front", "front_of", "look_up"]

_CELLS = 128
_UNKNOWN = 255
_BRIGHT = 0.25
"""Avalanches of all detectors in a bin from which on the table holds it."""
_MOST_BINS = 256
_MOST_DETECTORS = 800
"""Up to here `binomial` sums from one end, and its result never turns back as the uniform number grows."""
_WORTH_BEAMS = 20_000
"""Beams from which on the table saves more time than it takes."""


class Front(NamedTuple):
    """Counts of the bins `begin` ... `begin + len(rates) - 1` where their rate is exactly the one in `rates`.

    `counts[k, a - least[k], u]`: avalanches among `a` armed detectors for a uniform number in [u, u + 1) / 128.
    """

    begin: int
    rates: FloatArray
    least: npt.NDArray[np.int64]
    counts: npt.NDArray[np.uint8]


def front_of(numbers: Numbers, begin: int, rates: FloatArray, beams: int) -> Front:
    """The front of beams with these rates, (bins,), whose haze begins in bin `begin`; empty where it does not pay."""
    bright = np.flatnonzero(rates[begin:] * numbers.detectors > _BRIGHT)
    bins = min(int(bright[-1]) + 1, _MOST_BINS) if len(bright) else 0
    if beams < _WORTH_BEAMS or numbers.detectors > _MOST_DETECTORS:
        bins = 0
    return _front(numbers, begin, rates[begin : begin + bins].tobytes())


@functools.lru_cache(maxsize=4)
def _front(numbers: Numbers, begin: int, of_bins: bytes) -> Front:
    """The front whose `rates` have these bytes; kept, since the same air stands in many frames."""
    rates = np.frombuffer(of_bins).copy()
    armed = numbers.detectors * _armed(rates, numbers.dead)
    reach = np.ceil(5.0 * np.sqrt(armed * (1.0 - armed / numbers.detectors))).astype(np.int64) + 2
    least = np.maximum(armed.astype(np.int64) - reach, 0)
    rows = int((2 * reach + 2).max(initial=0))
    counts = np.empty((len(rates), rows, _CELLS), dtype=np.uint8)
    if len(rates):  # or a light without haze would wait for the kernel to be compiled
        _tabulate(numbers.detectors, rates, least, inverses(numbers.detectors), counts)
    return Front(begin, rates, least, counts)


def _armed(rates: FloatArray, dead: int) -> FloatArray:
    """The chance that a detector is armed in each bin, all being armed before the first; shape (bins,)."""
    avalanche, armed = np.zeros(len(rates)), np.ones(len(rates))
    for k in range(len(rates)):
        armed[k] = 1.0 - avalanche[max(k - dead + 1, 0) : k].sum()
        avalanche[k] = armed[k] * fired(rates[k])
    return armed


@kernel
def _tabulate(
    detectors: int,
    rates: FloatArray,
    least: npt.NDArray[np.int64],
    inverse: FloatArray,
    counts: npt.NDArray[np.uint8],
) -> None:
    """Fill `counts`: a quantile never turns back, so it is constant between two equal ones."""
    for k in range(counts.shape[0]):
        for row in range(counts.shape[1]):
            armed = min(least[k] + row, detectors)
            low = binomial(0.0, armed, rates[k], inverse)
            for cell in range(counts.shape[2]):
                # The last uniform number of a cell: the largest below the next cell's first.
                high = binomial((cell + 1.0) / _CELLS - 1.1e-16, armed, rates[k], inverse)
                counts[k, row, cell] = high if low == high and high < _UNKNOWN else _UNKNOWN
                low = high


@inlined
def look_up(front: Front, bin_: Any, armed: int, rate: float, uniform: float) -> int:
    """The count as `binomial` works it out, -1 where the table does not know it."""
    # Below zero, an unsigned index is beyond the end.
    k = np.uint64(bin_ - front.begin)
    if k < np.uint64(len(front.rates)) and front.rates[k] == rate:
        row = np.uint64(armed - front.least[k])
        if row < np.uint64(front.counts.shape[1]):
            fired = front.counts[k, row, np.uint64(uniform * _CELLS)]
            if fired != _UNKNOWN:
                return int(fired)
    return -1
