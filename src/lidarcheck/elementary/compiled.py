"""Exponentials, logarithms, sines and cosines of large arrays in compiled code, to the same bits.

The methods are those of `exponentials` and `angles`, operation by operation, without what numpy writes to memory
between two of them: a tenth of the time. Imported by need alone, since compilers take a while to load;
`tests/test_elementary_compiled.py` holds the bits of both to each other.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.elementary import angles, exponentials
from lidarcheck.jit import inlined, kernel

__all__ = [
    "ROUNDER",
    "angle_of",
    "arctan2",
    "bits_of",
    "bits_of_single",
    "cos",
    "exp",
    "from_bits",
    "interp",
    "log",
    "sin",
    "single_from_bits",
]

ROUNDER = 6755399441055744.0
"""1.5 x 2^52: what is added to it is rounded to a whole number, which then stands in the last bits of the sum."""
_BITS_OF_ROUNDER = 0x4338000000000000
_FRACTION_BITS, _FRACTION = 52, 0x000FFFFFFFFFFFFF
_EXPONENT_OF_ONE, _EXPONENT_OF_HALF, _MOST_EXPONENT = 1023, 1022, 2048
_SMALLEST_NORMAL, _LIFT, _LIFT_BITS = 2.2250738585072014e-308, 18014398509481984.0, 54
_LN2_HIGH, _LN2_LOW, _PER_LN2 = exponentials.LN2_HIGH, exponentials.LN2_LOW, exponentials.PER_LN2
_LOWEST, _HIGHEST, _ROOT_HALF = exponentials.LOWEST, exponentials.HIGHEST, exponentials.ROOT_HALF
_RIGHT, _RIGHT_1, _RIGHT_2, _RIGHT_3 = angles.RIGHT, angles.RIGHT_1, angles.RIGHT_2, angles.RIGHT_3
_RIGHT_REST, _STEPS, _ARCTAN, _ARCTAN_REST = angles.RIGHT_REST, angles.STEPS, angles.ARCTAN, angles.ARCTAN_REST
_E2, _E3, _E4, _E5, _E6, _E7, _E8, _E9, _E10, _E11, _E12, _E13, _E14 = exponentials.EXP
_L0, _L1, _L2, _L3, _L4, _L5, _L6, _L7, _L8, _L9, _L10, _L11 = exponentials.LOG
_S1, _S2, _S3, _S4, _S5, _S6, _S7, _S8 = angles.SIN
_C2, _C3, _C4, _C5, _C6, _C7, _C8, _C9 = angles.COS
_A1, _A2, _A3, _A4, _A5, _A6, _A7, _A8 = angles.ATAN


def _bits_of(typing_context: Any, number: Any) -> Any:
    """The 64 bits of a floating-point number as a whole number."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(64))

    return types.int64(types.float64), codegen


def _from_bits(typing_context: Any, bits: Any) -> Any:
    """The floating-point number that has these 64 bits."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.DoubleType())

    return types.float64(types.int64), codegen


def _bits_of_single(typing_context: Any, number: Any) -> Any:
    """The 32 bits of a number in single precision as a whole number."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(32))

    return types.int32(types.float32), codegen


def _single_from_bits(typing_context: Any, bits: Any) -> Any:
    """The number in single precision that has these 32 bits."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(builder.trunc(args[0], ir.IntType(32)), ir.FloatType())

    return types.float32(types.int64), codegen


bits_of: Any = intrinsic(_bits_of)
from_bits: Any = intrinsic(_from_bits)
bits_of_single: Any = intrinsic(_bits_of_single)
single_from_bits: Any = intrinsic(_single_from_bits)


@kernel
def exp(x: FloatArray, found: FloatArray) -> None:
    """e to the power of each x, shape (n,), into `found`."""
    for row in range(len(x)):
        i: Any = np.uint64(row)
        value = x[i]
        odd = value != value
        bounded = min(max(0.0 if odd else value, _LOWEST), _HIGHEST)
        shifted = bounded * _PER_LN2 + ROUNDER
        k = shifted - ROUNDER
        high, less = bounded - k * _LN2_HIGH, k * _LN2_LOW
        r = high - less
        s = _E14
        s = s * r + _E13
        s = s * r + _E12
        s = s * r + _E11
        s = s * r + _E10
        s = s * r + _E9
        s = s * r + _E8
        s = s * r + _E7
        s = s * r + _E6
        s = s * r + _E5
        s = s * r + _E4
        s = s * r + _E3
        s = s * r + _E2
        low = r * r * s - less
        one = 1.0 + high
        near = one + (((1.0 - one) + high) + low)
        # The power of two need not be a number itself: in two steps.
        whole = bits_of(shifted) - _BITS_OF_ROUNDER
        first = ((whole + _MOST_EXPONENT) >> 1) - _MOST_EXPONENT // 2
        once = from_bits((first + _EXPONENT_OF_ONE) << _FRACTION_BITS)
        again = from_bits((whole - first + _EXPONENT_OF_ONE) << _FRACTION_BITS)
        scaled = near * once * again
        found[i] = value if odd else scaled


@kernel
def log(x: FloatArray, found: FloatArray) -> None:
    """The natural logarithm of each x, shape (n,), into `found`; -inf at 0, NaN below."""
    for row in range(len(x)):
        i: Any = np.uint64(row)
        value = x[i]
        fair = 0.0 < value < math.inf
        lifted = fair and value < _SMALLEST_NORMAL
        normal = value if fair else 1.0
        bits = bits_of(normal * _LIFT if lifted else normal)
        m = from_bits((bits & _FRACTION) | (_EXPONENT_OF_HALF << _FRACTION_BITS))
        below = m < _ROOT_HALF
        m = 2.0 * m if below else m
        e = float((bits >> _FRACTION_BITS) - _EXPONENT_OF_HALF - (_LIFT_BITS if lifted else 0) - (1 if below else 0))
        f = m - 1.0
        t, half = f / (2.0 + f), 0.5 * f * f
        z = t * t
        s = _L11
        s = s * z + _L10
        s = s * z + _L9
        s = s * z + _L8
        s = s * z + _L7
        s = s * z + _L6
        s = s * z + _L5
        s = s * z + _L4
        s = s * z + _L3
        s = s * z + _L2
        s = s * z + _L1
        s = s * z + _L0
        c = t * (half + z * s) - half
        near = e * _LN2_HIGH + (f + (c + e * _LN2_LOW))
        other = -math.inf if value == 0.0 else (math.inf if value == math.inf else math.nan)
        found[i] = near if fair else other


@inlined
def _turned(x: float) -> Any:
    """The quarter that x lies in (0 to 3), the sine and the cosine of what is over its middle."""
    k = np.rint(x * (1.0 / _RIGHT))
    rest = x - k * _RIGHT_1
    part = k * _RIGHT_2
    high = rest - part
    taken = high - rest
    low = ((rest - (high - taken)) + (-part - taken)) - k * _RIGHT_3
    y = high + low
    low = (high - y) + low
    z = y * y
    half = 0.5 * z
    one = 1.0 - half
    s = _S8
    s = s * z + _S7
    s = s * z + _S6
    s = s * z + _S5
    s = s * z + _S4
    s = s * z + _S3
    s = s * z + _S2
    s = s * z + _S1
    c = _C9
    c = c * z + _C8
    c = c * z + _C7
    c = c * z + _C6
    c = c * z + _C5
    c = c * z + _C4
    c = c * z + _C3
    c = c * z + _C2
    sine = y + (y * z * s + low * one)
    cosine = one + (((1.0 - one) - half) + (z * z * c - y * low))
    return k - 4.0 * np.floor(0.25 * k), sine, cosine


@kernel
def sin(x: FloatArray, found: FloatArray) -> None:
    """The sine of each angle in radians, of less than a million turns, shape (n,), into `found`."""
    for row in range(len(x)):
        i: Any = np.uint64(row)
        quarter, sine, cosine = _turned(x[i])
        value = sine if quarter == 0.0 or quarter == 2.0 else cosine
        found[i] = -value if quarter >= 2.0 else value


@kernel
def cos(x: FloatArray, found: FloatArray) -> None:
    """The cosine of each angle in radians, of less than a million turns, shape (n,), into `found`."""
    for row in range(len(x)):
        i: Any = np.uint64(row)
        quarter, sine, cosine = _turned(x[i])
        value = cosine if quarter == 0.0 or quarter == 2.0 else sine
        found[i] = -value if quarter == 1.0 or quarter == 2.0 else value


@inlined
def angle_of(y: float, x: float) -> Any:
    """The angle of the point (x, y) in radians, between -pi and pi; x and y are finite."""
    flat, steep = abs(x), abs(y)
    large, small = max(flat, steep), min(flat, steep)
    t = small / large if large > 0.0 else 0.0
    step = np.rint(_STEPS * t)
    c = step / _STEPS
    u = (t - c) / (1.0 + t * c)
    z = u * u
    s = _A8
    s = s * z + _A7
    s = s * z + _A6
    s = s * z + _A5
    s = s * z + _A4
    s = s * z + _A3
    s = s * z + _A2
    s = s * z + _A1
    j = int(step) if step == step else 0
    angle = _ARCTAN[j] + (_ARCTAN_REST[j] + (u + u * z * s))
    angle = _RIGHT - (angle - _RIGHT_REST) if steep > flat else angle
    angle = 2.0 * _RIGHT - (angle - 2.0 * _RIGHT_REST) if math.copysign(1.0, x) < 0.0 else angle
    return math.copysign(angle, y)


@kernel
def arctan2(y: FloatArray, x: FloatArray, found: FloatArray) -> None:
    """The angles of the points (x, y), shape (n,) each, into `found`; NaN where one of both is."""
    for i in range(len(found)):
        odd = x[i] != x[i] or y[i] != y[i]
        angle = angle_of(0.0 if odd else y[i], 0.0 if odd else x[i])
        found[i] = math.nan if odd else angle


@kernel
def interp(x: FloatArray, at: FloatArray, value: FloatArray, guide: IndexArray, found: FloatArray) -> None:
    """`lines.interp`: `guide` (m,), work space, gets where each of m even parts of the range of `at` begins."""
    last, parts = len(at) - 1, len(guide)
    first, scale = at[0], parts / (at[last] - at[0])
    j = 0
    for part in range(parts):
        while j < last - 1 and (at[j + 1] - first) * scale <= part:
            j += 1
        guide[part] = j
    for i in range(len(x)):
        if x[i] >= at[last]:
            found[i] = value[last]
        elif x[i] >= first:
            j = guide[min(int((x[i] - first) * scale), parts - 1)]
            while at[j] > x[i]:
                j -= 1
            while at[j + 1] <= x[i]:
                j += 1
            slope = (value[j + 1] - value[j]) / (at[j + 1] - at[j])
            found[i] = value[j] if at[j] == x[i] else slope * (x[i] - at[j]) + value[j]
        else:
            found[i] = value[0] if x[i] < first else math.nan
