"""One binomial number from one uniform number, by inversion."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.lane_math import LN2, exp, expm1, fired, lgamma, log, log1m, log_rest

__all__ = ["BELOW_ONE", "binomial", "from_zero", "inverses"]


_ONE, _TWO, _THREE, _FOUR = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
BELOW_ONE = 1.0 - 1e-12
"""Rounding may leave the largest uniform numbers above the sum of all terms; they must not run through all trials."""
_SAFE_EXPONENT = 600.0
"""exp(-600) is far from underflow; beyond it the sum starts at the mode's side instead of at zero."""


def inverses(trials: int) -> FloatArray:
    """1 / k for k up to trials + 4, shape (trials + 5,); the first, for k = 0, is never used."""
    return 1.0 / np.maximum(np.arange(trials + 5), 1)


@inlined
def from_zero(uniform: float, trials: int, zero: float, odds: float, inverse: FloatArray) -> int:
    """Smallest k with P(K <= k) > uniform, where P(K = 0) = `zero`.

    P(k) = P(k - 1) odds (trials - k + 1) / k. Four terms a step, their ratios multiplied before the first of them is
    known: a step then waits for one product, not for four.
    """
    growth = odds * (trials + 1.0)
    term = zero
    # An unsigned index cannot count from the array's end, which saves the test for it.
    k, last = np.uint64(0), np.uint64(trials)
    while k <= last:
        one = growth * inverse[k + _ONE] - odds
        two = one * (growth * inverse[k + _TWO] - odds)
        three = two * (growth * inverse[k + _THREE] - odds)
        four = two * ((growth * inverse[k + _THREE] - odds) * (growth * inverse[k + _FOUR] - odds))
        up_to_one = 1.0 + one
        up_to_two = up_to_one + two
        step = term * (up_to_two + three)
        if uniform < step:
            above_zero = 1 if uniform >= term else 0
            above_one = 1 if uniform >= term * up_to_one else 0
            above_two = 1 if uniform >= term * up_to_two else 0
            return int(k) + above_zero + above_one + above_two
        uniform -= step
        term *= four
        k += _FOUR
    return trials


@kernel
def _from_mode(uniform: float, trials: int, chance: float) -> int:
    """The same quantile for so many trials that P(K = 0) underflows: alternately up and down from the mode."""
    odds = chance / (1.0 - chance)
    mode = int((trials + 1) * chance)
    log_term = (
        lgamma(trials + 1.0)
        - lgamma(mode + 1.0)
        - lgamma(trials - mode + 1.0)
        + mode * log(chance)
        + (trials - mode) * log_rest(chance)
    )
    up = down = mode
    term_up = term_down = exp(max(log_term, -700.0))
    if uniform < term_up:
        return mode
    uniform -= term_up
    while up < trials or down > 0:
        if up < trials:
            up += 1
            term_up *= odds * (trials - up + 1) / up
            if uniform < term_up:
                return up
            uniform -= term_up
        if down > 0:
            term_down *= down / (odds * (trials - down + 1))
            down -= 1
            if uniform < term_down:
                return down
            uniform -= term_down
        if term_up < 1e-18 and term_down < 1e-18:
            break
    return mode


@inlined
def binomial(uniform: float, trials: int, rate: float, inverse: FloatArray) -> int:
    """Number of `trials` that fire, each with probability 1 - exp(-rate).

    Inversion of the distribution function: exact up to double rounding, and as many steps as trials that fire (or
    that do not, where those are fewer). `inverse[k]` is 1 / k, up to at least trials + 4: see `inverses`.
    """
    if trials <= 0 or rate <= 0.0:
        return 0
    if rate < LN2:
        # exp(-x) >= 1 - x: most quiet bins are settled without an exponential.
        if uniform < 1.0 - trials * rate:
            return 0
        uniform *= BELOW_ONE
        if trials * rate < _SAFE_EXPONENT:
            zero = exp(-trials * rate)
            return 0 if uniform < zero else from_zero(uniform, trials, zero, expm1(rate), inverse)
        return _from_mode(uniform, trials, fired(rate))
    uniform *= BELOW_ONE
    miss = exp(-min(rate, 600.0))
    log_fire = log1m(miss)
    if -trials * log_fire < _SAFE_EXPONENT:
        return trials - from_zero(uniform, trials, exp(trials * log_fire), miss / (1.0 - miss), inverse)
    return trials - _from_mode(uniform, trials, miss)
