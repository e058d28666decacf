"""Kernels that find echoes in a histogram, as a chip does: what is expected, a matched filter, centroids."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel
from lidarcheck.model.detector_echoes import Candidates, Gate, add
from lidarcheck.model.histogram.numbers import HistogramNumbers
from lidarcheck.model.lane_math import log, log_rest, whole_below

__all__ = ["SearchSpace", "background_of", "coates", "find", "new_search_space"]

_STILL = 0.01
_ROUNDS = 10
_MOST_PEAKS = 64
"""Peaks of one histogram that are looked at, the strongest: a chip returns a few."""


class SearchSpace(NamedTuple):
    """Work space of one thread: shape (bins,) each, `peaks` the bins of peaks."""

    net: FloatArray
    floor: FloatArray
    score: FloatArray
    weight: FloatArray
    sorted: FloatArray
    peaks: IndexArray


def new_search_space(bins: int) -> SearchSpace:
    """Work space for histograms of that length."""
    net, floor, score, weight, ordered = np.empty((5, bins))
    return SearchSpace(net, floor, score, weight, ordered, np.empty(_MOST_PEAKS, dtype=np.int64))


@kernel
def coates(trials: int, counts: FloatArray) -> None:
    """Undo pile-up of first photons in place: counts of rates, N times -log(1 - H_k / trials left).

    Coates, "The correction for photon pile-up in the measurement of radiative lifetimes", J. Phys. E 1, 1968. A bin
    that takes all that is left is read as half a trial less.
    """
    left = float(trials)
    for k in range(len(counts)):
        count = counts[k]
        if left <= 0.0:
            counts[k] = 0.0
        elif count >= left:
            counts[k] = -trials * log(0.5 / left) if left > 0.5 else 0.0
        else:
            counts[k] = -trials * log_rest(count / left)
        left -= count


@kernel
def _lower_median(values: FloatArray, n: int) -> float:
    """The (n - 1) // 2-th of the first `n` values by size; they change places."""
    low, high, wanted = 0, n - 1, (n - 1) // 2
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if wanted <= j:
            high = j
        elif wanted >= i:
            low = i
        else:
            break
    found: float = values[wanted]
    return found


@kernel
def background_of(counts: FloatArray, work: FloatArray) -> float:
    """Counts a bin without an echo: of the last quarter's bins, the mean of those near their lower median."""
    n = len(counts) // 4
    first = len(counts) - n
    for k in range(n):
        work[k] = counts[first + k]
    median = _lower_median(work, n)
    most = 3.0 * math.sqrt(max(median, 1.0))
    total, number = 0.0, 0
    for k in range(n):
        if abs(work[k] - median) <= most:
            total += work[k]
            number += 1
    return total / number


@kernel
def _subtract(numbers: HistogramNumbers, counts: FloatArray, background: float, space: SearchSpace) -> None:
    """What is neither background nor cover glass into `net`; what is, at least 1, into `floor`."""
    seen = glass = 0.0
    for k in range(numbers.glass_first, numbers.glass_last):
        seen += counts[k] - background
        glass += numbers.glass[k]
    scale = max(seen / glass, 0.0) if glass > 0.0 else 0.0
    for k in range(len(counts)):
        still = background + scale * numbers.glass[k]
        space.net[k] = counts[k] - still
        space.floor[k] = max(still, 1.0)


@kernel
def _filter(template: FloatArray, space: SearchSpace) -> None:
    """The matched filter's score of each bin; beyond the ends of the histogram there is nothing."""
    bins, half = len(space.net), len(template) // 2
    for k in range(bins):
        space.score[k] = space.weight[k] = 0.0
    for j in range(-half, half + 1):
        p = template[j + half]
        square = p * p
        low, high = max(-j, 0), min(bins, bins - j)
        at, source = np.uint64(low), np.uint64(low + j)
        for k in range(np.uint64(max(high - low, 0))):
            space.score[at + k] += p * space.net[source + k]
            space.weight[at + k] += square * space.floor[source + k]
    for k in range(bins):
        space.score[k] = space.score[k] / math.sqrt(space.weight[k]) if space.weight[k] > 0.0 else 0.0


@kernel
def _strongest_peaks(numbers: HistogramNumbers, space: SearchSpace) -> int:
    """Write the bins of peaks above the threshold, none within a FWHM of a stronger one, to `peaks`; how many."""
    score, peaks, bins = space.score, space.peaks, len(space.score)
    held = 0
    while held < len(peaks):
        best = -1
        for k in range(bins):
            if score[k] <= numbers.threshold or (best >= 0 and score[k] <= score[best]):
                continue
            if (k > 0 and score[k] < score[k - 1]) or (k < bins - 1 and score[k] <= score[k + 1]):
                continue
            free = True
            for j in range(held):
                if abs(peaks[j] - k) <= numbers.fwhm:
                    free = False
            if free:
                best = k
        if best < 0:
            break
        peaks[held] = best
        held += 1
    return held


@kernel
def _centroid(net: FloatArray, begin: float, fwhm: float) -> Any:
    """Centre [bins], signal and bins of the window of a FWHM to either side that its own centroid is the middle of."""
    centre, total, width = begin, 0.0, 0.0
    for _ in range(_ROUNDS):
        low, high = max(centre - fwhm, 0.0), min(centre + fwhm, float(len(net)))
        total = moment = 0.0
        width = high - low
        for k in range(whole_below(low), min(whole_below(high) + 1, len(net))):
            part = min(high, k + 1.0) - max(low, float(k))
            total += part * net[k]
            moment += part * net[k] * (k + 0.5)
        if total <= 0.0:
            break
        before = centre
        centre = min(max(moment / total, low), high)
        if abs(centre - before) < _STILL:
            break
    return centre, total, width


@kernel
def find(
    numbers: HistogramNumbers,
    gate: Gate,
    counts: FloatArray,
    background: float,
    offset: float,
    space: SearchSpace,
    found: Candidates,
) -> int:
    """The echoes of a histogram that lie in the gate, nearest first, into `found`; returns how many."""
    _subtract(numbers, counts, background, space)
    _filter(numbers.template, space)
    held = 0
    for j in range(_strongest_peaks(numbers, space)):
        centre, signal, width = _centroid(space.net, space.peaks[j] + 0.5, numbers.fwhm)
        if signal > 0.0:
            path = (numbers.first + centre) * numbers.metres_per_bin + offset
            held = add(gate, found, held, path, signal, background * width)
    return held
