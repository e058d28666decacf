"""Elementary functions that give the same bits on every machine: sums, products, quotients and square roots only.

The mathematics libraries of C and of numpy choose their code by the processor, and their last digit with it: exp and
log differ in one value of twenty. Whatever ends up in a scan's or a golden's bytes is worked out with these instead;
`tool.ruff.lint.flake8-tidy-imports` in pyproject.toml refuses the others in the rooms concerned. Arguments are numbers
or arrays, results float64, right to about one unit in the last place (`tests/test_elementary.py` holds each against
more digits). Compiled kernels have `model/lane_math.py`.

The methods are the textbook's (Muller, Elementary Functions): an argument is brought near zero with a constant in two
or three parts, whose first are short enough that their products are exact, and a Taylor series does the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = [
    "arccos",
    "arcsin",
    "arctan",
    "arctan2",
    "cos",
    "exp",
    "exp2",
    "expm1",
    "gauss_legendre",
    "hypot",
    "lgamma",
    "log",
    "log1p",
    "log2",
    "log10",
    "logaddexp",
    "power",
    "product",
    "rounded_cos_sin",
    "sin",
    "tan",
]

_BLOCK = 8192
"""Elements that are worked on at a time: what stands between them then stays in the processor's cache."""
_LN2, _PER_LN2, _PER_LN10 = 0.6931471805599453, 1.4426950408889634, 0.4342944819032518
_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10
_RIGHT_1, _RIGHT_2, _RIGHT_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
"""A right angle in parts of 33 bits: products with numbers below 2^20 are exact."""
_RIGHT, _RIGHT_REST = 1.5707963267948966, 6.123233995736766e-17
_STEPS = 8
_ARCTAN = np.array([0.0, 0.12435499454676144, 0.24497866312686414, 0.35877067027057225, 0.4636476090008061,
                    0.5585993153435624, 0.6435011087932844, 0.7188299996216245, 0.7853981633974483])  # fmt: skip
_ARCTAN_REST = np.array([0.0, -3.1253241424539383e-18, 1.0698755618734451e-17, -2.4623815582638635e-17,
                         2.2698777452961687e-17, -5.4556305485916264e-18, 1.5834785051444286e-17,
                         -2.1478388444456983e-17, 3.061616997868383e-17])  # fmt: skip
"""The arc tangent of j / 8, and what its rounding left."""
_TENS = np.array([float(f"1e{k}") for k in range(-30, 31)])
_ROOT_HALF = 0.7071067811865476
_LOWEST, _HIGHEST = -746.0, 710.0
"""Below, exp is 0; above, infinite."""
_NEWTON_STEPS = 6
_SERIES_BITS = 220
_SPLIT = 134217729.0
"""2^27 + 1: cuts a number into halves whose products are exact."""

_EXP = tuple(1.0 / math.factorial(k) for k in range(2, 15))
_LOG = tuple(2.0 / k for k in range(3, 27, 2))
_SIN = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9))
_COS = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(2, 10))
_ATAN = tuple((-1.0) ** k / (2 * k + 1) for k in range(1, 9))
_STIRLING = (1 / 12, -1 / 360, 1 / 1260, -1 / 1680, 1 / 1188, -691 / 360360, 1 / 156)


def _in_blocks(function: Callable[..., FloatArray]) -> Callable[..., Any]:
    """A function of float64 arrays of one shape, made one of numbers and of arrays that are broadcast together."""

    @wraps(function)
    def whole(*arguments: Any) -> Any:
        columns = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in arguments))
        shape, flat = columns[0].shape, [np.ravel(c) for c in columns]
        found = np.empty(flat[0].size)
        with np.errstate(invalid="ignore", over="ignore", under="ignore", divide="ignore"):
            for start in range(0, found.size, _BLOCK):
                part = slice(start, start + _BLOCK)
                found[part] = function(*(c[part] for c in flat))
        return found.reshape(shape) if shape else found[0]

    return whole


def _series(x: FloatArray, coefficients: tuple[float, ...]) -> FloatArray:
    """The sum of coefficient k times x^k, the highest first."""
    found = np.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        found = found * x + coefficient
    return found


def _scaled(y: FloatArray, power_of_two: FloatArray) -> FloatArray:
    """y times two to a whole power, which need not be a number itself: in two steps."""
    whole = power_of_two.astype(np.int64)
    first = whole >> 1
    return np.asarray(y * np.ldexp(1.0, first) * np.ldexp(1.0, whole - first))


def _exp_rest(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """k, high, low with exp(x) = 2^k (1 + high + low)."""
    k = np.rint(x * _PER_LN2)
    high, less = x - k * _LN2_HIGH, k * _LN2_LOW
    r = high - less
    return k, high, r * r * _series(r, _EXP) - less


def _exp(x: FloatArray, more: FloatArray | float = 0.0) -> FloatArray:
    """exp(x + more) for a `more` that is tiny beside x."""
    odd = np.isnan(x)
    k, high, low = _exp_rest(np.where(odd, 0.0, np.clip(x, _LOWEST, _HIGHEST)))
    one = 1.0 + high
    found = _scaled(one + (((1.0 - one) + high) + (low + more * one)), k)
    return np.where(odd, x, found)


@_in_blocks
def exp(x: FloatArray) -> FloatArray:
    """e to the power x."""
    return _exp(x)


@_in_blocks
def exp2(x: FloatArray) -> FloatArray:
    """2 to the power x; exact for whole numbers."""
    bounded = np.clip(np.where(np.isnan(x), 0.0, x), -1100.0, 1100.0)
    k = np.rint(bounded)
    return np.where(np.isnan(x), x, _scaled(_exp((bounded - k) * _LN2), k))


@_in_blocks
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
    low = m < _ROOT_HALF
    m, e = np.where(low, 2.0 * m, m), whole - low.astype(np.float64)
    f = m - 1.0
    s, half = f / (2.0 + f), 0.5 * f * f
    z = s * s
    return e, f, s * (half + z * _series(z, _LOG)) - half


def _log(x: FloatArray) -> FloatArray:
    fair = (x > 0.0) & (x < np.inf)
    e, f, c = _log_parts(np.where(fair, x, 1.0))
    odd = np.where(x == 0.0, -np.inf, np.where(x == np.inf, np.inf, np.nan))
    return np.where(fair, e * _LN2_HIGH + (f + (c + e * _LN2_LOW)), odd)


@_in_blocks
def log(x: FloatArray) -> FloatArray:
    """The natural logarithm; -inf at 0, NaN below."""
    return _log(x)


@_in_blocks
def log1p(x: FloatArray) -> FloatArray:
    """log(1 + x), to as many digits near zero."""
    u = 1.0 + x
    rest = (x - (u - 1.0)) / u
    return _log(u) + np.where((u > 0.0) & (u < np.inf), rest, 0.0)


@_in_blocks
def log2(x: FloatArray) -> FloatArray:
    """The logarithm to base 2; exact for powers of two."""
    fair = (x > 0.0) & (x < np.inf)
    e, f, c = _log_parts(np.where(fair, x, 1.0))
    return np.where(fair, e + (f + c) * _PER_LN2, _log(x))


@_in_blocks
def log10(x: FloatArray) -> FloatArray:
    """The logarithm to base 10; exact for powers of ten from 1e-30 to 1e30."""
    found = _log(x) * _PER_LN10
    whole = np.clip(np.where(np.isnan(found), 0.0, np.rint(found)), -30.0, 30.0)
    return np.where(_TENS[whole.astype(np.int64) + 30] == x, whole, found)


@_in_blocks
def logaddexp(x: FloatArray, y: FloatArray) -> FloatArray:
    """log(exp(x) + exp(y)), without overflow."""
    large = np.maximum(x, y)
    apart = np.where(large == -np.inf, 0.0, np.minimum(x, y) - large)
    return np.where(large == -np.inf, -np.inf, large + _log(1.0 + _exp(apart)))


@_in_blocks
def power(x: FloatArray, y: FloatArray) -> FloatArray:
    """x to the power y, for x at or above 0; NaN below."""
    fair = (x > 0.0) & (x < np.inf)
    e, f, c = _log_parts(np.where(fair, x, 1.0))
    large = e * _LN2_HIGH
    total = large + f
    low = _sum_rest(large, f, total) + (c + e * _LN2_LOW)
    high = total + low
    low = (total - high) + low
    exact, rest = _product(high, y)
    found = _exp(exact, rest + low * y)
    edge = np.where(y == 0.0, 1.0, np.where((x == 0.0) == (y > 0.0), 0.0, np.inf))
    found = np.where(y == 1.0, x, np.where(y == 2.0, x * x, np.where(y == 0.0, 1.0, found)))
    return np.where(fair, found, np.where(x < 0.0, np.nan, np.where(np.isnan(x), x, edge)))


def _sum_rest(a: FloatArray, b: FloatArray, total: FloatArray) -> FloatArray:
    """What rounding left of a + b = total."""
    part = total - a
    return (a - (total - part)) + (b - part)


def _product(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """a b, and what its rounding left."""
    found = a * b
    a_high, b_high = _SPLIT * a - (_SPLIT * a - a), _SPLIT * b - (_SPLIT * b - b)
    a_low, b_low = a - a_high, b - b_high
    return found, ((a_high * b_high - found) + a_high * b_low + a_low * b_high) + a_low * b_low


def _turned(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The quarter that x lies in (0 to 3), the sine and the cosine of what is over its middle."""
    k = np.rint(x * (1.0 / _RIGHT))
    rest = x - k * _RIGHT_1
    part = k * _RIGHT_2
    high = rest - part
    low = _sum_rest(rest, -part, high) - k * _RIGHT_3
    y = high + low
    low = (high - y) + low
    z = y * y
    half = 0.5 * z
    one = 1.0 - half
    sine = y + (y * z * _series(z, _SIN) + low * one)
    cosine = one + (((1.0 - one) - half) + (z * z * _series(z, _COS) - y * low))
    return k - 4.0 * np.floor(0.25 * k), sine, cosine


@_in_blocks
def sin(x: FloatArray) -> FloatArray:
    """The sine of an angle in radians, of less than a million turns."""
    quarter, sine, cosine = _turned(x)
    found = np.where(quarter % 2.0 == 0.0, sine, cosine)
    return np.where(quarter >= 2.0, -found, found)


@_in_blocks
def cos(x: FloatArray) -> FloatArray:
    """The cosine of an angle in radians, of less than a million turns."""
    quarter, sine, cosine = _turned(x)
    found = np.where(quarter % 2.0 == 0.0, cosine, sine)
    return np.where((quarter == 1.0) | (quarter == 2.0), -found, found)


@_in_blocks
def tan(x: FloatArray) -> FloatArray:
    """The tangent of an angle in radians, of less than a million turns."""
    quarter, sine, cosine = _turned(x)
    return np.where(quarter % 2.0 == 0.0, sine / cosine, -cosine / sine)


def _arctan(t: FloatArray) -> FloatArray:
    """The arc tangent of a number between 0 and 1."""
    step = np.rint(_STEPS * np.where(np.isnan(t), 0.0, t)).astype(np.int64)
    c = step / _STEPS
    u = (t - c) / (1.0 + t * c)
    z = u * u
    return np.asarray(_ARCTAN[step] + (_ARCTAN_REST[step] + (u + u * z * _series(z, _ATAN))))


@_in_blocks
def arctan2(y: FloatArray, x: FloatArray) -> FloatArray:
    """The angle of the point (x, y) in radians, between -pi and pi; x and y are finite."""
    flat, steep = np.abs(x), np.abs(y)
    large, small = np.maximum(flat, steep), np.minimum(flat, steep)
    angle = _arctan(np.where(large > 0.0, small / large, 0.0))
    angle = np.where(steep > flat, _RIGHT - (angle - _RIGHT_REST), angle)
    angle = np.where(np.signbit(x), 2.0 * _RIGHT - (angle - 2.0 * _RIGHT_REST), angle)
    return np.where(np.isnan(x) | np.isnan(y), np.nan, np.copysign(angle, y))


def arctan(x: Any) -> Any:
    """The arc tangent in radians."""
    size = np.abs(x)
    return arctan2(np.where(size == np.inf, np.sign(x), x), np.where(size == np.inf, 0.0, 1.0))


def arcsin(x: Any) -> Any:
    """The arc sine in radians; NaN outside of -1 to 1."""
    return arctan2(x, _other_side(x))


def arccos(x: Any) -> Any:
    """The arc cosine in radians; NaN outside of -1 to 1."""
    return arctan2(_other_side(x), x)


def _other_side(x: Any) -> Any:
    with np.errstate(invalid="ignore"):
        return np.sqrt((1.0 - np.asarray(x)) * (1.0 + np.asarray(x)))


def hypot(x: Any, y: Any) -> Any:
    """The root of x^2 + y^2, for numbers whose squares are numbers."""
    return np.sqrt(np.square(x) + np.square(y))


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


def rounded_cos_sin(angles: Any) -> tuple[FloatArray, FloatArray]:
    """The numbers nearest to the cosines and sines of angles (n,) in radians; for tables: 10 us an angle.

    The series is summed in whole numbers of 2^-220.
    """
    found = np.array([_whole_cos_sin(float(angle)) for angle in np.ravel(angles)]).reshape(*np.shape(angles), 2)
    return found[..., 0], found[..., 1]


def _whole_cos_sin(angle: float) -> tuple[float, float]:
    numerator, denominator = abs(angle).as_integer_ratio()
    x, one = (numerator << _SERIES_BITS) // denominator, 1 << _SERIES_BITS
    sums, term, k = [0, 0], one, 0
    while term:
        sums[k % 2] += -term if k % 4 > 1 else term
        k += 1
        term = term * x // (k << _SERIES_BITS)
    return sums[0] / one, sums[1] / one * math.copysign(1.0, angle)


def gauss_legendre(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Places between -1 and 1 and weights of Gauss-Legendre quadrature, shape (nodes,) each, rising.

    By Newton's method from Tricomi's guess on the three-term recurrence.
    """
    order = np.arange(nodes, 0, -1)
    x = cos(math.pi * (order - 0.25) / (nodes + 0.5))
    for _ in range(_NEWTON_STEPS):
        before, value = np.ones(nodes), x
        for k in range(2, nodes + 1):
            before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
        slope = nodes * (x * value - before) / (x * x - 1.0)
        x = x - value / slope
    return x, 2.0 / ((1.0 - x * x) * slope * slope)


def product(a: Any, b: Any) -> FloatArray:
    """What `a @ b` means, summed in one order: libraries of linear algebra choose theirs by the processor."""
    left, right = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    return np.asarray(np.einsum("...j,j->..." if right.ndim == 1 else "...j,jk->...k", left, right))
