"""How many candidates of background a block of bins holds: tables for `background.py`, which says what they are for."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_math import exp, fired, lgamma, log, log_rest

__all__ = ["Blocks", "count", "count_large", "count_small", "new_blocks", "tabulate"]

_MOST = 64
"""Largest candidate count of a block; where more is not negligible, the chain runs explicitly through all bins."""
_CROWDED_CALM = 1e-3
"""The same for a rate that is chosen, so that visiting fewer bins pays."""


class Blocks(NamedTuple):
    """Candidates per block of `length` bins. `above[c]`: probability of more than c; `small`: the most that two
    neighbours may each hold without being crowded; `log_small[0]`: logarithm of the probability that a block is small;
    `held`, `crowds`: what a search knows of each block, and which are the second of crowded neighbours; `pairs[0]`: how
    many such are to be expected in a trace, infinite where the tables cannot tell; `rate[0]`: the candidates' rate per
    detector and bin; `calm`: a rate up to which blocks settle almost every beam without a closer look.
    """

    length: int
    small: int
    above: FloatArray
    log_small: FloatArray
    held: IndexArray
    crowds: IndexArray
    cells: IndexArray
    pairs: FloatArray
    rate: FloatArray
    calm: float


def new_blocks(numbers: Numbers) -> Blocks:
    """Blocks of a sensor, before a background rate is known."""
    length = max(numbers.on - 1, 1)
    return Blocks(
        length,
        min(numbers.threshold // 2, _MOST),
        np.zeros(_MOST + 1),
        np.zeros(1),
        np.zeros(numbers.bins // length + 4, dtype=np.int64),
        np.zeros(numbers.bins // length + 4, dtype=np.int64),
        np.zeros(_MOST + 1, dtype=np.int64),
        np.zeros(1),
        np.zeros(1),
        _calm_rate(numbers, length, _CROWDED_CALM),
    )


@functools.lru_cache(maxsize=16)
def _calm_rate(numbers: Numbers, length: int, crowded: float) -> float:
    """The rate at which two neighbours hold so many candidates that they are crowded in that share of beams."""
    from scipy.special import gammaincinv

    most = float(gammaincinv(numbers.threshold + 1.0, min(crowded * length / numbers.bins, 0.5)))
    return min(most, 0.25 * _MOST) / (2.0 * numbers.detectors * length)


@kernel
def _log_binomial_term(trials: int, k: int, per_bin: float) -> float:
    """Logarithm of P(K = k) for `trials` cells of chance 1 - exp(-per_bin)."""
    return (
        lgamma(trials + 1.0)
        - lgamma(k + 1.0)
        - lgamma(trials - k + 1.0)
        + k * log(fired(per_bin))
        - (trials - k) * per_bin
    )


@kernel
def _tail(trials: int, above: int, per_bin: float) -> float:
    """P(K > above), summed from the far end so that small tails keep their digits."""
    total = 0.0
    for k in range(min(trials, above + 4 * _MOST), above, -1):
        total += exp(max(_log_binomial_term(trials, k, per_bin), -700.0))
    return min(total, 1.0)


@kernel
def tabulate(blocks: Blocks, detectors: int, threshold: int, per_bin: float) -> None:
    """Fill the table for a background rate."""
    cells = detectors * blocks.length
    mean = cells * per_bin
    blocks.rate[0] = per_bin
    if mean <= 0.0:
        blocks.above[:] = 0.0
        blocks.log_small[0] = 0.0
        blocks.pairs[0] = 0.0
        return
    if mean > 0.25 * _MOST:
        blocks.pairs[0] = np.inf
        return
    blocks.above[_MOST] = _tail(cells, _MOST, per_bin)
    for c in range(_MOST - 1, -1, -1):
        term = exp(max(_log_binomial_term(cells, c + 1, per_bin), -700.0)) if c < cells else 0.0
        blocks.above[c] = min(blocks.above[c + 1] + term, 1.0)
    blocks.log_small[0] = log_rest(blocks.above[blocks.small])
    pairs = len(blocks.held) * _tail(2 * cells, threshold, per_bin)
    blocks.pairs[0] = pairs if blocks.above[_MOST] <= 1e-15 else np.inf


@kernel
def count(blocks: Blocks, survival: float, least: int = 0) -> int:
    """Candidates of a block: the smallest c with P(more than c) below a uniform number in (0, 1]; `least` at least."""
    c = least
    while c < _MOST and blocks.above[c] >= survival:
        c += 1
    return c


@kernel
def count_large(blocks: Blocks, draw: float) -> int:
    """Candidates of a block that is known not to be small."""
    return count(blocks, blocks.above[blocks.small] * (1.0 - draw), min(blocks.small + 1, _MOST))


@kernel
def count_small(blocks: Blocks, draw: float) -> int:
    """Candidates of a block that is known to be small."""
    return count(blocks, 1.0 - draw * (1.0 - blocks.above[blocks.small]))
