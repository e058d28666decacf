"""Exponentials and logarithms that the compiler can work out for several beams at once.

Calls into the mathematics library stand in the way of that, and differ from machine to machine in the last digit. These
are plain sums and products, the same to the last bit wherever they run, alone or side by side; right to about 1e-15.
"""

from __future__ import annotations

import math

from lidarcheck.elementary.compiled import ROUNDER, bits_of, from_bits
from lidarcheck.jit import inlined

__all__ = ["LANES", "LN2", "exp", "expm1", "fired", "lgamma", "log", "log1m", "log1p", "log_rest", "whole_below"]

LANES = 32
"""Beams that are worked on side by side: four times what a vector holds, so that sums do not wait for each other."""

LN2 = 0.6931471805599453
_PER_LN2 = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
"""Their sum is ln 2 to 33 digits; the first has so few bits that its product with an exponent is exact."""
_EXPONENT_OF_ONE, _FRACTION_BITS = 1023, 52
_BITS_OF_ROOT = 0x3FE6A09E667F3BCD
"""Those of sqrt(1/2)."""
_F2, _F3, _F4, _F5, _F6, _F7, _F8, _F9, _F10, _F11, _F12, _F13 = (1.0 / math.factorial(k) for k in range(2, 14))
_STIRLING = (1 / 12, -1 / 360, 1 / 1260, -1 / 1680, 1 / 1188, -691 / 360360, 1 / 156)
_HALF_LOG_TURN = 0.9189385332046727
"""log(2 pi) / 2."""
_I3, _I5, _I7, _I9, _I11, _I13, _I15, _I17, _I19, _I21 = (1.0 / k for k in range(3, 22, 2))


@inlined
def exp(x: float) -> float:
    """exp(x) for x between -700 and 700: a power of two times a Taylor series of at most half of ln 2."""
    shifted = x * _PER_LN2 + ROUNDER
    whole = shifted - ROUNDER
    r = (x - whole * _LN2_HIGH) - whole * _LN2_LOW
    s = r * r
    q = s * s
    low = ((1.0 + r) + s * (_F2 + r * _F3)) + q * ((_F4 + r * _F5) + s * (_F6 + r * _F7))
    high = ((_F8 + r * _F9) + s * (_F10 + r * _F11)) + q * (_F12 + r * _F13)
    power: float = from_bits((bits_of(shifted) + _EXPONENT_OF_ONE) << _FRACTION_BITS)
    return (low + (q * q) * high) * power


@inlined
def expm1(x: float) -> float:
    """exp(x) - 1 for x between 0 and 1: a Taylor series of x / 4, doubled twice."""
    r = 0.25 * x
    s = r * r
    q = s * s
    low = (_F2 + r * _F3) + s * (_F4 + r * _F5)
    high = (_F6 + r * _F7) + s * (_F8 + r * _F9)
    fourth = r + s * (low + q * (high + q * (_F10 + r * _F11)))
    half = fourth * (fourth + 2.0)
    return half * (half + 2.0)


@inlined
def log(x: float) -> float:
    """log(x) for normal numbers x above 0: the exponent's part, and a series between sqrt(1/2) and sqrt(2)."""
    bits = bits_of(x)
    # The bits of x over sqrt(1/2) as a whole number: their exponent tells by which power of two to divide.
    exponent = (bits - _BITS_OF_ROOT) >> _FRACTION_BITS
    near_one: float = from_bits(bits - (exponent << _FRACTION_BITS))
    t = (near_one - 1.0) / (near_one + 1.0)
    z = t * t
    y = z * z
    low = (1.0 + z * _I3) + y * (_I5 + z * _I7)
    high = (_I9 + z * _I11) + y * (_I13 + z * _I15)
    w = y * y
    series = low + w * (high + w * ((_I17 + z * _I19) + y * _I21))
    found: float = exponent * _LN2_HIGH + (2.0 * t * series + exponent * _LN2_LOW)
    return found


@inlined
def log1m(x: float) -> float:
    """log(1 - x) for x between 0 and 1/2: twice that of the square root, as an inverse hyperbolic tangent's series."""
    root = x / (1.0 + math.sqrt(1.0 - x))
    t = root / (2.0 - root)
    z = t * t
    y = z * z
    low = (1.0 + z * _I3) + y * (_I5 + z * _I7)
    high = (_I9 + z * _I11) + y * (_I13 + z * _I15)
    w = y * y
    return -4.0 * t * (low + w * (high + w * ((_I17 + z * _I19) + y * _I21)))


@inlined
def fired(rate: float) -> float:
    """1 - exp(-rate), for a rate at or above 0, to as many digits near zero."""
    if rate < 1.0:
        more = expm1(rate)
        return more / (1.0 + more)
    return 1.0 - exp(-min(rate, 700.0))


@inlined
def log1p(x: float) -> float:
    """log(1 + x) for x at or above 0, to as many digits near zero."""
    u = 1.0 + x
    return log(u) + (x - (u - 1.0)) / u


@inlined
def log_rest(share: float) -> float:
    """log(1 - share) for a share between 0 and 1, to as many digits near zero; -inf for 1."""
    if share <= 0.5:
        return log1m(share)
    return log(1.0 - share) if share < 1.0 else -math.inf


@inlined
def lgamma(x: float) -> float:
    """The logarithm of the gamma function for x at or above 1: Stirling's series, above 10."""
    below = 1.0
    while x < 10.0:
        below *= x
        x += 1.0
    z = 1.0 / (x * x)
    series = _STIRLING[6]
    for k in range(5, -1, -1):
        series = series * z + _STIRLING[k]
    return (x - 0.5) * log(x) - x + _HALF_LOG_TURN + series / x - log(below)


@inlined
def whole_below(x: float) -> int:
    """The largest whole number that is not above x."""
    return int(math.floor(x))  # noqa: RUF046 - what `floor` gives on a GPU is a floating-point number
