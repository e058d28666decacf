"""The signal of each surface: what makes its echoes, their amplitudes and their losses likeliest.

A hit of amplitude a has the density N(a; S, sigma(S)), a miss of a fired beam the chance Phi((T - S)/sigma(S)). Well
above the threshold a miss is no sign of weakness, and the signal is that of the mean amplitude. Where the beams that
were fired are not known, what was seen is taken for what is left of a Gaussian above the threshold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtr

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.ideals.repeats.response import Response

__all__ = ["STRONG", "WEAK_UNFIRED", "Shots", "signals"]

STRONG = 4.0
"""Standard deviations above the threshold from which on a miss is no sign of weakness."""
WEAK_UNFIRED = 3.0
"""Standard deviations above the threshold below which nothing is judged where the fired beams are not known."""
_REACH = 5.0
_PLACES = 41
_CHUNK = 16384
_COARSE = 2.0
"""Steps of so many standard deviations leave the likelihood flat: then its mean stands for its maximum."""


@dataclass(frozen=True)
class Shots:
    """What was seen of surfaces; columns of shape (n,).

    `fired`, `hits`: how often; `mean`, `variance`: of the amplitudes (variance over hits, not unbiased); `low`, `high`:
    mean ends of what would be rounded to each; `capped`: all at the most that is reported.
    """

    fired: IndexArray
    hits: IndexArray
    mean: FloatArray
    variance: FloatArray
    low: FloatArray
    high: FloatArray
    capped: BoolArray


def signals(shots: Shots, response: Response, *, fired_known: bool = True) -> FloatArray:
    """The signal of each surface, shape (n,)."""
    signal = np.asarray(response.signal_of(shots.mean), dtype=np.float64)
    signal = np.where(shots.capped, signal + 3.0 * response.signal_sd(signal), signal)
    weak = np.flatnonzero((response.margin(signal) < STRONG) & ~shots.capped & np.isfinite(signal))
    found = signal.copy()
    for start in range(0, len(weak), _CHUNK):
        rows = weak[start : start + _CHUNK]
        found[rows] = _likeliest(shots, rows, signal[rows], response, fired_known)
    return found


def _likeliest(shots: Shots, rows: IndexArray, first: FloatArray, response: Response, fired_known: bool) -> FloatArray:
    width = response.signal_sd(first)
    step = 0.5 * (shots.high[rows] - shots.low[rows])
    places = np.linspace(-_REACH, _REACH - 1.0, _PLACES)
    grid = first[:, None] + (width + step)[:, None] * places
    grid = np.maximum(grid, 1e-3 * np.abs(first)[:, None] * np.exp(places) + 1e-12)
    weight = _log_likelihood(shots, rows, grid, response, fired_known)
    best = np.argmax(weight, axis=1)
    flat = 2.0 * step > _COARSE * width
    return np.where(flat, _mean(grid, weight), _peak(grid, weight, best))


def _log_likelihood(
    shots: Shots, rows: IndexArray, grid: FloatArray, response: Response, fired_known: bool
) -> FloatArray:
    """Shape (n, places)."""
    hits, fired = shots.hits[rows, None].astype(np.float64), shots.fired[rows, None].astype(np.float64)
    sd, mean = response.amplitude_sd(grid), response.amplitude(grid)
    margin = response.margin(grid)
    low, high = shots.low[rows, None], shots.high[rows, None]
    step = high - low
    coarse = step > _COARSE * response.amplitude_sd(shots.mean[rows])[:, None]
    off = shots.variance[rows, None] + (shots.mean[rows, None] - mean) ** 2
    plain = -hits * (0.5 * off / (sd * sd) + np.log(sd))
    inside = ndtr((high - mean) / sd) - ndtr((low - mean) / sd)
    found = np.where(coarse, hits * np.log(np.maximum(inside, 1e-300)), plain)
    if not fired_known:
        return np.asarray(found - hits * log_ndtr(margin) if response.latent else found)
    if not response.latent:
        found = found + hits * log_ndtr(margin)
    return np.asarray(found + (fired - hits) * log_ndtr(-margin))


def _peak(grid: FloatArray, weight: FloatArray, best: IndexArray) -> FloatArray:
    """The maximum of the parabola through the best place and its neighbours."""
    row = np.arange(len(grid))
    at = np.clip(best, 1, grid.shape[1] - 2)
    (x0, x1, x2), (y0, y1, y2) = (tuple(a[row, at + k] for k in (-1, 0, 1)) for a in (grid, weight))
    with np.errstate(divide="ignore", invalid="ignore"):
        over = (y1 - y0) * (x2 - x1) * (x2 + x1) - (y2 - y1) * (x1 - x0) * (x1 + x0)
        under = 2.0 * ((y1 - y0) * (x2 - x1) - (y2 - y1) * (x1 - x0))
        peak = over / under
    inside = np.isfinite(peak) & (peak >= x0) & (peak <= x2)
    return np.where(inside, peak, grid[row, best])


def _mean(grid: FloatArray, weight: FloatArray) -> FloatArray:
    likelihood = np.exp(weight - weight.max(axis=1, keepdims=True))
    spacing = np.gradient(grid, axis=1)
    mass = likelihood * spacing
    return np.asarray((mass * grid).sum(axis=1) / np.maximum(mass.sum(axis=1), 1e-300))
