"""Dead time of a SPAD that is read as a histogram: many laser cycles, their avalanches counted per bin.

The mean of the chain that the sensor model runs: of the cycles that are armed in bin k the share 1 − exp(−λ_k)
avalanches, and an avalanche in bin k leaves the SPAD dead until bin k + dead_bins. With a dead time longer than the
record only the first photon of a cycle counts (TCSPC), and P. B. Coates' correction (J. Phys. E 1, 1968, 878) is the
exact inverse. For a SPAD that re-arms within the record the same inverse takes only the avalanches of the last dead
time off the armed cycles (Isbaner et al., Opt. Express 24, 2016, 9429); the original would be wrong there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError

__all__ = ["LateBackground", "coates_rate", "expected_counts", "late_background"]


class LateBackground(NamedTuple):
    """Counts expected in a late window, their standard deviation, and those observed; shapes (...)."""

    expected: FloatArray
    sigma: FloatArray
    observed: FloatArray


def expected_counts(
    rate: npt.ArrayLike, cycles: float, *, dead_bins: int | None = None, background: float | None = None
) -> FloatArray:
    """Expected avalanches per bin, shape (..., n_bins), over a number of laser cycles.

    `rate`: λ, avalanches per bin that one always-armed SPAD would see on average, shape (..., n_bins). `dead_bins`: 1
    = ready again in the next bin, None = dead until the record ends. `background`: the rate per bin before the
    record, which leaves part of the cycles dead at its start, in the steady state; None: every cycle starts armed.
    """
    rates = np.asarray(rate, dtype=np.float64)
    bins = rates.shape[-1]
    dead = _dead(dead_bins, bins)
    if np.any(~(rates >= 0.0)) or (background is not None and not background >= 0.0):
        raise UsageError("a rate is negative or not a number", fix="give avalanches per bin, 0 or more")
    if background is not None and dead_bins is None and background > 0.0:
        raise UsageError("there is no steady state without an end of the dead time", fix="give dead_bins")
    fired = -elementary.expm1(-rates)
    before = 0.0 if background is None else -elementary.expm1(-background)
    steady = cycles / (1.0 + before * (dead - 1))
    armed = np.full(rates.shape[:-1], steady)
    counts = np.empty_like(rates)
    for k in range(bins):
        counts[..., k] = armed * fired[..., k]
        # Back after their dead time: avalanches of this record, or of the steady state before it.
        returned = counts[..., k + 1 - dead] if k + 1 >= dead else steady * before
        armed = armed - counts[..., k] + returned
    return counts


def coates_rate(counts: npt.ArrayLike, cycles: float, *, dead_bins: int | None = None) -> FloatArray:
    """Rates per bin from counts, shape (..., n_bins): λ_i = −ln(1 − h_i/(N − Σ h_j)), the inverse of `expected_counts`.

    The sum runs over the bins before i that still leave a cycle dead in i: all of them (Coates) for `dead_bins` None.
    Every cycle starts armed. `UsageError`: more counts than armed cycles. Infinite where every armed cycle
    avalanched; where none is armed, 0.
    """
    h = np.asarray(counts, dtype=np.float64)
    armed = _armed(h, cycles, dead_bins)
    if np.any(h < 0.0) or np.any(h > armed + 1e-9 * cycles):
        raise UsageError(
            f"a bin has more counts than the {cycles:g} cycles leave armed, or fewer than 0",
            fix="give the number of laser cycles of the whole record",
        )
    share = np.divide(h, armed, out=np.zeros_like(h), where=(armed > 0.0) & (h > 0.0))
    with np.errstate(divide="ignore"):
        return np.asarray(-elementary.log1p(-np.minimum(share, 1.0)), dtype=np.float64)


def late_background(
    counts: npt.ArrayLike, cycles: float, *, early: slice, late: slice, dead_bins: int | None = None
) -> LateBackground:
    """Background expected in a late window, from the rate of an early one and the dead time alone; nothing is fitted.

    `counts`: histograms, shape (..., n_bins); `early`, `late`: windows of bins that hold background alone, before and
    after the return. The rates up to the late window are those of the counts (`coates_rate`), within it the
    background's; `expected_counts` turns them into counts. `sigma` holds the Poisson errors of both windows. Results
    have shape (...); without early counts expected and sigma are 0.
    """
    h = np.asarray(counts, dtype=np.float64)
    seen = h[..., early].sum(axis=-1)
    exposure = _armed(h, cycles, dead_bins)[..., early].sum(axis=-1)
    background = -elementary.log1p(-np.divide(seen, exposure, out=np.zeros_like(seen), where=exposure > 0.0))
    rate = coates_rate(h, cycles, dead_bins=dead_bins)
    rate[..., late] = background[..., None]
    expected = expected_counts(rate, cycles, dead_bins=dead_bins)[..., late].sum(axis=-1)
    from_early = np.divide(expected, np.sqrt(seen), out=np.zeros_like(seen), where=seen > 0.0)
    return LateBackground(expected, np.sqrt(expected + from_early**2), h[..., late].sum(axis=-1))


def _dead(dead_bins: int | None, bins: int) -> int:
    if dead_bins is None:
        return bins + 1
    if dead_bins < 1:
        raise UsageError(f"dead_bins = {dead_bins} is below 1", fix="1 is a SPAD that is ready again in the next bin")
    return dead_bins


def _armed(counts: FloatArray, cycles: float, dead_bins: int | None) -> FloatArray:
    """Cycles that are armed in each bin, shape (..., n_bins), by the counts before it."""
    bins = counts.shape[-1]
    dead = _dead(dead_bins, bins)
    upto = np.concatenate([np.zeros((*counts.shape[:-1], 1)), np.cumsum(counts, axis=-1)], axis=-1)
    back = np.maximum(np.arange(bins) - dead + 1, 0)
    return np.asarray(cycles - (upto[..., :bins] - upto[..., back]), dtype=np.float64)
