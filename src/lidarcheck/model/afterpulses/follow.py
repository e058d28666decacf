"""A detector that waits for an afterpulse, followed alone: before the window, through it and behind it.

Detectors do not know of each other, so one that leaves the counts can be followed at once until it comes back, and its
avalanches added to bins that the counts have not reached yet.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.afterpulses.law import BEGIN, END, Law, Level, Trails, due, gap, record
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_draws import secondary, waiting_time
from lidarcheck.model.lane_math import LANES, fired, log
from lidarcheck.model.streams import Stream

__all__ = ["follow_before", "follow_behind", "leave"]


@inlined
def _run_down(level: Level, trails: Trails, lane: int, clock: float, bin_: int, until: int) -> Any:
    """Spend an exponential number on light and background from `bin_` on, of a detector that is armed: the bin in which
    it runs out and the detector avalanches, or `until`; and what is left of it, below 0 where it runs out."""
    if bin_ >= until:
        return until, clock
    begin, end = trails.state[BEGIN + lane], trails.state[END + lane]
    rate = level.per_bin
    if bin_ < begin:
        stop = min(until, begin)
        if clock < rate * (stop - bin_):
            return min(bin_ + int(clock / rate), stop - 1), -1.0
        clock -= rate * (stop - bin_)
        bin_ = stop
    stop = min(until, end)
    while bin_ < stop:
        clock -= trails.rates[(bin_ - begin) * LANES + lane]
        if clock < 0.0:
            return bin_, clock
        bin_ += 1
    if bin_ < until:
        if clock < rate * (until - bin_):
            return min(bin_ + int(clock / rate), until - 1), -1.0
        clock -= rate * (until - bin_)
    return until, clock


@inlined
def _follow(
    numbers: Numbers,
    law: Law,
    level: Level,
    stream: Stream,
    trails: Trails,
    lane: int,
    armed_from: int,
    waiting: Any,
    returns: bool,
) -> None:
    """Follow a detector that is armed from a bin on and has `waiting` afterpulses in `pending`.

    It `returns` to the pool where it waits for none: at the window's begin, or with its last avalanche in the window.
    Behind the window, it is followed to the end of the trace.
    """
    pending = trails.pending
    begin, end = trails.state[BEGIN + lane], trails.state[END + lane]
    clock = waiting_time(stream, trails, lane)
    while True:
        kept, soonest = 0, numbers.bins
        for j in range(waiting):
            if pending[j] >= armed_from:
                pending[kept] = pending[j]
                soonest = min(soonest, pending[j])
                kept += 1
        waiting = kept
        last = armed_from - numbers.dead
        early = returns and waiting == 0 and last < begin
        if returns and waiting == 0 and last < end and (not early or armed_from >= begin):
            trails.back[(armed_from - begin) * LANES + lane] += 1
            return
        until = begin if early else soonest
        bin_, clock = _run_down(level, trails, lane, clock, armed_from, until)
        if clock < 0.0:
            clock = waiting_time(stream, trails, lane)
        elif waiting == 0:
            if early:
                trails.back[lane] += 1
            return
        record(numbers, trails, lane, bin_)
        armed_from = bin_ + numbers.dead
        if secondary(stream, trails, lane) < law.chance:
            waiting = due(numbers, law, stream, trails, lane, armed_from, waiting)


@kernel
def leave(
    numbers: Numbers,
    law: Law,
    level: Level,
    stream: Stream,
    trails: Trails,
    left: FloatArray,
    first: Any,
    last: int,
    k: Any,
) -> None:
    """Of the avalanches in the k-th bin of the windows, follow those with an afterpulse, until `left` is not below 0 in
    any of the lanes `first` ... `last - 1`."""
    for lane in range(first, last):
        while left[lane] < 0.0:
            trails.back[(k + numbers.dead) * LANES + lane] -= 1
            armed_from = trails.state[BEGIN + lane] + k + numbers.dead
            waiting = due(numbers, law, stream, trails, lane, armed_from, np.int64(0))
            _follow(numbers, law, level, stream, trails, lane, armed_from, waiting, True)
            left[lane] += 1.0 + gap(law, stream, trails, lane)


@inlined
def _first_dirty(level: Level, span: int, some: float, draw: float) -> int:
    """In which of `span` bins an afterpulse to come first strikes a detector that is struck by one, as `some` are."""
    return min(int(-log(1.0 - draw * some) / level.dirty), span - 1)


@inlined
def _wait(level: Level, stream: Stream, trails: Trails, lane: int) -> float:
    """Bins without a candidate of background that has no afterpulse."""
    return min(waiting_time(stream, trails, lane) / max(level.clean, 1e-300), 1e9)


@inlined
def follow_before(
    numbers: Numbers, law: Law, level: Level, stream: Stream, trails: Trails, lane: int, number: int
) -> None:
    """Follow `number` detectors that background strikes with an afterpulse to come, before the window.

    Until then they are in the steady state of a fixed dead time, which looks the same backwards.
    """
    span = trails.state[BEGIN + lane] + law.warm_up
    some, dead = fired(level.dirty * span), fired(level.dead_rate)
    for _ in range(number):
        first = _first_dirty(level, span, some, secondary(stream, trails, lane)) - law.warm_up
        last: int = first
        waiting: Any = np.int64(0)
        if secondary(stream, trails, lane) < dead:
            last = first - 1 - int(secondary(stream, trails, lane) * (numbers.dead - 1))
        else:
            waiting = due(numbers, law, stream, trails, lane, last + numbers.dead, waiting)
        record(numbers, trails, lane, last)
        bin_ = last - numbers.dead
        while bin_ >= -numbers.pad:
            bin_ -= int(_wait(level, stream, trails, lane))
            record(numbers, trails, lane, bin_)
            bin_ -= numbers.dead
        _follow(numbers, law, level, stream, trails, lane, last + numbers.dead, waiting, True)


@inlined
def _picked(numbers: Numbers, trails: Trails, lane: int, place: float) -> int:
    """Take a detector out of the pool at the window's end, by its place among all; the bin from which it is armed."""
    end = trails.state[END + lane]
    row = end - trails.state[BEGIN + lane]
    for later in range(1, numbers.dead):
        at = (row + later) * LANES + lane
        if place < trails.back[at]:
            trails.back[at] -= 1
            return int(end) + later
        place -= trails.back[at]
    return int(end)


@inlined
def follow_behind(
    numbers: Numbers, law: Law, level: Level, stream: Stream, trails: Trails, lane: int, number: int, pool: int
) -> None:
    """Follow `number` detectors of the `pool` that background strikes with an afterpulse to come, behind the window."""
    end = trails.state[END + lane]
    span = numbers.bins - end
    some = fired(level.dirty * span)
    for taken in range(number):
        place = secondary(stream, trails, lane) * (pool - taken)
        armed_from = _picked(numbers, trails, lane, place)
        first = end + _first_dirty(level, span, some, secondary(stream, trails, lane))
        waiting: Any = np.int64(0)
        bin_ = armed_from + int(_wait(level, stream, trails, lane))
        while bin_ < first:
            record(numbers, trails, lane, bin_)
            armed_from = bin_ + numbers.dead
            bin_ = armed_from + int(_wait(level, stream, trails, lane))
        if armed_from <= first:
            record(numbers, trails, lane, first)
            armed_from = first + numbers.dead
            waiting = due(numbers, law, stream, trails, lane, armed_from, waiting)
        _follow(numbers, law, level, stream, trails, lane, armed_from, waiting, False)
