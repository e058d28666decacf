"""Avalanche counts from draws of 16 bits, four to a word: those of beams whose haze or background fills many bins.

The uniform number behind a count is (s + e) / 2^16: s are the 16 bits, and e is a uniform number of its own, which is
drawn only where it matters: where a boundary between two counts lies in the cell of s, [s, s + 1) / 2^16, as for a few
of ten thousand draws. Counts are thus those of `binomial` for a number of all digits.

Draws are laid out by bin: a word holds those of four bins, the lowest bits first, a block those of 16.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.abreast import MOST_DETECTORS, RESERVE
from lidarcheck.model.exact.binomial import binomial
from lidarcheck.model.lane_math import LANES, LN2, exp, expm1
from lidarcheck.model.streams import Stream, philox, philox_round, unit

__all__ = ["BINS", "CELL", "FIRST_BLOCK", "MARGIN", "WIDE", "count_of", "fill_short", "fill_words"]

BINS = 16
"""Bins whose draws a block of four words holds."""
FIRST_BLOCK = RESERVE // 4
CELL = 1.0 / 65536.0
MARGIN = 1e-9
"""More than rounding can move a boundary between two counts."""
WIDE = 2 * LANES
"""Beams side by side: twice as many as elsewhere, since here each bin waits longer for the one before."""
_OF_E = 1
"""The counter's last word of the numbers e."""
_SAFE_EXPONENT = 600.0
_W0, _W1 = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)
_ROUNDS = 10
_SHORT = np.uint64(0xFFFF)
_LANES: Any = np.uint64(WIDE)
_X0, _X1, _X2, _X3 = (np.uint64(word * WIDE) for word in range(4))


@kernel
def fill_words(stream: Stream, beams: npt.NDArray[np.uint64], block: Any, words: npt.NDArray[np.uint64]) -> None:
    """The four words of a block for each of `WIDE` beams; word w of lane i at w * WIDE + i."""
    frame = stream.counter[2]
    for lane in range(_LANES):
        words[_X0 + lane], words[_X1 + lane] = block, beams[lane]
        words[_X2 + lane], words[_X3 + lane] = frame, np.uint64(0)
    k0, k1 = stream.key[0], stream.key[1]
    for _ in range(_ROUNDS // 2):
        for lane in range(_LANES):
            x = words[_X0 + lane], words[_X1 + lane], words[_X2 + lane], words[_X3 + lane]
            x = philox_round(x[0], x[1], x[2], x[3], k0, k1)
            x = philox_round(x[0], x[1], x[2], x[3], k0 + _W0, k1 + _W1)
            words[_X0 + lane], words[_X1 + lane], words[_X2 + lane], words[_X3 + lane] = x
        k0 += _W0 + _W0
        k1 += _W1 + _W1


@inlined
def fill_short(stream: Stream, block: Any, short: npt.NDArray[np.uint16]) -> None:
    """The 16 draws of the current beam's block, to the front of `short`."""
    counter, key = stream.counter, stream.key
    words = philox(key[0], key[1], block, counter[1], counter[2], counter[3])
    for part in range(4):
        shift = np.uint64(16 * part)
        short[part] = (words[0] >> shift) & _SHORT
        short[4 + part] = (words[1] >> shift) & _SHORT
        short[8 + part] = (words[2] >> shift) & _SHORT
        short[12 + part] = (words[3] >> shift) & _SHORT


@kernel
def _quantile(uniform: float, armed: int, rate: float, inverse: FloatArray) -> int:
    """`binomial`, compiled once for all that call it here."""
    return binomial(uniform, armed, rate, inverse)


@kernel
def count_of(
    stream: Stream, beam: Any, bin_: Any, short: Any, armed: Any, rate: float, detectors: int, inverse: FloatArray
) -> Any:
    """Avalanches of `armed` detectors in a bin."""
    if armed <= 0 or rate <= 0.0:
        return 0
    low = np.float64(np.int64(short)) * CELL
    high = low + CELL + MARGIN
    low -= MARGIN
    if rate < LN2 and armed * rate < _SAFE_EXPONENT:
        # exp(-x) >= 1 - x: most quiet bins are settled without an exponential.
        if high <= 1.0 - armed * rate:
            return 0
        term = exp(-armed * rate)
        if high <= term:
            return 0
        odds = expm1(rate)
        growth = odds * (armed + 1.0)
        up_to, k, last = term, np.uint64(0), np.uint64(armed)
        while up_to <= low and k < last:
            k += np.uint64(1)
            term *= growth * inverse[k] - odds
            up_to += term
        if up_to >= high or k == last:
            return np.int64(k)
    elif detectors <= MOST_DETECTORS and low > 0.0 and high < 1.0:
        # Its result does not turn back as the uniform number grows.
        least = _quantile(low, armed, rate, inverse)
        if least == _quantile(high, armed, rate, inverse):
            return least
    key = stream.key
    first, _, _, _ = philox(key[0], key[1], np.uint64(bin_), beam, stream.counter[2], _OF_E)
    return _quantile((np.float64(np.int64(short)) + unit(first)) * CELL, armed, rate, inverse)
