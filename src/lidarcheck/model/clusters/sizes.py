"""How many avalanches a cluster may have, and background's clusters in a block of bins.

An avalanche tries to set off each of its neighbours, and what it sets off does the same. Taken as a tree without limits
- nobody is dead, the array has no edge, nobody is set off twice - a cluster has at least as many avalanches as the real
one, and sizes that are easily told: n avalanches make n - 1 tries in all with a probability that is two binomial laws,
and of n arrangements of these one is a tree (Dwass, J. Appl. Prob. 6 (1969) 682). So a block of bins has candidates of
background as in `exact/background.py`, in clusters: a compound Poisson law, by Panjer's recursion.
"""

from __future__ import annotations

import functools

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.blocks import Blocks, new_blocks
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_math import exp, log, log_rest

__all__ = ["most_rate", "sizes_of", "tabulate"]

_MOST = 96
"""Largest cluster, and most avalanches of a block, that are looked at."""
_TRIES = 4
"""Neighbours of a kind: at the sides, at the corners."""
_CERTAIN = 0.5
"""A chance of each neighbour above which no cluster ends; far above what is counted."""
_UNSEEN = 1e-12
"""Probability that a block has more avalanches than can be told, up to which that may be neglected."""
_MOST_PAIRS = 3.0
"""Expected crowded neighbours of a beam above which following each detector is the faster way."""


@functools.lru_cache(maxsize=16)
def sizes_of(sides: float, corners: float) -> FloatArray:
    """Probability of each size of a cluster, shape (_MOST + 1,); `sides`, `corners`: chance of each neighbour."""
    sizes = np.zeros(_MOST + 1)
    if max(sides, corners) < _CERTAIN:
        _fill_sizes(sides, corners, np.zeros(_TRIES * _MOST + 1), sizes)
    return sizes


@kernel
def _fill_sizes(sides: float, corners: float, log_factorial: FloatArray, sizes: FloatArray) -> None:
    for k in range(2, len(log_factorial)):
        log_factorial[k] = log_factorial[k - 1] + log(float(k))
    for n in range(1, len(sizes)):
        tries = _TRIES * n
        for k in range(n):
            other = n - 1 - k
            if (k > 0 and sides == 0.0) or (other > 0 and corners == 0.0):
                continue
            term = 2.0 * log_factorial[tries] - log_factorial[k] - log_factorial[tries - k]
            term -= log_factorial[other] + log_factorial[tries - other]
            term += (tries - k) * log_rest(sides) + (tries - other) * log_rest(corners)
            if k > 0:
                term += k * log(sides)
            if other > 0:
                term += other * log(corners)
            sizes[n] += exp(max(term, -700.0)) / n


@kernel
def tabulate(numbers: Numbers, blocks: Blocks, sizes: FloatArray, per_bin: float, totals: FloatArray) -> None:
    """Fill the tables of a background: `totals[n]`, probability of n avalanches in a block; and those of `blocks`."""
    most = len(blocks.above) - 1
    mean = numbers.detectors * blocks.length * per_bin
    blocks.rate[0] = per_bin
    totals[:] = 0.0
    totals[0] = exp(-min(mean, 700.0))
    largest = len(sizes) - 1
    while largest > 1 and sizes[largest] < 1e-18:
        largest -= 1
    for n in range(1, len(totals)):
        for size in range(1, min(n, largest) + 1):
            totals[n] += size * sizes[size] * totals[n - size]
        totals[n] *= mean / n
    tail = seen = 0.0
    for n in range(len(totals) - 1, most, -1):
        tail += totals[n]
    for n in range(most, -1, -1):
        blocks.above[n] = tail
        tail += totals[n]
        seen += totals[n]
    blocks.log_small[0] = log_rest(blocks.above[blocks.small])
    crowded = blocks.above[min(numbers.threshold, most)]
    for n in range(min(numbers.threshold, most) + 1):
        crowded += totals[n] * blocks.above[min(numbers.threshold - n, most)]
    blocks.pairs[0] = len(blocks.held) * crowded if seen >= 1.0 - _UNSEEN else np.inf


@functools.lru_cache(maxsize=16)
def most_rate(numbers: Numbers, sides: float, corners: float) -> float:
    """The highest background that is counted, avalanches per armed SPAD and bin; below 0 for too large clusters."""
    sizes, blocks = sizes_of(sides, corners), new_blocks(numbers)
    totals = np.zeros(len(sizes))
    low, high = 0.0, 1.0 / numbers.detectors
    tabulate(numbers, blocks, sizes, high * 1e-6, totals)
    if sizes.sum() < 1.0 - _UNSEEN or blocks.pairs[0] > _MOST_PAIRS:
        return -1.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        tabulate(numbers, blocks, sizes, middle, totals)
        low, high = (low, middle) if blocks.pairs[0] > _MOST_PAIRS else (middle, high)
    return low
