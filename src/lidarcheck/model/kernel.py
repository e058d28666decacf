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
from lidarcheck.model.binomial import binomial, inverses
from lidarcheck.model.jit import inlined, kernel
from lidarcheck.model.streams import Stream, fill, rewind
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Sensor

__all__ = [
    "Echoes",
    "Numbers",
    "Pulses",
    "Scratch",
    "new_scratch",
    "numbers_of",
    "pulses_of",
    "simulate_beams",
    "trace_beams",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_TAIL = 1e-6
"""Signal avalanches a beam may lose, on average, where its pulse is cut off."""
_PHASES = 512
"""Pulse positions within a bin that are tabulated; linear between them, the share of a bin is exact to 2e-8."""
_RESERVE = 12
"""Draws set aside for entering the window, the last two of them for `is_quiet`; a beam in need of more fetches them."""
_FIRST_DRAW = np.uint64(_RESERVE)


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


class Echoes(NamedTuple):
    """Echoes of each beam: `held` (n,), how many; per echo (n, max_echoes) centre [bins], width, area, peak."""

    held: npt.NDArray[np.int32]
    centre: FloatArray
    width: npt.NDArray[np.int32]
    area: npt.NDArray[np.int32]
    peak: npt.NDArray[np.int32]


class Pulses(NamedTuple):
    """The pulses of all beams: centre [bins], S, and how many bins to either side a pulse matters; each (n_pulses,).

    Beam i has the pulses `first[i]` ... `first[i + 1] - 1`. Beyond its reach, fewer than `_TAIL` avalanches of a pulse
    are expected in a beam; the reach is whole, so that a slightly changed signal meets the same draws in the same bins.
    `shares`, (phases + 1, bins), holds the share of a pulse's light in each bin around it; row p: a pulse p / phases of
    a bin behind the beginning of the middle bin.
    """

    first: IntArray
    centre: FloatArray
    signal: FloatArray
    reach: IntArray
    shares: FloatArray


def pulses_of(light: Light, sensor: Sensor, numbers: Numbers) -> Pulses:
    """The light's pulses as kernels see them."""
    from scipy.special import ndtr

    # A pulse far behind the end of the trace is as good as one just behind it, and its bin fits an integer.
    centre = np.minimum(2.0 * light.pulse_range_m / (LIGHT_SPEED_M_PER_NS * sensor.bin_ns), 1e9)
    expected = numbers.detectors * light.pulse_signal / _TAIL
    reach = np.ceil(numbers.sigma * np.sqrt(2.0 * np.log(np.maximum(expected, 1.0)))).astype(np.int64)
    half = int(reach.max(initial=0)) + 1
    edges = np.arange(-half, half + 2)
    phases = np.arange(_PHASES + 1) / _PHASES
    shares = np.ascontiguousarray(np.diff(ndtr((edges - phases[:, None]) / numbers.sigma), axis=1))
    return Pulses(light.first_pulse, centre, light.pulse_signal, reach, shares)


@inlined
def _window(numbers: Numbers, pulses: Pulses, beam: int) -> Any:
    """The bins in which the beam's pulses can set off avalanches, and their outputs' ON time."""
    begin, end = numbers.bins, 0
    for j in range(pulses.first[beam], pulses.first[beam + 1]):
        if pulses.signal[j] > 0.0:
            middle = math.floor(pulses.centre[j])
            low = middle - pulses.reach[j]
            high = middle + pulses.reach[j] + 1 + numbers.on
            begin = min(begin, max(low, 0))
            end = max(end, min(high, numbers.bins))
    if begin >= end:
        return 0, 0
    return begin, end


@inlined
def _add_rates(pulses: Pulses, beam: int, begin: int, end: int, rates: FloatArray) -> None:
    """Add the pulses' avalanches per armed SPAD to `rates` of the bins `begin` ... `end - 1` (index 0 is `begin`)."""
    half = pulses.shares.shape[1] // 2
    for j in range(pulses.first[beam], pulses.first[beam + 1]):
        centre, signal, reach = pulses.centre[j], pulses.signal[j], pulses.reach[j]
        if signal <= 0.0:
            continue
        middle = math.floor(centre)
        low = max(middle - reach, begin)
        high = min(middle + reach + 1, end)
        position = (centre - middle) * _PHASES
        phase = int(position)
        above = signal * (position - phase)
        below = signal - above
        nearer, farther = pulses.shares[phase], pulses.shares[phase + 1]
        column, bin_ = np.uint64(low - middle + half), np.uint64(low - begin)
        for k in range(np.uint64(max(high - low, 0))):
            rates[bin_ + k] += below * nearer[column + k] + above * farther[column + k]


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


@inlined
def _find_echoes(numbers: Numbers, counts: IntArray, begin: int, end: int, beam: int, echoes: Echoes) -> int:
    """Echoes of the bins `begin` ... `end - 1`: maximal runs with more than `threshold` detectors ON.

    Returns the detectors ON in the last bin, 0 where there is none.
    """
    echoes.held[beam] = 0
    on = 0
    for k in range(begin - numbers.on + 1, begin):
        on += counts[numbers.pad + k]
    bins = end - begin
    first = np.uint64(numbers.pad + begin)
    leaving = np.uint64(numbers.pad + begin - numbers.on + 1)
    width = area = peak = last = moment = 0
    for j in range(np.uint64(bins)):
        on += counts[first + j]
        last = on
        if on > numbers.threshold:
            width += 1
            area += on
            moment += on * np.int64(j)
            peak = max(peak, on)
        if width > 0 and (on <= numbers.threshold or np.int64(j) == bins - 1):
            _keep(echoes, beam, begin + 0.5 + moment / area, width, area, peak)
            width = area = peak = moment = 0
        on -= counts[leaving + j]
    return last


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
        _add_rates(pulses, i, 0, numbers.bins, rates)
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
        begin, end = _window(numbers, pulses, i)
        if blocks.crowded[0]:
            begin, end = 0, numbers.bins
        rates[: end - begin] = known
        _add_rates(pulses, i, begin, end, rates)
        fill(stream, draws, _RESERVE + end - begin)
        before, behind = draws[_RESERVE - 2], draws[_RESERVE - 1]
        dead = _enter(numbers, stream, scratch, dead_rate, begin)
        _chain(numbers, scratch, begin, end, dead)
        on_at_end = _find_echoes(numbers, counts, begin, end, i, echoes)
        if bg.is_quiet(numbers, blocks, stream, draws, before, behind, begin, end, dead, on_at_end, counts):
            counts[numbers.pad + begin - numbers.dead : numbers.pad + end] = 0
        else:
            _find_echoes(numbers, counts, 0, numbers.bins, i, echoes)
            counts[:] = 0


@kernel
def list_echoes(echoes: Echoes, row: IntArray, slot: IntArray, times: FloatArray, features: FloatArray) -> None:
    """Write all echoes one below the other: beam, place among its echoes, centre; width, area and peak in columns."""
    at = 0
    for i in range(len(echoes.held)):
        for j in range(echoes.held[i]):
            row[at] = i
            slot[at] = j
            times[at] = echoes.centre[i, j]
            features[0, at] = echoes.width[i, j]
            features[1, at] = echoes.area[i, j]
            features[2, at] = echoes.peak[i, j]
            at += 1
