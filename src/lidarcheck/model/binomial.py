"""One binomial number from one uniform number, by inversion."""

from __future__ import annotations

import math

from lidarcheck.model.jit import kernel

__all__ = ["binomial"]

_LN2 = 0.6931471805599453
_BELOW_ONE = 1.0 - 1e-12
"""Rounding may leave the largest uniform numbers above the sum of all terms; they must not run through all trials."""
_SAFE_EXPONENT = 600.0
"""exp(-600) is far from underflow; beyond it the sum starts at the mode's side instead of at zero."""


@kernel
def _from_zero(uniform: float, trials: int, log_miss: float, odds: float) -> int:
    """Smallest k with P(K <= k) > uniform, where one trial misses with probability exp(log_miss)."""
    term = math.exp(trials * log_miss)
    if uniform < term:
        return 0
    # Whole numbers in floating point: converting them in every step would cost more than the step.
    k, left = 0.0, float(trials)
    while uniform >= term and left > 0.0:
        uniform -= term
        k += 1.0
        term *= odds * left / k
        left -= 1.0
    return int(k)


@kernel
def _from_mode(uniform: float, trials: int, chance: float) -> int:
    """The same quantile for so many trials that P(K = 0) underflows: alternately up and down from the mode."""
    odds = chance / (1.0 - chance)
    mode = int((trials + 1) * chance)
    log_term = (
        math.lgamma(trials + 1.0)
        - math.lgamma(mode + 1.0)
        - math.lgamma(trials - mode + 1.0)
        + mode * math.log(chance)
        + (trials - mode) * math.log1p(-chance)
    )
    up = down = mode
    term_up = term_down = math.exp(log_term)
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


@kernel
def binomial(uniform: float, trials: int, rate: float) -> int:
    """Number of `trials` that fire, each with probability 1 - exp(-rate).

    Inversion of the distribution function: exact up to double rounding, and as many steps as trials that fire (or
    that do not, where those are fewer).
    """
    if trials <= 0 or rate <= 0.0:
        return 0
    if rate < _LN2:
        # exp(-x) >= 1 - x: most quiet bins are settled without an exponential.
        if uniform < 1.0 - trials * rate:
            return 0
        uniform *= _BELOW_ONE
        if trials * rate < _SAFE_EXPONENT:
            return _from_zero(uniform, trials, -rate, math.expm1(rate))
        return _from_mode(uniform, trials, -math.expm1(-rate))
    uniform *= _BELOW_ONE
    miss = math.exp(-rate)
    log_fire = math.log1p(-miss)
    if -trials * log_fire < _SAFE_EXPONENT:
        return trials - _from_zero(uniform, trials, log_fire, miss / (1.0 - miss))
    return trials - _from_mode(uniform, trials, miss)
