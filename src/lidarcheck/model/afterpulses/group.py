"""A group of beams whose detectors have afterpulses, side by side: the exact chain, but for who leaves its counts.

Detectors of a beam are alike as long as they wait for no afterpulse: the pool, which the exact chain counts. Of its
avalanches one in so many has an afterpulse, by a geometric countdown; the detector leaves the pool and is followed
alone until it waits for nothing (`follow.py`). Background splits into candidates with an afterpulse to come and others,
which strike cells independently: detectors that the former strike outside the window are followed from there on, and
what the latter do to the others is found as in the exact chain (`outside.py`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.jit import inlined, kernel
from lidarcheck.model.afterpulses.follow import follow_before, follow_behind, leave
from lidarcheck.model.afterpulses.law import BEGIN, END, POINTS, After, Law, Level, gap
from lidarcheck.model.afterpulses.outside import is_quiet, look_around
from lidarcheck.model.exact.abreast import (
    ARMED,
    COUNT,
    FEW,
    RESERVE,
    draw_counts,
    draw_windows,
    find_abreast,
    last_on,
    put_rates,
)
from lidarcheck.model.exact.binomial import binomial
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.exact.single import place_dead
from lidarcheck.model.lane_draws import begin_draws, secondary
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.rows import add_row, spend_row, take_row
from lidarcheck.model.streams import Stream, rewind, skip

__all__ = ["simulate_group"]

_LANES: Any = np.uint64(LANES)
_FIRST = np.uint64(0)
_FIRST_DRAW: Any = np.uint64(RESERVE * LANES)


@kernel
def simulate_group(
    numbers: Numbers,
    law: Law,
    level: Level,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    pulses: Pulses,
    held: int,
    after: After,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams of the first `held` lanes, which have one background; each has the draws that are its own."""
    group = after.chain.group
    bins: Any = np.int64(0)
    for lane in range(held):
        group.key[lane] = beams[np.uint64(group.beam[lane])]
        bins = max(bins, group.length[lane])
    draw_windows(stream, group, bins, held, after.chain.draws)
    _enter(numbers, law, level, stream, held, after)
    put_rates(pulses, group, level.per_bin, bins, held)
    _before(numbers, law, level, stream, held, after)
    if held < FEW:
        _run_few(numbers, law, level, stream, bins, held, after)
    else:
        _run(numbers, law, level, stream, bins, held, after)
    _close(numbers, bins, held, after)
    find_abreast(numbers, group, bins, held, echoes)
    _finish(numbers, law, level, stream, held, after, echoes)
    group.counts[: (numbers.dead + bins) * LANES] = 0
    after.trails.back[: (numbers.dead + bins) * LANES] = 0


@kernel
def _enter(numbers: Numbers, law: Law, level: Level, stream: Stream, held: int, after: After) -> None:
    """Who is followed when the window begins, and the last avalanches of the others, as background leaves them."""
    group, chain, trails = after.chain.group, after.chain, after.trails
    state = trails.state
    for lane in range(held):
        state[BEGIN + lane], state[END + lane] = group.begin[lane], group.begin[lane] + group.length[lane]
        state[POINTS + lane] = 0
        begin_draws(trails, lane, group.key[lane])
        dirty = level.dirty * (group.begin[lane] + law.warm_up)
        gone = binomial(secondary(stream, trails, lane), numbers.detectors, dirty, chain.inverse)
        after.pool[lane] = numbers.detectors - gone
        after.left[lane] = gap(law, stream, trails, lane)
        dead = binomial(group.draws[lane], after.pool[lane], level.dead_rate, chain.inverse)
        group.state[ARMED + np.uint64(lane)] = after.pool[lane] - dead
        rewind(stream, group.key[lane])
        skip(stream, (RESERVE + group.length[lane] + 1) // 2)
        if dead > 0:
            for k in range(1, RESERVE - 2):
                chain.draws[k] = group.draws[k * LANES + lane]
            place_dead(numbers, stream, chain, dead, np.int64(0))
            for age in range(1, numbers.dead):
                at = (numbers.dead - age) * LANES + lane
                group.counts[at] = chain.counts[numbers.pad - age]
                after.trails.back[at] = group.counts[at]
                chain.counts[numbers.pad - age] = 0
        group.block[lane] = stream.counter[0]
    for lane in range(held, LANES):
        group.state[ARMED + np.uint64(lane)] = 0
        after.left[lane] = 0.0


@kernel
def _before(numbers: Numbers, law: Law, level: Level, stream: Stream, held: int, after: After) -> None:
    """Follow those who have left the pool before the window; count all avalanches in the `dead - 1` bins before it."""
    group = after.chain.group
    for lane in range(held):
        number = numbers.detectors - after.pool[lane]
        follow_before(numbers, law, level, stream, after.trails, lane, number)
        total = 0.0
        for k in range(1, numbers.dead):
            total += group.counts[k * LANES + lane]
        group.dead[lane] = int(total)


@inlined
def _close(numbers: Numbers, bins: int, held: int, after: After) -> None:
    """Count the detectors of each lane that are not followed when its window has ended: those armed and those armed
    again later."""
    state, back = after.chain.group.state, after.trails.back
    for k in range(np.uint64(bins), np.uint64(bins + numbers.dead)):
        add_row(state, ARMED, back, k * _LANES)
    for lane in range(held):
        after.later[lane] = state[ARMED + np.uint64(lane)]


@kernel
def _run(numbers: Numbers, law: Law, level: Level, stream: Stream, bins: int, held: int, after: After) -> None:
    """Run the pool of all lanes through the first `bins` bins of their windows."""
    group, back, left = after.chain.group, after.trails.back, after.left
    counts, state = group.counts, group.state
    window = np.uint64(numbers.dead) * _LANES
    for k in range(np.uint64(bins)):
        bin_ = k * _LANES
        add_row(state, ARMED, back, bin_)
        if draw_counts(group, bin_, _FIRST_DRAW + bin_, after.chain.inverse, numbers.detectors):
            add_row(counts, window + bin_, state, COUNT)
            add_row(back, window + bin_, state, COUNT)
            take_row(state, ARMED, state, COUNT)
            if spend_row(left, _FIRST, state, COUNT) != 0:
                leave(numbers, law, level, stream, after.trails, left, np.int64(0), held, np.int64(k))


@kernel
def _run_few(numbers: Numbers, law: Law, level: Level, stream: Stream, bins: int, held: int, after: After) -> None:
    """The same lane by lane, to the last bit."""
    group, back, left = after.chain.group, after.trails.back, after.left
    counts, state = group.counts, group.state
    for lane in range(held):
        for k in range(bins):
            at = k * LANES + lane
            armed: Any = np.int64(state[ARMED + np.uint64(lane)]) + back[at]
            fired = binomial(group.draws[RESERVE * LANES + at], armed, group.rates[at], after.chain.inverse)
            counts[numbers.dead * LANES + at] += fired
            back[numbers.dead * LANES + at] += fired
            state[ARMED + np.uint64(lane)] = armed - fired
            left[lane] -= fired
            if left[lane] < 0.0:
                leave(numbers, law, level, stream, after.trails, left, lane, lane + 1, k)


@kernel
def _finish(
    numbers: Numbers, law: Law, level: Level, stream: Stream, held: int, after: After, echoes: EchoArrays
) -> None:
    """Follow those who leave the pool behind the window, and look for echoes that reach beyond it."""
    group, trails = after.chain.group, after.trails
    for lane in range(held):
        dirty = level.dirty * (numbers.bins - trails.state[END + lane])
        number = binomial(secondary(stream, trails, lane), after.later[lane], dirty, after.chain.inverse)
        follow_behind(numbers, law, level, stream, trails, lane, number, after.later[lane])
        after.later[lane] -= number
        rewind(stream, group.key[lane])
        stream.counter[0] = group.block[lane]
        dead, on = group.dead[lane], last_on(numbers, group, lane)
        before, behind = group.draws[(RESERVE - 2) * LANES + lane], group.draws[(RESERVE - 1) * LANES + lane]
        if not is_quiet(numbers, stream, after, lane, before, behind, dead, on):
            i: Any = np.uint64(group.beam[lane])
            look_around(numbers, level, stream, after, lane, i, echoes)
