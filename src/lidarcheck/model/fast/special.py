"""Beams whose draw is more than a word: samples of several echoes or pulses, echoes that background alone makes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray, WordArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.echoes import EchoArrays, keep
from lidarcheck.model.fast import words as w
from lidarcheck.model.fast.alarms import Alarms
from lidarcheck.model.fast.draw import (
    ALARM,
    EXACT,
    NOTHING,
    SEVERAL,
    alarm_rate_of,
    beam_key,
    bins_of,
    chance_of_any,
    is_lit,
    level_of,
    place_of,
)
from lidarcheck.model.fast.library import Samples
from lidarcheck.model.fast.tables import Levels, SeveralPulses, Tables
from lidarcheck.model.lane_math import exp
from lidarcheck.model.streams import philox, unit

__all__ = ["insert", "new_found", "resolve"]

_ROOM = 128
"""Echoes that a beam may have before the smallest go."""
_MOST_CLUMPS = 16
_TRIES = 64
"""Places that are tried for a clump beside the spans of several pulses."""


def new_found() -> FloatArray:
    """Work space for one thread: centre, width, area and peak of the echoes of a beam, in order of range."""
    return np.empty((_ROOM, 4))


@kernel
def insert(found: FloatArray, held: int, centre: float, width: Any, area: Any, peak: Any) -> int:
    """Add an echo in its place; returns how many there are."""
    if held == _ROOM:
        return held
    j = held
    while j > 0 and found[j - 1, 0] > centre:
        for k in range(4):
            found[j, k] = found[j - 1, k]
        j -= 1
    found[j, 0], found[j, 1], found[j, 2], found[j, 3] = centre, width, area, peak
    return held + 1


@kernel
def _sample(
    words: WordArray, samples: Samples, place: Any, block: Any, centre: float, found: FloatArray, held: int
) -> int:
    """Add the echoes of the sample at a place of the words, for a pulse at `centre`."""
    word = words[place]
    kind = np.int64(word & np.uint64(w.KIND))
    if kind == w.ONE:
        away = (np.int64(word >> np.uint64(w.CENTRE_AT)) - w.CENTRE_ZERO) * w.CENTRE_STEP
        area = np.int64(word >> np.uint64(w.AREA_AT)) & ((1 << w.AREA_BITS) - 1)
        peak = np.int64(word >> np.uint64(w.PEAK_AT)) & ((1 << w.PEAK_BITS) - 1)
        width = np.int64(word >> np.uint64(w.WIDTH_AT)) & ((1 << w.WIDTH_BITS) - 1)
        held = insert(found, held, centre + away, width, area, peak)
    elif kind == w.MANY:
        row = samples.first[block] + np.int64(word >> np.uint64(w.ROW_AT))
        for j in range(samples.held[row]):
            away, width = samples.centre[row, j], samples.width[row, j]
            held = insert(found, held, centre + away, width, samples.area[row, j], samples.peak[row, j])
    return held


@kernel
def _alarms(
    tables: Tables,
    alarms: Alarms,
    key: tuple[Any, Any, Any],
    beam: Any,
    mean: float,
    begin: Any,
    length: Any,
    pulses: SeveralPulses,
    first: int,
    last: int,
    found: FloatArray,
    held: int,
) -> int:
    """Add the clumps of a beam that is known to have some, anywhere but in `length` bins from `begin` on and in those
    of the pulses `first` ... `last - 1`; `mean`: how many such a beam has."""
    elsewhere = tables.bins - length
    _, _, _, word = philox(key[0], key[1], 0, beam, key[2], 0)
    # The draw that was below P(any) is even below it: the number of clumps follows by inversion.
    left = unit(word)
    term = mean * exp(-mean)
    for clump in range(1, _MOST_CLUMPS + 1):
        pick, place, _, _ = philox(key[0], key[1], clump, beam, key[2], 0)
        number = np.int64(unit(pick) * (len(alarms.first) - 1))
        bin_ = np.int64(unit(place) * elsewhere)
        bin_ += length if bin_ >= begin else 0
        for again in range(1, _TRIES):
            if not _taken(tables, pulses, first, last, bin_):
                break
            _, place, _, _ = philox(key[0], key[1], clump + again * _TRIES, beam, key[2], 0)
            bin_ = np.int64(unit(place) * elsewhere)
        for j in range(alarms.first[number], alarms.first[number + 1]):
            centre = bin_ + alarms.centre[j]
            if 0.0 < centre < tables.bins:
                held = insert(found, held, centre, alarms.width[j], alarms.area[j], alarms.peak[j])
        left -= term
        term *= mean / (clump + 1)
        if left < 0.0:
            break
    return held


@kernel
def _taken(tables: Tables, pulses: SeveralPulses, first: int, last: int, bin_: Any) -> bool:
    """Whether the sample of one of the pulses sees the bin."""
    for j in range(first, last):
        if is_lit(tables, pulses.signal[j]):
            _, begin, length = bins_of(tables, pulses.range_m[j], pulses.signal[j])
            if begin <= bin_ < begin + length:
                return True
    return False


@kernel
def _of_several(
    tables: Tables,
    words: WordArray,
    samples: Samples,
    alarms: Alarms,
    key: tuple[Any, Any, Any],
    beam: Any,
    rate: float,
    pulses: SeveralPulses,
    first: int,
    last: int,
    found: FloatArray,
) -> int:
    """The echoes of a beam whose pulses `first` ... `last - 1` draw a sample each, and of background elsewhere."""
    held, elsewhere = 0, tables.bins
    for j in range(first, last):
        range_m, signal = pulses.range_m[j], pulses.signal[j]
        if is_lit(tables, signal):
            block, _, length = bins_of(tables, range_m, signal)
            centre = range_m * tables.bins_per_m
            x0, x1, x2, _ = philox(key[0], key[1], 0, beam, key[2], 1 + j - first)
            place = place_of(tables, signal, centre, x0, x1, x2)
            held = _sample(words, samples, place, block, centre, found, held)
            elsewhere -= length
    _, _, _, word = philox(key[0], key[1], 0, beam, key[2], 0)
    if unit(word) < chance_of_any(rate * elsewhere):
        held = _alarms(tables, alarms, key, beam, rate * elsewhere, 0, 0, pulses, first, last, found, held)
    return held


@kernel
def resolve(
    tables: Tables,
    levels: Levels,
    number: int,
    words: WordArray,
    samples: Samples,
    alarms: Alarms,
    key: tuple[Any, Any, Any],
    layer: npt.NDArray[np.int32],
    point: npt.NDArray[np.int32],
    range_m: FloatArray,
    background: FloatArray,
    pulses: SeveralPulses,
    drawn: WordArray,
    special: IndexArray,
    start: int,
    stop: int,
    found: FloatArray,
    echoes: EchoArrays,
) -> None:
    """The echoes of the special beams `start` ... `stop - 1` that drew from library `number`, into rows of `echoes`.

    `special`: their rows among all beams. Those of the exact chain and of other libraries are left alone.
    """
    per_block = len(words) // len(tables.before)
    for at in range(start, stop):
        i = np.uint64(special[at])
        code = np.int64(drawn[i] >> np.uint64(w.CODE_AT)) & ((1 << w.CODE_BITS) - 1)
        of = np.int64(drawn[i] >> np.uint64(w.LIBRARY_AT)) & ((1 << w.LIBRARY_BITS) - 1)
        if code == EXACT or of != number:
            continue
        beam = beam_key(layer[i], point[i])
        around = 0.0 if levels.single else background[i]
        level, above = level_of(levels, around)
        rate = alarm_rate_of(levels, level, above)
        if code == SEVERAL:
            first, last = pulses.first[i], pulses.first[i + np.uint64(1)]
            held = _of_several(tables, words, samples, alarms, key, beam, rate, pulses, first, last, found)
        else:
            place = np.int64(drawn[i] >> np.uint64(w.PLACE_AT))
            held = begin = length = 0
            if place != NOTHING:
                centre = range_m[i] * tables.bins_per_m
                block = place // per_block
                length = tables.length[block]
                begin = np.int64(centre) - tables.before[block]
                held = _sample(words, samples, place, block, centre, found, 0)
            if code == ALARM:
                mean = rate * (tables.bins - length)
                held = _alarms(tables, alarms, key, beam, mean, begin, length, pulses, 0, 0, found, held)
        echoes.held[at] = 0
        for j in range(held):
            keep(echoes, at, found[j, 0], int(found[j, 1]), int(found[j, 2]), int(found[j, 3]))
