"""The sums of `binomial` for `LANES` beams at once, in single precision, where that settles the number.

Single precision does twice as many beams at a time, and needs shorter series. It is right to about 1e-5 of a
probability: a uniform number that is closer than `_CLOSE` to a step of the distribution function is left to `binomial`,
so that each number is the one that it finds, to the last bit. All terms are held times 2^96, which keeps P(K = 0) of
bright bins away from underflow.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, ShortArray, SingleArray
from lidarcheck.elementary.compiled import bits_of_single, single_from_bits
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.lane_math import LANES, LN2
from lidarcheck.model.rows import reaching_row

__all__ = ["ROWS", "settle"]

_single = np.float32
_LANES: Any = np.uint64(LANES)
_NEXT, _SECOND, _THIRD, _FOURTH = (np.uint64(k) for k in range(1, 5))
_ALL = np.uint64((1 << LANES) - 1)
_TERM, _ODDS, _GROWTH, _LEFT, _NEAREST, _FOUND = (np.uint64(k * LANES) for k in range(6))
ROWS = 6
"""Rows of work space."""
_ZERO, _ONE, _TWO = _single(0.0), _single(1.0), _single(2.0)
_SCALE_BITS = np.int32(96)
_SCALE, _GONE = _single(2.0**96), _single(-(2.0**97))
_CLOSE = _single(2.0**96 * 1e-4)
"""Ten times what rounding may move a step by, for up to 800 detectors."""
_MOST = _single(150.0)
"""exp(-150) 2^96 is far from underflow in single precision; brighter bins are left to `binomial`."""
_MOST_RATE = _single(80.0)
_BRIGHT, _NEAR_BRIGHT = _single(LN2), _single(1e-5)
_ROUNDER, _PER_LN2 = _single(12582912.0), _single(1.0 / LN2)
_LN2_HIGH = _single(0.693359375)
_LN2_LOW = _single(LN2 - 0.693359375)
_EXPONENT_OF_ONE, _FRACTION_BITS, _NO_BITS = np.int32(127), np.int32(23), np.int32(0)
_F2, _F3, _F4, _F5, _F6, _F7, _F8 = (_single(1.0 / math.factorial(k)) for k in range(2, 9))
_I3, _I5, _I7, _I9, _I11, _I13 = (_single(1.0 / k) for k in range(3, 15, 2))


@inlined
def _exp(x: Any, scale_bits: Any) -> Any:
    """exp(x) times a power of two, for x from -150 to 1."""
    shifted = x * _PER_LN2 + _ROUNDER
    whole = shifted - _ROUNDER
    r = (x - whole * _LN2_HIGH) - whole * _LN2_LOW
    s = r * r
    series = ((_ONE + r) + s * (_F2 + r * _F3)) + (s * s) * ((_F4 + r * _F5) + s * _F6)
    return series * single_from_bits((bits_of_single(shifted) + _EXPONENT_OF_ONE + scale_bits) << _FRACTION_BITS)


@inlined
def _expm1(x: Any) -> Any:
    """exp(x) - 1 for x from 0 to ln 2."""
    s = x * x
    q = s * s
    return x + (s * ((_F2 + x * _F3) + s * (_F4 + x * _F5)) + (q * s) * ((_F6 + x * _F7) + s * _F8))


@inlined
def _log_all(miss: Any) -> Any:
    """-log(1 - miss) for a chance from 0 to 1/2, as an inverse hyperbolic tangent's series."""
    t = miss / (_TWO - miss)
    z = t * t
    y = z * z
    return _TWO * t * ((_ONE + z * _I3) + y * ((_I5 + z * _I7) + y * ((_I9 + z * _I11) + y * _I13)))


@inlined
def _put(sums: SingleArray, lane: Any, armed: Any, uniform: Any, odds: Any, exponent: Any, fine: Any) -> None:
    """Set up the sum of a lane; one that has found its number is left with less than any term, and far from all."""
    zero = _exp(-exponent, _SCALE_BITS)
    nearest = abs(uniform - zero)
    sums[_TERM + lane] = zero
    sums[_ODDS + lane] = odds
    sums[_GROWTH + lane] = odds * (armed + _ONE)
    sums[_LEFT + lane] = uniform if fine and uniform >= zero else _GONE
    sums[_NEAREST + lane] = nearest if fine else _ZERO
    sums[_FOUND + lane] = _ZERO


@inlined
def _begin(
    rates: FloatArray, rate_row: Any, draws: FloatArray, draw_row: Any, lanes: ShortArray, sums: SingleArray
) -> None:
    """Set up the sums of a bin where the avalanches are counted."""
    for lane in range(_LANES):
        armed, rate = _single(lanes[lane]), _single(rates[rate_row + lane])
        uniform = _single(draws[draw_row + lane]) * _SCALE
        fine = armed * rate < _MOST
        rate = rate if fine else _ZERO
        _put(sums, lane, armed, uniform, _expm1(rate), armed * rate, fine)


@inlined
def _begin_bright(
    rates: FloatArray, rate_row: Any, draws: FloatArray, draw_row: Any, lanes: ShortArray, sums: SingleArray
) -> None:
    """The same where, in some lanes, the detectors are counted that do not avalanche."""
    for lane in range(_LANES):
        armed, rate = _single(lanes[lane]), _single(rates[rate_row + lane])
        uniform = _single(draws[draw_row + lane]) * _SCALE
        bright = rate >= _BRIGHT
        miss = _exp(-(rate if rate < _MOST_RATE else _MOST_RATE), _NO_BITS) if bright else _ZERO
        exponent = armed * (_log_all(miss) if bright else rate)
        fine = exponent < _MOST and abs(rate - _BRIGHT) > _NEAR_BRIGHT
        odds = miss / (_ONE - miss) if bright else _expm1(rate)
        _put(sums, lane, armed, uniform, odds, exponent if fine else _ZERO, fine)


@inlined
def _step(sums: SingleArray, first: Any, second: Any, third: Any, fourth: Any) -> None:
    """Four terms of all sums, as in `binomial`."""
    for lane in range(_LANES):
        odds, growth = sums[_ODDS + lane], sums[_GROWTH + lane]
        term, uniform = sums[_TERM + lane], sums[_LEFT + lane]
        one = growth * first - odds
        two = one * (growth * second - odds)
        ratio = growth * third - odds
        three = two * ratio
        four = two * (ratio * (growth * fourth - odds))
        up_to_one = _ONE + one
        up_to_two = up_to_one + two
        step_one, step_two, step = term * up_to_one, term * up_to_two, term * (up_to_two + three)
        above = (_ONE if uniform >= term else _ZERO) + (_ONE if uniform >= step_one else _ZERO)
        above += (_ONE if uniform >= step_two else _ZERO) + (_ONE if uniform >= step else _ZERO)
        near = min(min(abs(uniform - term), abs(uniform - step_one)), min(abs(uniform - step_two), abs(uniform - step)))
        sums[_FOUND + lane] += above
        sums[_NEAREST + lane] = min(near, sums[_NEAREST + lane])
        sums[_LEFT + lane] = uniform - step if uniform >= step else _GONE
        sums[_TERM + lane] = term * four


@kernel
def settle(
    rates: FloatArray,
    rate_row: Any,
    draws: FloatArray,
    draw_row: Any,
    inverse: SingleArray,
    lanes: ShortArray,
    sums: SingleArray,
    detectors: int,
) -> Any:
    """A binomial number for each lane, of as many trials as the first row of `lanes` says, into its second row.

    `inverse[k]` is 1 / k. Returns the lanes whose number is not settled.
    """
    bright = reaching_row(rates, rate_row, LN2)
    if bright == 0:
        _begin(rates, rate_row, draws, draw_row, lanes, sums)
    else:
        _begin_bright(rates, rate_row, draws, draw_row, lanes, sums)
    k: Any = np.uint64(0)
    while reaching_row(sums, _LEFT, _ZERO) != 0 and k <= np.uint64(detectors):
        _step(sums, inverse[k + _NEXT], inverse[k + _SECOND], inverse[k + _THIRD], inverse[k + _FOURTH])
        k += _FOURTH
    for lane in range(_LANES):
        armed, found = lanes[lane], np.int16(sums[_FOUND + lane])
        found = found if found < armed else armed
        lanes[_LANES + lane] = armed - found if _single(rates[rate_row + lane]) >= _BRIGHT else found
    return ~reaching_row(sums, _NEAREST, _CLOSE) & _ALL
