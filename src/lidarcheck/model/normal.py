"""Standard normal numbers in kernels: the inverse of the distribution function."""

from __future__ import annotations

import math

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.lane_math import log

__all__ = ["normal", "normals"]

_CENTRAL = 0.425
_LEAST = 2.0**-54
"""Half the distance between two uniform numbers: what stands for 0, whose normal number would be infinite."""


@inlined
def _central(q: float) -> float:
    """Where the uniform number is q + 1/2, |q| at most 0.425."""
    r = 0.180625 - q * q
    over = 2.5090809287301226727e3 * r + 3.3430575583588128105e4
    over = (over * r + 6.7265770927008700853e4) * r + 4.5921953931549871457e4
    over = ((over * r + 1.3731693765509461125e4) * r + 1.9715909503065514427e3) * r + 1.3314166789178437745e2
    under = 5.2264952788528545610e3 * r + 2.8729085735721942674e4
    under = (under * r + 3.9307895800092710610e4) * r + 2.1213794301586595867e4
    under = ((under * r + 5.3941960214247511077e3) * r + 6.8718700749205790830e2) * r + 4.2313330701600911252e1
    return q * (over * r + 3.3871328727963666080) / (under * r + 1.0)


@inlined
def _tail(least: float) -> float:
    """Where the smaller of the uniform number and its rest to 1 is `least`; without its sign."""
    r = math.sqrt(-log(least))
    if r <= 5.0:
        r -= 1.6
        over = 7.74545014278341407640e-4 * r + 2.27238449892691845833e-2
        over = (over * r + 2.41780725177450611770e-1) * r + 1.27045825245236838258
        over = ((over * r + 3.64784832476320460504) * r + 5.76949722146069140550) * r + 4.63033784615654529590
        under = 1.05075007164441684324e-9 * r + 5.47593808499534494600e-4
        under = (under * r + 1.51986665636164571966e-2) * r + 1.48103976427480074590e-1
        under = ((under * r + 6.89767334985100004550e-1) * r + 1.67638483018380384940) * r + 2.05319162663775882187
        return (over * r + 1.42343711074968357734) / (under * r + 1.0)
    r -= 5.0
    over = 2.01033439929228813265e-7 * r + 2.71155556874348757815e-5
    over = (over * r + 1.24266094738807843860e-3) * r + 2.65321895265761230930e-2
    over = ((over * r + 2.96560571828504891230e-1) * r + 1.78482653991729133580) * r + 5.46378491116411436990
    under = 2.04426310338993978564e-15 * r + 1.42151175831644588870e-7
    under = (under * r + 1.84631831751005468180e-5) * r + 7.86869131145613259100e-4
    under = ((under * r + 1.48753612908506148525e-2) * r + 1.36929880922735805310e-1) * r + 5.99832206555887937690e-1
    return (over * r + 6.65790464350110377720) / (under * r + 1.0)


@inlined
def normal(uniform: float) -> float:
    """The standard normal number of a uniform one in [0, 1); right to about 1e-15.

    Wichura, "Algorithm AS 241: the percentage points of the normal distribution", Applied Statistics 37, 1988 (PPND16).
    """
    q = uniform - 0.5
    if abs(q) <= _CENTRAL:
        return _central(q)
    found = _tail(max(min(uniform, 1.0 - uniform), _LEAST))
    return found if q > 0.0 else -found


@kernel
def normals(uniform: FloatArray, count: int, found: FloatArray) -> None:
    """`normal` of the first `count` numbers, into `found`: most of them side by side."""
    for i in range(count):
        found[i] = _central(uniform[i] - 0.5)
    for i in range(count):
        if abs(uniform[i] - 0.5) > _CENTRAL:
            found[i] = normal(uniform[i])
