"""Powers and logarithms: the argument as a power of two times what is near 1, and a Taylor series."""

from __future__ import annotations

import math

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.elementary.blocks import in_blocks, in_blocks_or_compiled, series, sum_rest

__all__ = ["exp", "exp2", "expm1", "lgamma", "log", "log1p", "log2", "log10", "logaddexp", "power"]

_LN2, PER_LN2, _PER_LN10 = 0.6931471805599453, 1.4426950408889634, 0.4342944819032518
LN2_HIGH, LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10
"""Their sum is ln 2; products of the first with exponents are exact."""
_TENS = np.array([float(f"1e{k}") for k in range(-30, 31)])
ROOT_HALF = 0.7071067811865476
LOWEST, HIGHEST = -746.0, 710.0
"""Below, exp is 0; above, infinite."""
_SPLIT = 134217729.0
"""2^27 + 1: cuts a number into halves whose products are exact."""
EXP = tuple(1.0 / math.factorial(k) for k in range(2, 15))
LOG = tuple(2.0 / k for k in range(3, 27, 2))
_STIRLING = (1 / 12, -1 / 360, 1 / 1260, -1 / 1680, 1 / 1188, -691 / 360360, 1 / 156)


def _scaled(y: FloatArray, power_of_two: FloatArray) -> FloatArray:
    """y times two to a whole power, which need not be a number itself: in two steps."""
    whole = power_of_two.astype(np.int64)
    first = whole >> 1
    return np.asarray(y * np.ldexp(1.0, first) * np.ldexp(1.0, whole - first))


def _exp_rest(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """k, high, low with exp(x) = 2^k (1 + high + low)."""
    k = np.rint(x * PER_LN2)
    high, less = x - k * LN2_HIGH, k * LN2_LOW
    r = high - less
    return k, high, r * r * series(r, EXP) - less


def _exp(x: FloatArray, more: FloatArray | float = 0.0) -> FloatArray:
    """exp(x + more) for a `more` that is tiny beside x."""
    odd = np.isnan(x)
    k, high, low = _exp_rest(np.where(odd, 0.0, np.clip(x, LOWEST, HIGHEST)))
    one = 1.0 + high
    found = _scaled(one + (((1.0 - one) + high) + (low + more * one)), k)
    return np.where(odd, x, found)


@in_blocks_or_compiled
def exp(x: FloatArray) -> FloatArray:
    """e to the power x."""
    return _exp(x)


@in_blocks
def exp2(x: FloatArray) -> FloatArray:
    """2 to the power x; exact for whole numbers."""
    bounded = np.clip(np.where(np.isnan(x), 0.0, x), -1100.0, 1100.0)
    k = np.rint(bounded)
    return np.where(np.isnan(x), x, _scaled(_exp((bounded - k) * _LN2), k))


@in_blocks
def expm1(x: FloatArray) -> FloatArray:
    """exp(x) - 1, to as many digits near zero."""
    odd = np.isnan(x)
    k, high, low = _exp_rest(np.where(odd, 0.0, np.clip(x, -50.0, 709.0)))
    power = np.ldexp(1.0, k.astype(np.int64))
    found = (power - 1.0) + power * (high + low)
    return np.where(odd, x, np.where(x > 709.0, _exp(x), found))


def _log_parts(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """e, f, c with log(x) = e ln 2 + f + c, f exact and c at most a tenth; x is above 0 and finite."""
    m, whole = np.frexp(x)
    low = m < ROOT_HALF
    m, e = np.where(low, 2.0 * m, m), whole - low.astype(np.float64)
    f = m - 1.0
    s, half = f / (2.0 + f), 0.5 * f * f
    z = s * s
    return e, f, s * (half + z * series(z, LOG)) - half


def _log(x: FloatArray) -> FloatArray:
    fair = (x > 0.0) & (x < np.inf)
    e, f, c = _log_parts(np.where(fair, x, 1.0))
    odd = np.where(x == 0.0, -np.inf, np.where(x == np.inf, np.inf, np.nan))
    return np.where(fair, e * LN2_HIGH + (f + (c + e * LN2_LOW)), odd)


@in_blocks_or_compiled
def log(x: FloatArray) -> FloatArray:
    """The natural logarithm; -inf at 0, NaN below."""
    return _log(x)


@in_blocks
def log1p(x: FloatArray) -> FloatArray:
    """log(1 + x), to as many digits near zero."""
    u = 1.0 + x
    rest = (x - (u - 1.0)) / u
    return _log(u) + np.where((u > 0.0) & (u < np.inf), rest, 0.0)


@in_blocks
def log2(x: FloatArray) -> FloatArray:
    """The logarithm to base 2; exact for powers of two."""
    fair = (x > 0.0) & (x < np.inf)
    e, f, c = _log_parts(np.where(fair, x, 1.0))
    return np.where(fair, e + (f + c) * PER_LN2, _log(x))


@in_blocks
def log10(x: FloatArray) -> FloatArray:
    """The logarithm to base 10; exact for powers of ten from 1e-30 to 1e30."""
    found = _log(x) * _PER_LN10
    whole = np.clip(np.where(np.isnan(found), 0.0, np.rint(found)), -30.0, 30.0)
    return np.where(_TENS[whole.astype(np.int64) + 30] == x, whole, found)


@in_blocks
def logaddexp(x: FloatArray, y: FloatArray) -> FloatArray:
    """log(exp(x) + exp(y)), without overflow."""
    large = np.maximum(x, y)
    apart = np.where(large == -np.inf, 0.0, np.minimum(x, y) - large)
    return np.where(large == -np.inf, -np.inf, large + _log(1.0 + _exp(apart)))


@in_blocks
def power(x: FloatArray, y: FloatArray) -> FloatArray:
    """x to the power y, for x at or above 0; NaN below."""
    fair = (x > 0.0) & (x < np.inf)
    e, f, c = _log_parts(np.where(fair, x, 1.0))
    large = e * LN2_HIGH
    total = large + f
    low = sum_rest(large, f, total) + (c + e * LN2_LOW)
    high = total + low
    low = (total - high) + low
    exact, rest = _product(high, y)
    found = _exp(exact, rest + low * y)
    edge = np.where(y == 0.0, 1.0, np.where((x == 0.0) == (y > 0.0), 0.0, np.inf))
    found = np.where(y == 1.0, x, np.where(y == 2.0, x * x, np.where(y == 0.0, 1.0, found)))
    return np.where(fair, found, np.where(x < 0.0, np.nan, np.where(np.isnan(x), x, edge)))


def _product(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """a b, and what its rounding left."""
    found = a * b
    a_high, b_high = _SPLIT * a - (_SPLIT * a - a), _SPLIT * b - (_SPLIT * b - b)
    a_low, b_low = a - a_high, b - b_high
    return found, ((a_high * b_high - found) + a_high * b_low + a_low * b_high) + a_low * b_low


def lgamma(x: float) -> float:
    """The logarithm of the gamma function, for a number above 0."""
    below = 1.0
    while x < 10.0:
        below, x = below * x, x + 1.0
    z = 1.0 / (x * x)
    series = _STIRLING[-1]
    for coefficient in _STIRLING[-2::-1]:
        series = series * z + coefficient
    return float((x - 0.5) * log(x) - x + 0.9189385332046727 + series / x - log(below))
