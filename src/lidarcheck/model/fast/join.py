"""Beams in haze: a history of the haze up to where something else comes back, and the exact chain from there on.

What the chain must know of the bins before a window is the avalanches of one dead time, and the echo that is open
there; both are a history's.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray, WordArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.abreast import RESERVE, Abreast, find_abreast, new_abreast, run_abreast
from lidarcheck.model.exact.binomial import inverses
from lidarcheck.model.exact.echoes import EchoArrays, keep, new_echoes
from lidarcheck.model.exact.haze_rates import add_haze
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulse_form import PHASES
from lidarcheck.model.exact.pulses import Pulses, add_pulses
from lidarcheck.model.fast.alarms import Alarms
from lidarcheck.model.fast.draw import chance_of_any
from lidarcheck.model.fast.histories import FIELDS, Histories
from lidarcheck.model.fast.special import insert, new_found
from lidarcheck.model.lane_math import LANES, exp, whole_below
from lidarcheck.model.streams import Stream, fill_abreast, philox, unit

__all__ = ["Work", "join_beams", "new_work"]

_ECHOES = 8
_MOST_CLUMPS = 16
_MARGIN = 2
"""Bins of background behind a window, so that few echoes end with it."""


class Work(NamedTuple):
    """Work space of a thread."""

    group: Abreast
    inverse: FloatArray
    rates: FloatArray
    echoes: EchoArrays
    found: FloatArray


def new_work(numbers: Numbers) -> Work:
    """Work space for one thread."""
    rates = np.zeros(numbers.bins)
    return Work(new_abreast(numbers), inverses(numbers.detectors), rates, new_echoes(LANES, _ECHOES), new_found())


@inlined
def _nearer(reach: Any, nearer2: float) -> Any:
    """A reach beyond which a thousand times more is lost: a thousandth of an avalanche of a beam's many."""
    return math.ceil(math.sqrt(max(reach * reach - nearer2, 0.0)))


@inlined
def _window(numbers: Numbers, pulses: Pulses, end_of_history: int, nearer2: float, i: Any) -> Any:
    """The bins of a beam that differ from a history: its pulses' and those where its haze ends."""
    haze = pulses.haze
    begin, end = end_of_history, 0
    for j in range(pulses.first[i], pulses.first[i + np.uint64(1)]):
        if pulses.signal[j] > 0.0:
            middle = whole_below(pulses.centre[j])
            begin = min(begin if end > 0 else numbers.bins, middle - _nearer(pulses.reach[j], nearer2))
            end = max(end, middle + _nearer(pulses.reach_behind[j], nearer2) + 1)
    at = whole_below(min(haze.end[haze.first[i]], 2.0 * haze.last))
    before = at - _nearer(haze.before, nearer2) - 1
    if before < end_of_history:
        begin = min(begin, before)
        end = max(end, at + _nearer(haze.behind, nearer2) + 1)
    if end > 0:
        end += numbers.on + _MARGIN
    begin, end = min(max(begin, 0), numbers.bins), min(end, numbers.bins)
    return begin, max(end, begin)


@inlined
def _history(histories: Histories, group: Abreast, lane: Any, row: int) -> Any:
    """Which history a lane draws: for what lies before its window, or, with the next row of draws, for the entry."""
    return np.int64(group.draws[row * LANES + lane] * histories.counts.shape[0])


@inlined
def _fetch(numbers: Numbers, histories: Histories, held: int, work: Work) -> None:
    """Touch what lanes are to read of their histories: reads that wait for memory then wait together."""
    group, touched = work.group, 0.0
    for lane in range(held):
        at = min(group.begin[lane], histories.end) - histories.start
        h, entry = (
            _history(histories, group, lane, 0),
            _history(histories, group, lane, 0 if group.begin[lane] <= histories.end else 1),
        )
        touched += histories.counts[entry, at - numbers.dead] + histories.counts[entry, at - 1]
        touched += histories.echoes[h, 0] + histories.echoes[h, histories.echoes.shape[1] // 2]
    work.rates[0] = touched


@inlined
def _enter(
    numbers: Numbers, histories: Histories, pulses: Pulses, per_bin: float, i: Any, lane: Any, work: Work
) -> None:
    """Put a history's avalanches before the window, and the rates in it."""
    group = work.group
    begin, length = group.begin[lane], group.length[lane]
    # Behind the end of the haze any history's last dead time will do: nothing is left of what came before.
    at = min(begin, histories.end)
    h = _history(histories, group, lane, 0 if begin <= histories.end else 1)
    dead: Any = 0
    column = at - histories.start - numbers.dead
    for k in range(1, numbers.dead):
        count = np.int64(histories.counts[h, column + k])
        group.counts[k * LANES + lane] = count
        dead += count
    group.dead[lane] = dead
    rates = work.rates
    for k in range(np.uint64(length)):
        rates[k] = per_bin
    _add_haze(pulses, i, begin, begin + length, rates)
    add_pulses(pulses, i, begin, begin + length, rates)
    step, first = np.uint64(LANES), np.uint64(lane)
    for k in range(np.uint64(length)):
        group.rates[k * step + first] = rates[k]


@inlined
def _add_part(weight: float, source: FloatArray, at: int, low: int, high: int, origin: int, rates: FloatArray) -> None:
    """Add `weight` times a row that begins in bin `at` to the bins `low` ... `high - 1`; rates begin with `origin`."""
    # An unsigned index cannot count from the array's end, which saves the test for it.
    column, bin_ = np.uint64(low - at), np.uint64(low - origin)
    for k in range(np.uint64(max(high - low, 0))):
        rates[bin_ + k] += weight * source[column + k]


@inlined
def _add_haze(pulses: Pulses, i: Any, begin: int, end: int, rates: FloatArray) -> None:
    """Add the haze of a beam that has one row; `add_haze` for this case."""
    haze = pulses.haze
    row = haze.first[i]
    share, at = haze.share[row], haze.end[row]
    cell = int(min(at / haze.step, 1e9))
    if cell >= len(haze.density):
        _add_part(share, haze.whole, 0, begin, min(end, haze.last), begin, rates)
    elif haze.stride > 1:
        add_haze(haze, i, begin, end, rates)
    else:
        start = cell * haze.step
        first = whole_below(start) - haze.before - 1
        last = first + haze.cut.shape[1]
        _add_part(share, haze.whole, 0, begin, min(end, first), begin, rates)
        _add_part(share, haze.cut[cell], first, max(first, begin), min(last, end), begin, rates)
        # The cell that the row ends in is a third of a bin at most: its light is a pulse's in the middle.
        light, centre = share * haze.density[cell] * (at - start), 0.5 * (start + at)
        middle = whole_below(centre)
        first = middle - pulses.middle
        last = first + pulses.shares.shape[1]
        shares = pulses.shares[int((centre - middle) * PHASES)]
        _add_part(light, shares, first, max(first, begin), min(last, end), begin, rates)


@kernel
def _begun(numbers: Numbers, histories: Histories, h: Any, first: Any, last: Any) -> Any:
    """Area, first moment and peak of a history's echo in the bins `first` ... `last - 1`."""
    counts, zero = histories.counts[h], -histories.start
    on: Any = 0
    area = moment = peak = 0
    for k in range(first - numbers.on + 1, first):
        on += np.int64(counts[zero + k])
    for bin_ in range(first, last):
        on += np.int64(counts[zero + bin_])
        area, moment, peak = area + on, moment + on * bin_, max(peak, on)
        on -= np.int64(counts[zero + bin_ - numbers.on + 1])
    return area, moment, peak


@kernel
def _merge(numbers: Numbers, histories: Histories, lane: int, work: Work) -> int:
    """The echoes of a lane's history before its window and of the window; how many."""
    group, found, local = work.group, work.found, work.echoes
    begin, length = group.begin[lane], group.length[lane]
    h = _history(histories, group, lane, 0)
    end = min(begin, histories.end)
    on = 0.0
    if length > 0 and begin <= histories.end:
        for age in range(numbers.on):
            on += group.counts[(numbers.dead - age) * LANES + lane]
    held, taken = 0, 0
    before = histories.echoes[h]
    for j in range(1, 1 + FIELDS * before[0], FIELDS):
        first, last = np.int64(before[j]), np.int64(before[j + 1])
        if last < end:
            centre = before[j + 3] / before[j + 2] + 0.5
            held = insert(found, held, centre, last - first, np.int64(before[j + 2]), np.int64(before[j + 4]))
        elif first < end:
            area, moment, peak = _begun(numbers, histories, h, first, end)
            centre, width = moment / area + 0.5, end - first
            if on > numbers.threshold and local.held[lane] > 0:
                more = np.int64(local.area[lane, 0])
                centre = (centre * area + local.centre[lane, 0] * more) / (area + more)
                width, area = width + local.width[lane, 0], area + more
                peak, taken = max(peak, np.int64(local.peak[lane, 0])), 1
            held = insert(found, held, centre, width, area, peak)
    for j in range(taken, local.held[lane]):
        area, peak = np.int64(local.area[lane, j]), np.int64(local.peak[lane, j])
        held = insert(found, held, local.centre[lane, j], local.width[lane, j], area, peak)
    return held


@kernel
def _add_alarms(
    numbers: Numbers,
    alarms: Alarms,
    rate: float,
    key: tuple[Any, Any, Any],
    beam: Any,
    low: int,
    begin: int,
    end: int,
    found: FloatArray,
    held: int,
) -> int:
    """Add what background alone makes, but in the bins before `low` and in `begin` ... `end - 1`."""
    mean = rate * (begin - low + numbers.bins - end)
    _, _, _, word = philox(key[0], key[1], 0, beam, key[2], 0)
    left = unit(word)
    if left >= chance_of_any(mean):
        return held
    term = mean * exp(-mean)
    for clump in range(1, _MOST_CLUMPS + 1):
        pick, place, _, _ = philox(key[0], key[1], clump, beam, key[2], 0)
        number = np.int64(unit(pick) * (len(alarms.first) - 1))
        bin_ = low + np.int64(unit(place) * (begin - low + numbers.bins - end))
        bin_ += end - begin if bin_ >= begin else 0
        for j in range(alarms.first[number], alarms.first[number + 1]):
            centre = bin_ + alarms.centre[j]
            if 0.0 < centre < numbers.bins:
                held = insert(found, held, centre, alarms.width[j], alarms.area[j], alarms.peak[j])
        left -= term
        term *= mean / (clump + 1)
        if left < 0.0:
            break
    return held


@kernel
def join_beams(
    numbers: Numbers,
    histories: Histories,
    alarms: Alarms,
    key: tuple[Any, Any, Any],
    stream: Stream,
    beams: WordArray,
    per_bin: FloatArray,
    rate: FloatArray,
    pulses: Pulses,
    nearer2: float,
    rows: IndexArray,
    start: int,
    stop: int,
    work: Work,
    echoes: EchoArrays,
) -> None:
    """The echoes of the beams `rows[start]` ... `rows[stop - 1]`, all of one level, into their rows of `echoes`.

    Of all beams, (n_beams,): `beams`, what streams know them by; `per_bin`, background avalanches per armed SPAD and
    bin; `rate`, clumps of echoes a bin that background alone makes. `nearer2` [bins^2]: see `_nearer`.
    """
    group = work.group
    for low in range(start, stop, LANES):
        held, most = min(LANES, stop - low), 0
        for lane in range(LANES):
            group.beam[lane], group.begin[lane], group.length[lane], group.dead[lane] = lane, 0, 0, 0
            if lane < held:
                i: Any = np.uint64(rows[low + lane])
                begin, end = _window(numbers, pulses, histories.end, nearer2, i)
                group.begin[lane], group.length[lane], group.key[lane] = begin, end - begin, beams[i]
                most = max(most, end - begin)
        fill_abreast(stream, group.key, (RESERVE + most + 3) // 4, group.words, group.draws)
        _fetch(numbers, histories, held, work)
        group.rates[: most * LANES] = 0.0
        for lane in range(held):
            of: Any = np.uint64(rows[low + lane])
            _enter(numbers, histories, pulses, per_bin[of], of, lane, work)
        run_abreast(numbers, group, most, work.inverse)
        find_abreast(numbers, group, most, held, work.echoes)
        for lane in range(held):
            row: Any = np.uint64(rows[low + lane])
            count = _merge(numbers, histories, lane, work)
            begin, end = group.begin[lane], group.begin[lane] + group.length[lane]
            beside = min(begin, histories.end)
            count = _add_alarms(numbers, alarms, rate[row], key, beams[row], beside, begin, end, work.found, count)
            echoes.held[row] = 0
            for j in range(count):
                at = work.found[j]
                keep(echoes, row, at[0], int(at[1]), int(at[2]), int(at[3]))
        group.counts[: numbers.dead * LANES] = 0.0
