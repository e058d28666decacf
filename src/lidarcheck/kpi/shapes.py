"""Shapes of samples, as pictures show them: histogram, Q-Q, density, distribution function, violin.

Every function takes values of any shape; what is not finite is left out, and an empty sample gives empty arrays, never
an error. Samples of half a million values take milliseconds: what is drawn has some hundred points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray

__all__ = [
    "Density",
    "bin_edges",
    "counts",
    "densities",
    "distribution_steps",
    "finite",
    "log_edges",
    "quantile_pairs",
    "quartiles",
    "spread_out",
]

_TAIL = 4.0
"""A density is drawn so many bandwidths beyond the outermost values."""
_FINEST = 0.6
"""Bandwidth of a kernel in steps of quantised data: narrower ones draw a comb, which says how it was quantised."""
_WHOLE_SPAN = 1e6
_TAKEN = 65_536
"""So many values, evenly picked from the sorted sample, say how finely it is quantised."""


class Density(NamedTuple):
    """A kernel density estimate: `density` per unit of `x`, shapes (points,)."""

    x: FloatArray
    density: FloatArray


def finite(values: npt.ArrayLike) -> FloatArray:
    """The finite values as one column, shape (n,)."""
    sample = np.asarray(values, dtype=np.float64).ravel()
    good = np.isfinite(sample)
    return sample if bool(good.all()) else sample[good]


def bin_edges(samples: Sequence[npt.ArrayLike], bins: int = 40) -> FloatArray:
    """Edges of at most about `bins` bins that hold all samples, shape (k + 1,).

    Whole numbers get bins of whole width around them, so that no bin holds more of them than its neighbour.
    """
    good = [sample for sample in map(finite, samples) if sample.size]
    low = min((float(sample.min()) for sample in good), default=0.0)
    high = max((float(sample.max()) for sample in good), default=1.0)
    span = high - low
    if good and _whole(good, span):
        step = math.ceil((span + 1.0) / max(bins, 1))
        return low - 0.5 + step * np.arange(math.ceil((span + 1.0) / step) + 1.0)
    if not math.isfinite(span) or span <= 1e-9 * max(abs(low), abs(high)):
        room = 0.05 * max(abs(low), abs(high)) or 0.5
        low, high = low - room, high + room
    return np.linspace(low, high, max(bins, 1) + 1)


def log_edges(samples: Sequence[npt.ArrayLike], bins: int = 40) -> FloatArray:
    """Edges of about `bins` bins that are even on a logarithmic axis and hold all values above 0, shape (k + 1,).

    Whole numbers get bins around them that never become narrower: single numbers first, then ever more of them.
    """
    good = [sample[sample > 0.0] for sample in map(finite, samples)]
    good = [sample for sample in good if sample.size]
    low = min((float(sample.min()) for sample in good), default=1.0)
    high = max((float(sample.max()) for sample in good), default=10.0)
    ratio = elementary.power(high / low, 1.0 / max(bins, 1))
    if not good or not _whole(good, high):
        room = 0.0 if ratio > 1.0 + 1e-9 else 0.05
        even = np.linspace(elementary.log10(low) - room, elementary.log10(high) + room, max(bins, 1) + 1)
        edges = elementary.power(10.0, even)
        edges[[0, -1]] = min(edges[0], low), max(edges[-1], high)
        return np.asarray(edges, dtype=np.float64)
    whole = [low - 0.5]
    while whole[-1] < high:
        whole.append(whole[-1] + max(1.0, math.floor((whole[-1] + 0.5) * (ratio - 1.0))))
    return np.array(whole)


def spread_out(values: npt.ArrayLike) -> FloatArray:
    """Whole numbers, each spread evenly over the unit around it, in ascending order; other values as they are.

    For a density on a logarithmic axis, where the steps of small whole numbers are wide and those of large ones narrow.
    """
    sample = np.sort(finite(values))
    if not sample.size or not _whole([sample], _WHOLE_SPAN):
        return sample
    _, first, number = np.unique(sample, return_index=True, return_counts=True)
    rank = np.arange(sample.size) - np.repeat(first, number)
    return np.asarray(sample + (rank + 0.5) / np.repeat(number, number) - 0.5, dtype=np.float64)


def _whole(samples: Sequence[FloatArray], span: float) -> bool:
    """Whether all values are whole numbers, and not so far apart that it would not matter."""
    return span <= _WHOLE_SPAN and all(bool((sample == np.rint(sample)).all()) for sample in samples)


def counts(values: npt.ArrayLike, edges: FloatArray) -> FloatArray:
    """How many values lie in each bin, shape (len(edges) - 1,); the last bin holds its upper edge."""
    return np.histogram(finite(values), edges)[0].astype(np.float64)


def quantile_pairs(
    reference: npt.ArrayLike, values: npt.ArrayLike, most: int = 200
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(levels, quantiles of the reference, quantiles of the values) at common levels, shapes (k,).

    As many levels as the smaller sample has values, at most `most`, in the middle of equal shares. Equal distributions
    lie on the line y = x, shifted ones on a parallel, scaled ones on a line through another slope.
    """
    a, b = finite(reference), finite(values)
    number = min(a.size, b.size, most)
    if not number:
        return np.empty(0), np.empty(0), np.empty(0)
    levels = (np.arange(number) + 0.5) / number
    # The midpoint rule of Hazen: with as many levels as values, a quantile is the sorted value itself.
    return levels, np.quantile(a, levels, method="hazen"), np.quantile(b, levels, method="hazen")


def densities(samples: Sequence[npt.ArrayLike], points: int = 512) -> list[Density]:
    """The kernel density of each sample on a grid that all share; empty for an empty sample.

    Gaussian kernel, Silverman's bandwidth 0.9·min(s, IQR/1.349)·n^(−1/5) [Silverman 1986, eq. 3.31], no narrower than
    a step of quantised data or of the grid. Values are shared between their two neighbours on the grid (linear
    binning) and the bins convolved with the kernel. A sample without spread has the grid's narrowest bell.
    """
    good = [np.sort(finite(sample)) for sample in samples]
    widths = [_bandwidth(sample) for sample in good]
    filled = [(sample, width) for sample, width in zip(good, widths, strict=True) if sample.size]
    if not filled:
        return [Density(np.empty(0), np.empty(0)) for _ in good]
    low = min(float(sample[0]) - _TAIL * width for sample, width in filled)
    high = max(float(sample[-1]) + _TAIL * width for sample, width in filled)
    if high - low <= 1e-9 * max(abs(low), abs(high)) or not math.isfinite(high - low):
        room = 0.05 * max(abs(low), abs(high)) or 0.5
        low, high = low - room, high + room
    step = (high - low) / (points - 1)
    # Room for the bell of a sample without spread, whose width is the grid's.
    low, high = low - _TAIL * step, high + _TAIL * step
    x = np.linspace(low, high, points)
    return [
        Density(x, _convolved(sample, x, width)) if sample.size else Density(np.empty(0), np.empty(0))
        for sample, width in zip(good, widths, strict=True)
    ]


def distribution_steps(values: npt.ArrayLike, most: int = 512) -> tuple[FloatArray, FloatArray]:
    """(x, share of the values up to and with x): the empirical distribution function at up to about `most` steps.

    Exact at every x that it gives; between two of them it rises by at most 1/most more than one value's own share.
    """
    sample = np.sort(finite(values))
    if not sample.size:
        return np.empty(0), np.empty(0)
    taken = np.unique(np.linspace(0, sample.size - 1, min(most, sample.size)).round().astype(np.int64))
    x = np.unique(sample[taken])
    return x, np.searchsorted(sample, x, side="right") / sample.size


def quartiles(values: npt.ArrayLike) -> tuple[float, float, float]:
    """(lower quartile, median, upper quartile); NaN of an empty sample."""
    sample = finite(values)
    if not sample.size:
        return math.nan, math.nan, math.nan
    low, middle, high = np.quantile(sample, (0.25, 0.5, 0.75))
    return float(low), float(middle), float(high)


def _bandwidth(ordered: FloatArray) -> float:
    """Silverman's bandwidth, no narrower than a step of quantised data; 0 without spread."""
    if ordered.size < 2 or ordered[0] == ordered[-1]:
        return 0.0
    low, _, high = quartiles(ordered)
    spread = float(ordered.std(ddof=1))
    if high > low:
        spread = min(spread, (high - low) / 1.349)
    return float(max(0.9 * spread * elementary.power(ordered.size, -0.2), _FINEST * _quantum(ordered)))


def _quantum(ordered: FloatArray) -> float:
    """The usual step between values where most occur more than once; 0 for a continuous sample."""
    taken = ordered[:: -(-ordered.size // _TAKEN)]
    span = float(taken[-1] - taken[0])
    if span <= 0.0:
        return 0.0
    # Single precision: 0.1 + 0.2 and 0.3 are the same value of a quantised sample.
    distinct = np.unique(((taken - taken[0]) / span).astype(np.float32))
    if distinct.size < 2 or 2 * distinct.size > taken.size:
        return 0.0
    return span * float(np.median(np.diff(distinct.astype(np.float64))))


def _convolved(ordered: FloatArray, x: FloatArray, width: float) -> FloatArray:
    """The sample, linearly binned on the even grid `x`, under a Gaussian kernel; integrates to 1."""
    step = float(x[1] - x[0])
    place = (ordered - x[0]) / step
    left = np.clip(np.floor(place).astype(np.int64), 0, x.size - 2)
    part = np.clip(place - left, 0.0, 1.0)
    weight = np.bincount(left, 1.0 - part, x.size) + np.bincount(left + 1, part, x.size)
    width = max(width, step)
    reach = min(math.ceil(6.0 * width / step), x.size - 1)
    kernel = elementary.exp(-0.5 * (np.arange(-reach, reach + 1) * step / width) ** 2)
    kernel /= kernel.sum() * step
    length = x.size + kernel.size - 1
    smooth = np.fft.irfft(np.fft.rfft(weight, length) * np.fft.rfft(kernel, length), length)
    density = np.maximum(smooth[reach : reach + x.size], 0.0) / ordered.size
    return np.asarray(density, dtype=np.float64)
