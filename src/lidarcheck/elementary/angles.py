"""Sines, cosines and their inverses: the argument over the middle of a quarter turn, and a Taylor series."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.elementary.blocks import in_blocks, in_blocks_or_compiled, series, sum_rest

__all__ = ["arccos", "arcsin", "arctan", "arctan2", "cos", "hypot", "rounded_cos_sin", "sin", "tan"]

RIGHT_1, RIGHT_2, RIGHT_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
"""A right angle in parts of 33 bits: products with numbers below 2^20 are exact."""
RIGHT, RIGHT_REST = 1.5707963267948966, 6.123233995736766e-17
STEPS = 8
ARCTAN = np.array([0.0, 0.12435499454676144, 0.24497866312686414, 0.35877067027057225, 0.4636476090008061,
                    0.5585993153435624, 0.6435011087932844, 0.7188299996216245, 0.7853981633974483])  # fmt: skip
ARCTAN_REST = np.array([0.0, -3.1253241424539383e-18, 1.0698755618734451e-17, -2.4623815582638635e-17,
                         2.2698777452961687e-17, -5.4556305485916264e-18, 1.5834785051444286e-17,
                         -2.1478388444456983e-17, 3.061616997868383e-17])  # fmt: skip
"""The arc tangent of j / 8, and what its rounding left."""
_SERIES_BITS = 220
SIN = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9))
COS = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(2, 10))
ATAN = tuple((-1.0) ** k / (2 * k + 1) for k in range(1, 9))


def _turned(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The quarter that x lies in (0 to 3), the sine and the cosine of what is over its middle."""
    k = np.rint(x * (1.0 / RIGHT))
    rest = x - k * RIGHT_1
    part = k * RIGHT_2
    high = rest - part
    low = sum_rest(rest, -part, high) - k * RIGHT_3
    y = high + low
    low = (high - y) + low
    z = y * y
    half = 0.5 * z
    one = 1.0 - half
    sine = y + (y * z * series(z, SIN) + low * one)
    cosine = one + (((1.0 - one) - half) + (z * z * series(z, COS) - y * low))
    return k - 4.0 * np.floor(0.25 * k), sine, cosine


@in_blocks_or_compiled
def sin(x: FloatArray) -> FloatArray:
    """The sine of an angle in radians, of less than a million turns."""
    quarter, sine, cosine = _turned(x)
    found = np.where(quarter % 2.0 == 0.0, sine, cosine)
    return np.where(quarter >= 2.0, -found, found)


@in_blocks_or_compiled
def cos(x: FloatArray) -> FloatArray:
    """The cosine of an angle in radians, of less than a million turns."""
    quarter, sine, cosine = _turned(x)
    found = np.where(quarter % 2.0 == 0.0, cosine, sine)
    return np.where((quarter == 1.0) | (quarter == 2.0), -found, found)


@in_blocks
def tan(x: FloatArray) -> FloatArray:
    """The tangent of an angle in radians, of less than a million turns."""
    quarter, sine, cosine = _turned(x)
    return np.where(quarter % 2.0 == 0.0, sine / cosine, -cosine / sine)


def _arctan(t: FloatArray) -> FloatArray:
    """The arc tangent of a number between 0 and 1."""
    step = np.rint(STEPS * np.where(np.isnan(t), 0.0, t)).astype(np.int64)
    c = step / STEPS
    u = (t - c) / (1.0 + t * c)
    z = u * u
    return np.asarray(ARCTAN[step] + (ARCTAN_REST[step] + (u + u * z * series(z, ATAN))))


@in_blocks_or_compiled
def arctan2(y: FloatArray, x: FloatArray) -> FloatArray:
    """The angle of the point (x, y) in radians, between -pi and pi; x and y are finite."""
    flat, steep = np.abs(x), np.abs(y)
    large, small = np.maximum(flat, steep), np.minimum(flat, steep)
    angle = _arctan(np.where(large > 0.0, small / large, 0.0))
    angle = np.where(steep > flat, RIGHT - (angle - RIGHT_REST), angle)
    angle = np.where(np.signbit(x), 2.0 * RIGHT - (angle - 2.0 * RIGHT_REST), angle)
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
