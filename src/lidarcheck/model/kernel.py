"""The exact chain: from the light of a beam to its echoes, bin by bin, for all detectors of a beam at once.

The N detectors of a beam are exchangeable, so the avalanche counts of the last `dead_bins` bins are all that the future
depends on: K_k ~ Binomial(armed_k, 1 - exp(-rate_k)). The chain runs explicitly where signal is expected; what lies
before and after is background alone, whose rare echoes `background.py` finds without visiting every bin.

Arrays of a beam's trace start `pad` bins before bin 0: bin k stands at index pad + k.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.model import background as bg
from lidarcheck.model.binomial import binomial
from lidarcheck.model.jit import kernel
from lidarcheck.model.streams import Stream, fill, rewind
from lidarcheck.sensor import Sensor

__all__ = ["Echoes", "Numbers", "numbers_of", "simulate_beams"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_TAIL = 1e-9
"""Signal avalanches a beam may lose, on average, where its pulse is cut off."""
_RESERVE = 12
"""Draws set aside for entering the window, the last of them for `is_quiet`; a beam in need of more fetches them."""


class Numbers(NamedTuple):
    """The sensor as a kernel sees it; times in bins, `pad` bins of history before bin 0."""

    detectors: int
    on: int
    dead: int
    threshold: int
    bins: int
    pad: int
    sigma: float
    max_echoes: int


def numbers_of(sensor: Sensor) -> Numbers:
    """The sensor as kernels see it."""
    return Numbers(
        detectors=sensor.detectors,
        on=sensor.on_bins,
        dead=sensor.dead_bins,
        threshold=sensor.threshold,
        bins=sensor.bins,
        pad=sensor.dead_bins + 2 * sensor.on_bins + 2,
        sigma=sensor.sigma_ns / sensor.bin_ns,
        max_echoes=sensor.max_echoes,
    )


class Echoes(NamedTuple):
    """Echoes of each beam: `held` (n,), how many; per echo (n, max_echoes) centre [bins], width, area, peak."""

    held: IntArray
    centre: FloatArray
    width: IntArray
    area: IntArray
    peak: IntArray


@kernel
def _phi(x: float) -> float:
    """Distribution function of the standard normal."""
    return 0.5 * math.erfc(-0.7071067811865476 * x)


@kernel
def _reach(numbers: Numbers, signal: float) -> float:
    """How many bins from its centre a pulse matters: beyond, fewer than `_TAIL` avalanches are expected."""
    return numbers.sigma * math.sqrt(2.0 * math.log(max(numbers.detectors * signal / _TAIL, 1.0)))


@kernel
def _window(numbers: Numbers, times: FloatArray, signals: FloatArray, first: int, last: int) -> Any:
    """The bins in which the pulses `first` ... `last - 1` can set off avalanches, and their outputs' ON time."""
    begin, end = numbers.bins, 0
    for j in range(first, last):
        if signals[j] > 0.0:
            reach = _reach(numbers, signals[j])
            low = math.floor(times[j] - reach)
            high = math.ceil(times[j] + reach) + numbers.on
            begin = min(begin, max(low, 0))
            end = max(end, min(high, numbers.bins))
    if begin >= end:
        return 0, 0
    return begin, end


@kernel
def _add_rates(
    numbers: Numbers,
    times: FloatArray,
    signals: FloatArray,
    first: int,
    last: int,
    begin: int,
    end: int,
    rates: FloatArray,
) -> None:
    """Add the pulses' avalanches per armed SPAD to `rates` of the bins `begin` ... `end - 1` (index 0 is `begin`)."""
    for j in range(first, last):
        if signals[j] <= 0.0:
            continue
        reach = _reach(numbers, signals[j])
        low = max(math.floor(times[j] - reach), begin)
        high = min(math.ceil(times[j] + reach), end)
        before = _phi((low - times[j]) / numbers.sigma)
        for k in range(low, high):
            after = _phi((k + 1 - times[j]) / numbers.sigma)
            rates[k - begin] += signals[j] * (after - before)
            before = after


@kernel
def _enter(numbers: Numbers, stream: Stream, draws: FloatArray, per_bin: float, begin: int, counts: IntArray) -> int:
    """Put the avalanches of the `dead - 1` bins before `begin` into `counts` as background alone leaves them.

    In the steady state a detector is dead with probability (dead - 1) p / (1 + (dead - 1) p), its last avalanche
    equally likely in each of those bins. Returns how many are dead.
    """
    chance = -math.expm1(-per_bin)
    dead = binomial(draws[0], numbers.detectors, math.log1p((numbers.dead - 1) * chance))
    at, limit = 1, _RESERVE - 1
    for _ in range(dead):
        if at == limit:
            fill(stream, draws, 8)
            at, limit = 0, 8
        age = 1 + int(draws[at] * (numbers.dead - 1))
        counts[numbers.pad + begin - age] += 1
        at += 1
    return dead


@kernel
def _chain(
    numbers: Numbers, draws: FloatArray, rates: FloatArray, begin: int, end: int, dead: int, counts: IntArray
) -> None:
    """Run the avalanche counts from `begin` to `end - 1`, given `dead` detectors that are dead on entry."""
    armed = numbers.detectors - dead
    for k in range(begin, end):
        index = numbers.pad + k
        armed += counts[index - numbers.dead]
        fired = binomial(draws[_RESERVE + k - begin], armed, rates[k - begin])
        counts[index] = fired
        armed -= fired


@kernel
def _keep(echoes: Echoes, beam: int, centre: float, width: int, area: int, peak: int) -> None:
    """Add an echo, later than those kept so far; where there is no room, the one of smallest area goes."""
    room = echoes.area.shape[1]
    held = echoes.held[beam]
    if held == room:
        smallest = 0
        for j in range(1, room):
            if echoes.area[beam, j] <= echoes.area[beam, smallest]:
                smallest = j
        if area <= echoes.area[beam, smallest]:
            return
        for j in range(smallest, room - 1):
            echoes.centre[beam, j] = echoes.centre[beam, j + 1]
            echoes.width[beam, j] = echoes.width[beam, j + 1]
            echoes.area[beam, j] = echoes.area[beam, j + 1]
            echoes.peak[beam, j] = echoes.peak[beam, j + 1]
        held -= 1
    echoes.centre[beam, held] = centre
    echoes.width[beam, held] = width
    echoes.area[beam, held] = area
    echoes.peak[beam, held] = peak
    echoes.held[beam] = held + 1


@kernel
def _find_echoes(numbers: Numbers, counts: IntArray, begin: int, end: int, beam: int, echoes: Echoes) -> None:
    """Echoes of the bins `begin` ... `end - 1`: maximal runs with more than `threshold` detectors ON."""
    echoes.held[beam] = 0
    on = 0
    for k in range(begin - numbers.on + 1, begin):
        on += counts[numbers.pad + k]
    width = area = peak = 0
    moment = 0.0
    for k in range(begin, end):
        on += counts[numbers.pad + k]
        if on > numbers.threshold:
            width += 1
            area += on
            moment += on * (k + 0.5)
            peak = max(peak, on)
        if width > 0 and (on <= numbers.threshold or k == end - 1):
            _keep(echoes, beam, moment / area, width, area, peak)
            width = area = peak = 0
            moment = 0.0
        on -= counts[numbers.pad + k - numbers.on + 1]


@kernel
def simulate_beams(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    first_pulse: IntArray,
    times: FloatArray,
    signals: FloatArray,
    start: int,
    stop: int,
    echoes: Echoes,
) -> None:
    """Simulate the beams `start` ... `stop - 1`, independent of each other, into `echoes`.

    `beams` (n,): numbers that streams know them by; `per_bin` (n,): background avalanches per armed SPAD and bin;
    `times` [bins] and `signals` (n_pulses,): the pulses of beam i are `first_pulse[i]` ... `first_pulse[i + 1] - 1`.
    """
    counts = np.zeros(2 * numbers.pad + numbers.bins, dtype=np.int64)
    rates = np.empty(numbers.bins)
    draws = np.empty(_RESERVE + numbers.bins + 4)
    blocks = bg.new_blocks(numbers.detectors, numbers.on, numbers.threshold, numbers.bins)
    known = -1.0
    for i in range(start, stop):
        if per_bin[i] != known:
            known = per_bin[i]
            bg.tabulate(blocks, numbers.detectors, numbers.threshold, known)
        rewind(stream, beams[i])
        begin, end = _window(numbers, times, signals, first_pulse[i], first_pulse[i + 1])
        if blocks.crowded[0]:
            begin, end = 0, numbers.bins
        rates[: end - begin] = known
        _add_rates(numbers, times, signals, first_pulse[i], first_pulse[i + 1], begin, end, rates)
        fill(stream, draws, _RESERVE + end - begin)
        quiet_draw = draws[_RESERVE - 1]
        dead = _enter(numbers, stream, draws, known, begin, counts)
        _chain(numbers, draws, rates, begin, end, dead, counts)
        if bg.is_quiet(numbers, blocks, stream, draws, quiet_draw, begin, end, counts):
            _find_echoes(numbers, counts, begin, end, i, echoes)
            counts[numbers.pad + begin - numbers.dead : numbers.pad + end] = 0
        else:
            _find_echoes(numbers, counts, 0, numbers.bins, i, echoes)
            counts[:] = 0
