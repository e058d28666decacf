"""The exact chain: from the light of a beam to its echoes, bin by bin, for all detectors of a beam at once.

The N detectors of a beam are exchangeable, so the avalanche counts of the last `dead_bins` bins are all that the future
depends on: K_k ~ Binomial(armed_k, 1 - exp(-rate_k)). The chain runs explicitly where signal is expected; what lies
before and after is background alone, whose rare echoes `background.py` finds without visiting every bin.

Arrays of a beam's trace start `pad` bins before bin 0: bin k stands at index pad + k.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.model import background as bg
from lidarcheck.model.binomial import binomial, inverses
from lidarcheck.model.echoes import Echoes, find_echoes
from lidarcheck.model.jit import inlined, kernel
from lidarcheck.model.numbers import Numbers
from lidarcheck.model.pulses import Pulses, add_rates, window
from lidarcheck.model.streams import Stream, fill, rewind

__all__ = ["Scratch", "new_scratch", "simulate_beams", "trace_beams"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_RESERVE = 12
"""Draws set aside for entering the window, the last two of them for `is_quiet`; a beam in need of more fetches them."""
_FIRST_DRAW = np.uint64(_RESERVE)


class Scratch(NamedTuple):
    """What a thread works in: avalanches per bin, all zero; rates per bin; draws; 1 / k; background blocks."""

    counts: IntArray
    rates: FloatArray
    draws: FloatArray
    inverse: FloatArray
    blocks: bg.Blocks


def new_scratch(numbers: Numbers) -> Scratch:
    """Work space for one thread."""
    return Scratch(
        counts=np.zeros(2 * numbers.pad + numbers.bins, dtype=np.int64),
        rates=np.empty(numbers.bins),
        draws=np.empty(_RESERVE + numbers.bins + 4),
        inverse=inverses(numbers.detectors),
        blocks=bg.new_blocks(numbers.on, numbers.threshold, numbers.bins),
    )


@inlined
def _enter(numbers: Numbers, stream: Stream, scratch: Scratch, dead_rate: float, begin: int) -> int:
    """Put the avalanches of the `dead - 1` bins before `begin` into `counts` as background alone leaves them.

    In the steady state a detector is dead with probability (dead - 1) p / (1 + (dead - 1) p), its last avalanche
    equally likely in each of those bins: with probability 1 - exp(-dead_rate). Returns how many are dead.
    """
    draws = scratch.draws
    dead = binomial(draws[0], numbers.detectors, dead_rate, scratch.inverse)
    at, limit = 1, _RESERVE - 2
    for _ in range(dead):
        if at == limit:
            fill(stream, draws, 8)
            at, limit = 0, 8
        age = 1 + int(draws[at] * (numbers.dead - 1))
        scratch.counts[numbers.pad + begin - age] += 1
        at += 1
    return dead


@kernel
def _chain(numbers: Numbers, scratch: Scratch, begin: int, end: int, dead: int) -> None:
    """Run the avalanche counts from `begin` to `end - 1`, given `dead` detectors that are dead on entry."""
    counts, draws, rates = scratch.counts, scratch.draws, scratch.rates
    armed = numbers.detectors - dead
    first = np.uint64(numbers.pad + begin)
    rearmed = np.uint64(numbers.pad + begin - numbers.dead)
    for k in range(np.uint64(end - begin)):
        armed += counts[rearmed + k]
        fired = binomial(draws[_FIRST_DRAW + k], armed, rates[k], scratch.inverse)
        counts[first + k] = fired
        armed -= fired


@kernel
def trace_beams(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    scratch: Scratch,
    traces: npt.NDArray[np.int32],
) -> None:
    """Run the chain through all bins of every beam; `traces` (n, bins) takes the detectors ON in each bin."""
    counts, rates, draws = scratch.counts, scratch.rates, scratch.draws
    for i in range(len(beams)):
        rewind(stream, beams[i])
        rates[:] = per_bin[i]
        add_rates(pulses, i, 0, numbers.bins, rates)
        fill(stream, draws, _RESERVE + numbers.bins)
        dead_rate = math.log1p(-(numbers.dead - 1) * math.expm1(-per_bin[i]))
        dead = _enter(numbers, stream, scratch, dead_rate, 0)
        _chain(numbers, scratch, 0, numbers.bins, dead)
        for k in range(numbers.bins):
            on = 0
            for age in range(numbers.on):
                on += counts[numbers.pad + k - age]
            traces[i, k] = on
        counts[:] = 0


@kernel
def simulate_beams(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    start: int,
    stop: int,
    scratch: Scratch,
    echoes: Echoes,
) -> None:
    """Simulate the beams `start` ... `stop - 1`, independent of each other, into `echoes`.

    `beams` (n,): numbers that streams know them by; `per_bin` (n,): background avalanches per armed SPAD and bin.
    """
    counts, rates, draws, blocks = scratch.counts, scratch.rates, scratch.draws, scratch.blocks
    known = dead_rate = -1.0
    for i in range(start, stop):
        if per_bin[i] != known:
            known = per_bin[i]
            dead_rate = math.log1p(-(numbers.dead - 1) * math.expm1(-known))
            bg.tabulate(blocks, numbers.detectors, numbers.threshold, known)
        rewind(stream, beams[i])
        begin, end = window(numbers, pulses, i)
        if blocks.crowded[0]:
            begin, end = 0, numbers.bins
        rates[: end - begin] = known
        add_rates(pulses, i, begin, end, rates)
        fill(stream, draws, _RESERVE + end - begin)
        before, behind = draws[_RESERVE - 2], draws[_RESERVE - 1]
        dead = _enter(numbers, stream, scratch, dead_rate, begin)
        _chain(numbers, scratch, begin, end, dead)
        on_at_end = find_echoes(numbers, counts, begin, end, i, echoes)
        if bg.is_quiet(numbers, blocks, stream, draws, before, behind, begin, end, dead, on_at_end, counts):
            counts[numbers.pad + begin - numbers.dead : numbers.pad + end] = 0
        else:
            find_echoes(numbers, counts, 0, numbers.bins, i, echoes)
            counts[:] = 0
