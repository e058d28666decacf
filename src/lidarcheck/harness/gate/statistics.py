"""The formulas behind the gate: pure functions of numbers, no verdicts.

Normal theory where it holds (means, Welch), exact counting where it does not (distances, missing values).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary

__all__ = [
    "POWER_Z",
    "Difference",
    "binomial_variance",
    "critical_count",
    "critical_t",
    "exceedance_tail",
    "missing_tail",
    "probability_caught",
    "sd_growth",
    "two_sample",
]

POWER_Z = 1.6449
"""Normal quantile of 95 %: the power at which the smallest catchable change is stated."""


class Difference(NamedTuple):
    """A difference of means, its standard error and the degrees of freedom of that error."""

    delta: float
    se: float
    df: float


def critical_t(share: float, df: float) -> float:
    """Two-sided critical value of Student's t: |T| exceeds it with probability `share` (0 < share < 1)."""
    from scipy.special import stdtrit

    return float(-stdtrit(df, share / 2.0))


def two_sample(old: tuple[float, float, int], new: tuple[float, float, int], floor_variance: float = 0.0) -> Difference:
    """Welch's difference new - old from (mean, standard deviation, number of seeds) of each.

    `floor_variance`: the least variance of one seed that is believed of both together, whatever the samples say. The
    degrees of freedom are Welch and Satterthwaite's.
    """
    parts = [(sd * sd / n, max(n - 1, 1)) for _, sd, n in (old, new)]
    variance = parts[0][0] + parts[1][0]
    spread = sum(part * part / df for part, df in parts)
    df = variance * variance / spread if spread > 0.0 else float(min(df for _, df in parts))
    least = floor_variance * (1.0 / old[2] + 1.0 / new[2])
    return Difference(new[0] - old[0], math.sqrt(max(variance, least)), max(df, 1.0))


def binomial_variance(old: tuple[float, float], new: tuple[float, float]) -> float:
    """Variance of one seed's proportion if both came from the same coin: Jeffreys' estimate from pooled counts.

    Each argument is (successes, trials) over all seeds; returned is p(1 - p), to be divided by the trials of one seed.
    Never zero, so that 0 of n and n of n have an error too.
    """
    successes, trials = old[0] + new[0], old[1] + new[1]
    p = (min(max(successes, 0.0), trials) + 0.5) / (trials + 1.0)
    return p * (1.0 - p)


def sd_growth(share: float, new: int, old: int) -> float:
    """The ratio of two standard deviations, new to old, that chance exceeds with probability `share` (Fisher's F)."""
    from scipy.special import fdtri

    return math.sqrt(1.0 / float(fdtri(old - 1, new - 1, share)))


def exceedance_tail(above: int, fresh: int, rank: int, null: int) -> float:
    """P(at least `above` of `fresh` values exceed the `rank`-th largest of `null` values), all from one distribution.

    Whatever that distribution is: the share above an order statistic is Beta(rank, null - rank + 1), so the count is
    beta-binomial (the negative hypergeometric tail). Ties make it conservative.
    """
    from scipy.special import betaln, gammaln

    counts: npt.NDArray[np.float64] = np.arange(max(above, 0), fresh + 1, dtype=np.float64)
    ways = gammaln(fresh + 1) - gammaln(counts + 1) - gammaln(fresh - counts + 1)
    weight = betaln(rank + counts, null - rank + 1 + fresh - counts) - betaln(rank, null - rank + 1)
    return min(float(elementary.exp(ways + weight).sum()), 1.0)


def critical_count(share: float, fresh: int, rank: int, null: int) -> int:
    """The smallest count above the `rank`-th largest null value whose tail is within `share`; fresh + 1 if none is."""
    for above in range(fresh + 1):
        if exceedance_tail(above, fresh, rank, null) <= share:
            return above
    return fresh + 1


def probability_caught(count: int, fresh: int, power: float = 0.95) -> float:
    """The chance per seed to exceed that gives at least `count` of `fresh` exceedances with probability `power`."""
    from scipy.special import betaincinv

    return float(betaincinv(count, fresh - count + 1, power)) if 0 < count <= fresh else 1.0


def missing_tail(old_missing: int, old: int, new_missing: int, new: int) -> float:
    """P(at least `new_missing` of `new` seeds give no value), given how many did in both runs together (Fisher)."""
    total = old_missing + new_missing
    ways = sum(
        math.comb(new, k) * math.comb(old, total - k)
        for k in range(new_missing, min(new, total) + 1)
        if total - k <= old
    )
    return ways / math.comb(old + new, total)
