"""Binomial and Poisson numbers of any size in kernels, in a time that does not grow with them.

Draws are keyed by where they stand (block, beam, frame): one number does not move another's draws.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.binomial import BELOW_ONE, from_zero, inverses
from lidarcheck.model.lane_math import exp, lgamma, log, log1p, log_rest
from lidarcheck.model.streams import philox, unit

__all__ = ["INVERSES", "binomial_number", "poisson_numbers"]

INVERSES = inverses(251)
"""What inversion needs: sums that have not ended far below 250 terms have a mean above `_FEW`."""
_FEW = 10.0
"""Means below which numbers are found by inversion, term by term."""
_POISSON_TRIALS = 1 << 40
"""As many trials make a Poisson number of a binomial one, but for mean / 2^40 of its distribution (Le Cam)."""


@kernel
def _stirling_rest(k: float) -> float:
    """log k! less Stirling's log sqrt(2 pi) + (k + 1/2) log(k + 1) - (k + 1)."""
    n = k + 1.0
    if k < 10.0:
        return lgamma(n) - (0.9189385332046727 + (k + 0.5) * log(n) - n)
    z = 1.0 / (n * n)
    return (1.0 / 12.0 - (1.0 / 360.0 - z / 1260.0) * z) / n


@kernel
def _log_ratio(n: float, chance: float, k: float, mode: float) -> float:
    """The logarithm of P(k) / P(mode) of n trials of that chance."""
    odds = chance / (1.0 - chance)
    nm, nk = n - mode + 1.0, n - k + 1.0
    h = (mode + 0.5) * log((mode + 1.0) / (odds * nm)) + _stirling_rest(mode) + _stirling_rest(n - mode)
    apart = (n + 1.0) * log1p((k - mode) / nk) + (k + 0.5) * log(nk * odds / (k + 1.0))
    return h + apart - _stirling_rest(k) - _stirling_rest(n - k)


@kernel
def _accepted(v: float, n: float, chance: float, k: float, mode: float, variance: float) -> bool:
    """Whether v <= P(k) / P(mode): near the mode by recursion, else by a squeeze, and last by Stirling's formula."""
    away = abs(k - mode)
    if away <= 15.0:
        odds = chance / (1.0 - chance)
        growth = (n + 1.0) * odds
        up = down = 1.0
        for i in range(1, int(away) + 1):
            if k > mode:
                up *= growth / (mode + i) - odds
            else:
                down *= growth / (k + i) - odds
        return v * down <= up
    log_v = log(v)
    rest = (away / variance) * (((away / 3.0 + 0.625) * away + 1.0 / 6.0) / variance + 0.5)
    parabola = -away * away / (2.0 * variance)
    if log_v < parabola - rest:
        return True
    if log_v > parabola + rest:
        return False
    return log_v <= _log_ratio(n, chance, k, mode)


@kernel
def _by_rejection(n: float, chance: float, key0: Any, key1: Any, block: Any, beam: Any, frame: Any) -> float:
    """A binomial number of mean 10 or more and a chance of at most 1/2.

    Hörmann, "The generation of binomial random variates", J. Stat. Comput. Simul. 46, 1993: BTRD, transformed rejection
    with decomposition and squeezes; 1.15 to 1.5 pairs of uniform numbers on average.
    """
    mode = float(math.floor((n + 1.0) * chance))
    variance = n * chance * (1.0 - chance)
    root = math.sqrt(variance)
    b = 1.15 + 2.53 * root
    a = -0.0873 + 0.0248 * b + 0.01 * chance
    c = n * chance + 0.5
    alpha = (2.83 + 5.1 / b) * root
    v_most = 0.92 - 4.2 / b
    trial = np.uint64(0)
    while True:
        first, second, _, _ = philox(key0, key1, block, beam, frame, trial)
        trial += np.uint64(1)
        v, other = unit(first), unit(second)
        if v <= 0.86 * v_most:
            u = v / v_most - 0.43
            return float(math.floor((2.0 * a / (0.5 - abs(u)) + b) * u + c))
        if v >= v_most:
            u = other - 0.5
        else:
            u = v / v_most - 0.93
            u = (0.5 if u > 0.0 else -0.5) - u
            v = other * v_most
        side = 0.5 - abs(u)
        if side <= 0.0 or v <= 0.0:
            continue
        k = float(math.floor((2.0 * a / side + b) * u + c))
        if k < 0.0 or k > n:
            continue
        if _accepted(v * alpha / (a / (side * side) + b), n, chance, k, mode, variance):
            return k


@kernel
def binomial_number(
    trials: int, chance: float, key0: Any, key1: Any, block: Any, beam: Any, frame: Any, inverse: FloatArray
) -> int:
    """How many of `trials` (below 2^50) come true, each with that chance. `inverse`: `INVERSES`."""
    if trials <= 0 or chance <= 0.0:
        return 0
    if chance >= 1.0:
        return trials
    rarer = min(chance, 1.0 - chance)
    if trials * rarer < _FEW:
        first, _, _, _ = philox(key0, key1, block, beam, frame, np.uint64(0))
        uniform = unit(first) * BELOW_ONE
        zero = exp(trials * log_rest(rarer))
        found = 0 if uniform < zero else from_zero(uniform, trials, zero, rarer / (1.0 - rarer), inverse)
    else:
        found = int(_by_rejection(float(trials), rarer, key0, key1, block, beam, frame))
    return found if chance <= 0.5 else trials - found


@kernel
def poisson_numbers(
    mean: FloatArray,
    key: npt.NDArray[np.uint64],
    frame: Any,
    beams: npt.NDArray[np.uint64],
    inverse: FloatArray,
    out: FloatArray,
) -> None:
    """A Poisson number of each `mean` (n,), below 2^39, drawn for each of `beams` (n,), into `out` (n,)."""
    for i in range(len(mean)):
        chance = mean[i] / _POISSON_TRIALS
        out[i] = binomial_number(_POISSON_TRIALS, chance, key[0], key[1], np.uint64(0), beams[i], frame, inverse)
