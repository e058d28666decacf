"""Counts of a bin by sums of binomial terms, for all lanes at once.

As in `binomial`, but for a cell of uniform numbers and not for one: a lane is settled where both ends of the cell, and
what rounding may add to them, lead to the same count. Most bins do with seven digits, which takes half the time of
sixteen.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.long_space import ARMED, FIRED, LANE, Lanes
from lidarcheck.model.exact.short_draws import CELL, MARGIN, WIDE
from lidarcheck.model.lane_math import LN2, exp, expm1, log1m

__all__ = ["BRIGHT", "sum_doubles", "sum_singles"]

_ONE, _TWO, _THREE, _FOUR = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
_TERM, _ODDS, _GROWTH, _LEFT, _COUNT, _MOST = (np.uint64(k * WIDE) for k in range(6))
_SETTLED = -1e300
BRIGHT: Any = np.float32(0.69)
"""Avalanches per armed SPAD, just below ln 2, from which on detectors are counted that do not avalanche."""
_DEEP = np.float32(20.0)
"""Avalanches expected beyond which seven digits do not do."""
_F_MARGIN = np.float32(2e-5)
"""More than rounding to seven digits can move a boundary between two counts."""
_F_SETTLED, _F_CELL = np.float32(-1e30), np.float32(CELL)
_F0, _F1, _F2, _F2ND, _F6TH, _F24TH, _F32ND, _F120TH, _F720TH, _F5040TH, _F40320TH = (
    np.float32(x) for x in (0.0, 1.0, 2.0, 1 / 2, 1 / 6, 1 / 24, 1 / 32, 1 / 120, 1 / 720, 1 / 5040, 1 / 40320)
)


@inlined
def _begin(lanes: Lanes, bin_: Any, draw: Any) -> int:
    """Set up the sums of a bin; in how many lanes most detectors avalanche."""
    state, rates, short, sums = lanes.state, lanes.rates, lanes.short, lanes.sums
    bright = 0
    for lane in range(LANE):
        armed, rate = np.float64(state[ARMED + lane]), np.float64(rates[bin_ + lane])
        bright += 1 if rate >= LN2 and armed > 0.0 else 0
        odds = expm1(rate if rate < 1.0 else 1.0)
        sums[_TERM + lane] = exp(-armed * (rate if rate < LN2 else LN2))
        sums[_ODDS + lane] = odds
        sums[_GROWTH + lane] = odds * (armed + 1.0)
        sums[_LEFT + lane] = np.float64(short[draw + lane]) * CELL - MARGIN
        sums[_COUNT + lane] = 0.0
        sums[_MOST + lane] = 0.0
    return bright


@inlined
def _begin_bright(lanes: Lanes, bin_: Any) -> None:
    """The same where the detectors are counted that do not avalanche."""
    state, rates, sums = lanes.state, lanes.rates, lanes.sums
    for lane in range(LANE):
        armed, rate = np.float64(state[ARMED + lane]), np.float64(rates[bin_ + lane])
        miss = exp(-(rate if rate < 600.0 else 600.0))
        most = rate >= LN2
        odds = miss / (1.0 - miss)
        zero = exp(armed * log1m(miss if most else 0.5))
        sums[_TERM + lane] = zero if most else sums[_TERM + lane]
        odds = odds if most else sums[_ODDS + lane]
        sums[_ODDS + lane] = odds
        sums[_GROWTH + lane] = odds * (armed + 1.0)


@inlined
def _step(lanes: Lanes, inverse: FloatArray, k: Any) -> int:
    """Four terms of the sums, from P(K = k) on; how many lanes have not found their number yet."""
    sums = lanes.sums
    first, second, third, fourth = inverse[k + _ONE], inverse[k + _TWO], inverse[k + _THREE], inverse[k + _FOUR]
    left = 0
    for lane in range(LANE):
        odds, growth = sums[_ODDS + lane], sums[_GROWTH + lane]
        term, least = sums[_TERM + lane], sums[_LEFT + lane]
        most = least + (CELL + 2.0 * MARGIN)
        one = growth * first - odds
        two = one * (growth * second - odds)
        ratio = growth * third - odds
        three = two * ratio
        four = two * (ratio * (growth * fourth - odds))
        up_to_one = term * (1.0 + one)
        up_to_two = up_to_one + term * two
        step = up_to_two + term * three
        above = 1.0 if least >= term else 0.0
        above += 1.0 if least >= up_to_one else 0.0
        above += 1.0 if least >= up_to_two else 0.0
        above += 1.0 if least >= step else 0.0
        beyond = 1.0 if most >= term else 0.0
        beyond += 1.0 if most >= up_to_one else 0.0
        beyond += 1.0 if most >= up_to_two else 0.0
        beyond += 1.0 if most >= step else 0.0
        sums[_COUNT + lane] += above
        sums[_MOST + lane] += beyond
        sums[_LEFT + lane] = least - step if most >= step else _SETTLED
        sums[_TERM + lane] = term * four
        left += 1 if most >= step else 0
    return left


@kernel
def sum_doubles(lanes: Lanes, bin_: Any, draw: Any, inverse: FloatArray, detectors: int) -> Any:
    """The counts of a bin by sums for all lanes; which of them are left open."""
    if _begin(lanes, bin_, draw) > 0:
        _begin_bright(lanes, bin_)
    term, last, left = np.uint64(0), np.uint64(detectors), 1
    while left > 0 and term <= last:
        left = _step(lanes, inverse, term)
        term += _FOUR
    state, rates, sums = lanes.state, lanes.rates, lanes.sums
    open_ = np.uint64(0)
    for lane in range(LANE):
        armed, count, most = state[ARMED + lane], sums[_COUNT + lane], sums[_MOST + lane]
        count = count if count < armed else np.float64(armed)
        most = most if most < armed else np.float64(armed)
        fired = np.float32(armed - count if rates[bin_ + lane] >= LN2 else count)
        fired = fired if count == most else _F0
        state[FIRED + lane] = fired
        state[ARMED + lane] -= fired
        open_ |= np.uint64(0) if count == most else np.uint64(1) << np.uint64(lane)
    return open_


@inlined
def _begin_singles(lanes: Lanes, bin_: Any, draw: Any) -> int:
    """`_begin` with seven digits; in how many lanes these do not do."""
    state, rates, short, sums = lanes.state, lanes.rates, lanes.short, lanes.single_sums
    deep = 0
    for lane in range(LANE):
        armed, rate = state[ARMED + lane], rates[bin_ + lane]
        x = armed * rate
        deep += 1 if (x > _DEEP) | (rate > BRIGHT) else 0
        r = x * _F32ND
        s = r * r
        root = (_F1 - r) + s * ((_F2ND - r * _F6TH) + s * ((_F24TH - r * _F120TH) + s * (_F720TH - r * _F5040TH)))
        root = root + s * s * s * s * _F40320TH
        root = root * root
        root = root * root
        root = root * root
        root = root * root
        s = rate * rate
        odds = rate + s * ((_F2ND + rate * _F6TH) + s * ((_F24TH + rate * _F120TH) + s * (_F720TH + rate * _F5040TH)))
        odds = odds + s * s * s * s * _F40320TH
        sums[_TERM + lane] = root * root
        sums[_ODDS + lane] = odds
        sums[_GROWTH + lane] = odds * (armed + _F1)
        sums[_LEFT + lane] = np.float32(short[draw + lane]) * _F_CELL - _F_MARGIN
        sums[_COUNT + lane] = _F0
        sums[_MOST + lane] = _F0
    return deep


@inlined
def _step_singles(lanes: Lanes, k: Any) -> int:
    """`_step` with seven digits."""
    sums, inverse = lanes.single_sums, lanes.inverse
    first, second, third, fourth = inverse[k + _ONE], inverse[k + _TWO], inverse[k + _THREE], inverse[k + _FOUR]
    left = 0
    for lane in range(LANE):
        odds, growth = sums[_ODDS + lane], sums[_GROWTH + lane]
        term, least = sums[_TERM + lane], sums[_LEFT + lane]
        most = least + (_F_CELL + _F2 * _F_MARGIN)
        one = growth * first - odds
        two = one * (growth * second - odds)
        ratio = growth * third - odds
        three = two * ratio
        four = two * (ratio * (growth * fourth - odds))
        up_to_one = term + term * one
        up_to_two = up_to_one + term * two
        step = up_to_two + term * three
        above = np.float32(least >= term) + np.float32(least >= up_to_one)
        above += np.float32(least >= up_to_two) + np.float32(least >= step)
        beyond = np.float32(most >= term) + np.float32(most >= up_to_one)
        beyond += np.float32(most >= up_to_two) + np.float32(most >= step)
        sums[_COUNT + lane] += above
        sums[_MOST + lane] += beyond
        sums[_LEFT + lane] = least - step if most >= step else _F_SETTLED
        sums[_TERM + lane] = term * four
        left += 1 if most >= step else 0
    return left


@inlined
def sum_singles(lanes: Lanes, bin_: Any, draw: Any, detectors: int) -> Any:
    """`sum_doubles` with seven digits: the lanes left open, and whether the bin is too bright for that."""
    open_ = np.uint64(0)
    if _begin_singles(lanes, bin_, draw) > 0:
        return open_, True
    term, last, left = np.uint64(0), np.uint64(detectors), 1
    while left > 0 and term <= last:
        left = _step_singles(lanes, term)
        term += _FOUR
    state, sums = lanes.state, lanes.single_sums
    for lane in range(LANE):
        armed, count, most = state[ARMED + lane], sums[_COUNT + lane], sums[_MOST + lane]
        count = count if count < armed else armed
        most = most if most < armed else armed
        fired = count if count == most else _F0
        state[FIRED + lane] = fired
        state[ARMED + lane] -= fired
        open_ |= np.uint64(0) if count == most else np.uint64(1) << np.uint64(lane)
    return open_, False
