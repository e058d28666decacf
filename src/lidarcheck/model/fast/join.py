"""Beams in haze: a history of the haze up to where something else comes back, and the exact chain from there on.

What the chain must know of the bins before a window is the avalanches of one dead time, and the echo that is open
there; both are a history's.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray, WordArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.abreast import RESERVE, Abreast, find_abreast, new_abreast, run_abreast
from lidarcheck.model.exact.binomial import inverses
from lidarcheck.model.exact.echoes import EchoArrays, keep, new_echoes
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, add_pulses
from lidarcheck.model.fast.alarms import Alarms
from lidarcheck.model.fast.draw import chance_of_any
from lidarcheck.model.fast.haze_cut import put_haze
from lidarcheck.model.fast.histories import FIELDS, Histories
from lidarcheck.model.fast.set_off import After, Law, new_after, run_setting_off, start_lane, tail_of, wait_for
from lidarcheck.model.fast.special import insert, new_found
from lidarcheck.model.lane_math import LANES, exp, whole_below
from lidarcheck.model.streams import Stream, fill_twice_abreast, philox, unit

__all__ = ["CHUNK", "Work", "join_beams", "new_work"]

CHUNK = 8192
"""Beams a thread takes at a time."""

_ECHOES = 8
_MOST_CLUMPS = 16
_MARGIN = 2
"""Bins of background behind a window, so that few echoes end with it."""


class Work(NamedTuple):
    """Work space of a thread. Of a chunk: the windows' `begin`, `length`, and the `order` of beams; `longer`: how many
    windows are shorter than each length. `row` (LANES,): of the beams side by side."""

    group: Abreast
    inverse: FloatArray
    after: After
    rates: FloatArray
    echoes: EchoArrays
    found: FloatArray
    begin: IndexArray
    length: IndexArray
    order: IndexArray
    longer: IndexArray
    row: IndexArray


def new_work(numbers: Numbers) -> Work:
    """Work space for one thread."""
    begin, length, order = np.zeros((3, CHUNK), dtype=np.int64)
    longer, row = np.zeros(numbers.bins + 2, dtype=np.int64), np.zeros(LANES, dtype=np.int64)
    rates = np.zeros(numbers.bins)
    space = (new_abreast(numbers), inverses(numbers.detectors), new_after(numbers.bins, 0), rates)
    return Work(*space, new_echoes(LANES, _ECHOES), new_found(), begin, length, order, longer, row)


@inlined
def _window(numbers: Numbers, law: Law, pulses: Pulses, end_of_history: int, nearer: IndexArray, i: Any) -> Any:
    """The bins of a beam that differ from a history: its pulses' and those where rows of its haze end."""
    haze = pulses.haze
    begin, end = end_of_history, 0
    signal: Any = 0.0
    for j in range(pulses.first[i], pulses.first[i + np.uint64(1)]):
        if pulses.signal[j] > 0.0:
            middle = whole_below(pulses.centre[j])
            begin = min(begin if end > 0 else numbers.bins, middle - nearer[np.uint64(pulses.reach[j])])
            end = max(end, middle + nearer[np.uint64(pulses.reach_behind[j])] + 1)
            signal += pulses.signal[j]
    row, rows_end = haze.first[i], haze.first[i + np.uint64(1)]
    if row < rows_end:
        near, far = haze.end[row], haze.end[np.uint64(rows_end - 1)]
        at, last = whole_below(min(near, 2.0 * haze.last)), whole_below(min(far, 2.0 * haze.last))
        before, behind = at - nearer[np.uint64(haze.before)] - 1, nearer[np.uint64(haze.behind)] + 1
        if before < end_of_history:
            begin = min(begin, before)
            end = max(end, min(last + behind, max(at + behind, end_of_history)))
    if end > 0:
        end += numbers.on + _MARGIN
        if law.chance[8] > 0.0:
            end += tail_of(law, numbers, signal * numbers.detectors)
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
    put_haze(pulses, per_bin, i, begin, begin + length, rates)
    add_pulses(pulses, i, begin, begin + length, rates)
    step, first = np.uint64(LANES), np.uint64(lane)
    for k in range(np.uint64(length)):
        group.rates[k * step + first] = rates[k]


@inlined
def _start(law: Law, stream: Stream, histories: Histories, lane: Any, work: Work) -> None:
    """Let a lane's history wait for the afterpulses of what came before the window."""
    group, after = work.group, work.after
    start_lane(law, stream, after, lane, group.key[lane])
    begin = group.begin[lane]
    at, trail = min(begin, histories.end), histories.trail
    h = _history(histories, group, lane, 0 if begin <= histories.end else 1)
    for j in range(trail[h, 0]):
        due = trail[h, 2 * j + 2]
        bin_ = due // 2 - at
        if trail[h, 2 * j + 1] < at and 0 <= bin_ < group.length[lane]:
            wait_for(after, lane, bin_, due % 2 != 0)


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


@inlined
def _append(found: FloatArray, held: int, centre: float, width: Any, area: Any, peak: Any) -> int:
    """Put an echo behind those before it; how many there are."""
    at = np.uint64(held)
    found[at, 0], found[at, 1], found[at, 2], found[at, 3] = centre, width, area, peak
    return held + 1


@inlined
def _merge(numbers: Numbers, histories: Histories, lane: int, work: Work) -> int:
    """The echoes of a lane's history before its window and of the window; how many."""
    group, found, local = work.group, work.found, work.echoes
    begin, length = group.begin[lane], group.length[lane]
    h = _history(histories, group, lane, 0)
    end = min(begin, histories.end)
    on: Any = 0
    if length > 0 and begin <= histories.end:
        for age in range(numbers.on):
            on += group.counts[(numbers.dead - age) * LANES + lane]
    held, taken = 0, 0
    before = histories.echoes[h]
    for j in range(1, 1 + FIELDS * before[0], FIELDS):
        first, last = np.int64(before[j]), np.int64(before[j + 1])
        if last < end:
            centre = before[j + 3] / before[j + 2] + 0.5
            held = _append(found, held, centre, last - first, before[j + 2], before[j + 4])
        elif first < end:
            area, moment, peak = _begun(numbers, histories, h, first, end)
            centre, width = moment / area + 0.5, end - first
            if on > numbers.threshold and local.held[lane] > 0:
                more = np.int64(local.area[lane, 0])
                centre = (centre * area + local.centre[lane, 0] * more) / (area + more)
                width, area = width + local.width[lane, 0], area + more
                peak, taken = max(peak, np.int64(local.peak[lane, 0])), 1
            held = _append(found, held, centre, width, area, peak)
    for j in range(taken, local.held[lane]):
        centre, width = local.centre[lane, j], local.width[lane, j]
        held = _append(found, held, centre, width, local.area[lane, j], local.peak[lane, j])
    return held


@kernel
def _add_alarms(
    numbers: Numbers,
    alarms: Alarms,
    mean: float,
    left: float,
    key: tuple[Any, Any, Any],
    beam: Any,
    low: int,
    begin: int,
    end: int,
    found: FloatArray,
    held: int,
) -> int:
    """Add what background alone makes, but in the bins before `low` and in `begin` ... `end - 1`: `mean` clumps in the
    mean, and at least one, since the draw `left` is below the chance of any."""
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


@inlined
def _report(found: FloatArray, count: int, row: Any, echoes: EchoArrays) -> None:
    """Put a beam's echoes into its row."""
    if count <= echoes.area.shape[1]:
        echoes.held[row] = count
        for j in range(np.uint64(count)):
            echoes.centre[row, j], echoes.width[row, j] = found[j, 0], int(found[j, 1])
            echoes.area[row, j], echoes.peak[row, j] = int(found[j, 2]), int(found[j, 3])
    else:
        echoes.held[row] = 0
        for j in range(count):
            keep(echoes, row, found[j, 0], int(found[j, 1]), int(found[j, 2]), int(found[j, 3]))


@inlined
def _windows(
    numbers: Numbers, law: Law, pulses: Pulses, end_of_history: int, nearer: IndexArray, rows: IndexArray, work: Work
) -> None:
    """The window of each beam, and the beams in order of their windows' lengths: those side by side wait for the
    longest."""
    work.longer[:] = 0
    for at in range(len(rows)):
        begin, end = _window(numbers, law, pulses, end_of_history, nearer, np.uint64(rows[at]))
        work.begin[at], work.length[at] = begin, end - begin
        work.longer[end - begin + 1] += 1
    for length in range(1, len(work.longer)):
        work.longer[length] += work.longer[length - 1]
    for at in range(len(rows)):
        place = work.longer[work.length[at]]
        work.longer[work.length[at]] += 1
        work.order[place] = at


@kernel
def join_beams(
    numbers: Numbers,
    law: Law,
    histories: Histories,
    alarms: Alarms,
    key: tuple[Any, Any, Any],
    stream: Stream,
    beams: WordArray,
    per_bin: FloatArray,
    rate: FloatArray,
    pulses: Pulses,
    nearer: IndexArray,
    rows: IndexArray,
    work: Work,
    echoes: EchoArrays,
) -> None:
    """The echoes of the beams `rows`, at most `CHUNK` that draw the same histories, into their rows of `echoes`.

    Of all beams, (n_beams,): `beams`, what streams know them by; `per_bin`, background avalanches per armed SPAD and
    bin; `rate`, clumps of echoes a bin that background alone makes. `nearer`: what a reach
    [bins] of the exact chain may be cut to.
    """
    group = work.group
    _windows(numbers, law, pulses, histories.end, nearer, rows, work)
    for low in range(0, len(rows), LANES):
        held, most = min(LANES, len(rows) - low), 0
        for lane in range(LANES):
            group.beam[lane], group.begin[lane], group.length[lane], group.dead[lane] = lane, 0, 0, 0
            if lane < held:
                at = work.order[low + lane]
                group.begin[lane], group.length[lane] = work.begin[at], work.length[at]
                group.key[lane], work.row[lane] = beams[rows[at]], rows[at]
                most = max(most, group.length[lane])
        fill_twice_abreast(stream, group.key, (RESERVE + most + 7) // 8, group.words, group.draws)
        _fetch(numbers, histories, held, work)
        group.rates[: most * LANES] = 0.0
        for lane in range(held):
            of: Any = np.uint64(work.row[lane])
            _enter(numbers, histories, pulses, per_bin[of], of, lane, work)
        if law.any_:
            for lane in range(held):
                _start(law, stream, histories, lane, work)
            run_setting_off(numbers, law, stream, group, work.after, most, work.inverse)
        else:
            run_abreast(numbers, group, most, work.inverse)
        find_abreast(numbers, group, most, held, work.echoes)
        for lane in range(held):
            row: Any = np.uint64(work.row[lane])
            count = _merge(numbers, histories, lane, work)
            begin, end = group.begin[lane], group.begin[lane] + group.length[lane]
            before, draw = min(begin, histories.end), group.draws[2 * LANES + lane]
            mean = rate[row] * (begin - before + numbers.bins - end)
            if draw < chance_of_any(mean):
                key_ = beams[row]
                count = _add_alarms(numbers, alarms, mean, draw, key, key_, before, begin, end, work.found, count)
            _report(work.found, count, row, echoes)
        group.counts[: numbers.dead * LANES] = 0
