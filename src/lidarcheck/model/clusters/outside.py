"""Echoes beyond the window of a beam whose avalanches set off others; see `exact/background.py`.

Background's strikes come in clusters, which are larger without limits than they really are: no bin can see more
detectors ON than two neighbouring blocks have avalanches in such clusters. Where neighbours are crowded, they are taken
apart into clusters, and these into avalanches in their places, as are the blocks before them back to where no strike
falls within a dead time. Background just before the window is known; such a gap parts it from the blocks before.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.clusters.law import FIRST, KNOWN, NEAR, ROOM, UNKNOWN, Law, Level, Space
from lidarcheck.model.clusters.places import catch_up, learn, unknown_place
from lidarcheck.model.clusters.strikes import bin_of, gather, strike_all, strike_before
from lidarcheck.model.exact import background as bg
from lidarcheck.model.exact.abreast import RESERVE
from lidarcheck.model.exact.blocks import count_small
from lidarcheck.model.exact.echoes import EchoArrays, add_echoes
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_draws import secondary, waiting_time
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.streams import Stream, rewind

__all__ = ["look_outside"]


@inlined
def _rewind(stream: Stream, space: Space, lane: int) -> None:
    """Go to the first draw of a lane's beam that the window has not used."""
    rewind(stream, space.chain.group.key[lane])
    stream.counter[0] = space.chain.group.block[lane]


@inlined
def look_outside(
    numbers: Numbers, law: Law, level: Level, stream: Stream, space: Space, lane: int, echoes: EchoArrays
) -> None:
    """Find a lane's echoes that reach beyond its window."""
    group, blocks, state = space.chain.group, space.chain.blocks, space.places.state
    end, first = group.begin[lane] + group.length[lane], group.begin[lane] + state[FIRST + lane]
    on: Any = np.int64(0)
    for age in range(numbers.on):
        on += group.counts[(numbers.dead + group.length[lane] - 1 - age) * LANES + lane]
    before, behind = group.draws[(RESERVE - 2) * LANES + lane], group.draws[(RESERVE - 1) * LANES + lane]
    quiet = state[NEAR + lane] <= numbers.threshold
    if not (quiet and bg.is_plainly_quiet(numbers, blocks, before, behind, first, end, 0, on)):
        _rewind(stream, space, lane)
        draws = space.chain.draws
        if not (quiet and bg.looks_quiet(numbers, blocks, stream, draws, before, behind, first, end, 0, on)):
            _look_around(numbers, law, level, stream, space, lane, first, end, on, echoes)


@kernel
def _look_around(
    numbers: Numbers,
    law: Law,
    level: Level,
    stream: Stream,
    space: Space,
    lane: int,
    first: Any,
    end: Any,
    on: int,
    echoes: EchoArrays,
) -> None:
    """Find a lane's echoes, of which some may lie before `first` or reach beyond `end`; `on` detectors are ON there."""
    chain, places = space.chain, space.places
    group, blocks, counts, state, pad = chain.group, chain.blocks, chain.counts, places.state, numbers.pad
    begin, length, step = group.begin[lane], group.length[lane], blocks.length
    back, last = bg.blocks_around(numbers, blocks, first, end)
    beside = on if end < numbers.bins else 0
    _rewind(stream, space, lane)
    before, behind = group.draws[(RESERVE - 2) * LANES + lane], group.draws[(RESERVE - 1) * LANES + lane]
    bg.search(blocks, stream, chain.draws, before, np.int64(0), back, 0, numbers.threshold, True, 0)
    bg.search(blocks, stream, chain.draws, behind, back, last, beside, numbers.threshold, True, 0)
    i: Any = np.uint64(group.beam[lane])
    echoes.held[i] = 0
    low, high = np.int64(0), np.int64(0)
    low, high = _along(
        numbers,
        law,
        level,
        stream,
        space,
        lane,
        back,
        back - 1,
        -1,
        first - numbers.dead - back * step + 1 - begin,
        0,
        low,
        high,
        i,
        echoes,
    )
    for n in range(state[NEAR + lane]):
        if places.near[lane * ROOM + n] + begin >= -pad:
            counts[pad + begin + places.near[lane * ROOM + n]] += 1
    for k in range(length):
        counts[pad + begin + k] = group.counts[(numbers.dead + k) * LANES + lane]
    window = first - begin if state[NEAR + lane] > numbers.threshold else np.int64(0)
    low, high = _extend(numbers, counts, begin, low, high, window, length, i, echoes)
    low, high = _along(
        numbers, law, level, stream, space, lane, last - back, back, 1, length, beside, low, high, i, echoes
    )
    _find(numbers, counts, begin, low, high, i, echoes)
    counts[:] = 0
    places.armed_from[LANES * numbers.detectors :] = UNKNOWN
    places.armed_from[lane * numbers.detectors : (lane + 1) * numbers.detectors] = UNKNOWN
    state[KNOWN + lane] = 0


@inlined
def _find(numbers: Numbers, counts: IndexArray, begin: int, low: int, high: int, i: Any, echoes: EchoArrays) -> None:
    """Find the echoes of the bins from `low` to `high`, counted from the window's begin, within the trace."""
    low, high = max(low + begin, 0), min(high + begin, numbers.bins)
    if low < high:
        add_echoes(numbers, counts, low, high, i, echoes)


@inlined
def _extend(
    numbers: Numbers,
    counts: IndexArray,
    begin: int,
    low: Any,
    high: Any,
    next_low: Any,
    next_high: Any,
    i: Any,
    echoes: EchoArrays,
) -> Any:
    """Go on with the next bins that may hold echoes; if they do not follow those until now, find what these hold."""
    if next_low == high:
        return low, next_high
    _find(numbers, counts, begin, low, high, i, echoes)
    return next_low, next_high


@inlined
def _gather_back(
    numbers: Numbers,
    law: Law,
    stream: Stream,
    space: Space,
    lane: int,
    block: int,
    latest: int,
    done: int,
    nearest: int,
    step: int,
    origin: Any,
) -> Any:
    """Take blocks apart into strikes, from the `latest` back to block `done` or to where all detectors are armed.

    `block` and the one before are wanted as a whole. How many strikes there are, and whether all are armed before.
    """
    blocks, places = space.chain.blocks, space.places
    held, length = blocks.held, blocks.length
    gathered, first = 0, origin + max(block - 1, 0) * length
    j, free = latest, False
    while j >= done and not free:
        index, start = nearest + step * j, gathered
        if held[index] < 0:
            held[index] = count_small(blocks, secondary(stream, places, lane))
        gathered = gather(numbers, law, stream, space, lane, held[index], origin + j * length, gathered)
        if j < block - 1:
            # Where no strike falls within a dead time, all detectors are armed.
            while start < gathered and not free:
                bin_ = bin_of(numbers, places.strikes[start])
                free = bin_ <= first - numbers.dead
                if not free:
                    first = bin_
                    start += 1
            gathered = start
            free = free or first - (origin + j * length) >= numbers.dead - 1
        free = free or gathered > len(places.strikes) - 2 * len(blocks.above)
        j -= 1
    return gathered, free


@kernel
def _along(
    numbers: Numbers,
    law: Law,
    level: Level,
    stream: Stream,
    space: Space,
    lane: int,
    number: int,
    nearest: int,
    step: int,
    origin: Any,
    beside: int,
    low: Any,
    high: Any,
    i: Any,
    echoes: EchoArrays,
) -> Any:
    """Find the echoes of the blocks before the window (`step` -1) or behind it (1), in the order of time.

    `number` blocks, the first of which is block `nearest` and begins with bin `origin`; `beside` detectors are ON
    before it. `low`, `high`: bins just before that may hold echoes; returned are those that are to be looked at yet.
    """
    blocks, counts, places = space.chain.blocks, space.chain.counts, space.places
    held, length, begin = blocks.held, blocks.length, space.chain.group.begin[lane]
    slot: Any = np.int64(lane if step > 0 else LANES)
    earlier: Any = np.int64(beside)
    done, begun = 0, False
    # Behind the last block before the window stands a gap, the first bins of which see that block.
    for k in range(number + (0 if step > 0 else 1)):
        now: Any = np.int64(held[nearest + step * k] if k < number else 0)
        if now >= 0 and earlier >= 0 and earlier + now > numbers.threshold and (step > 0 or k > 0):
            gathered, free = _gather_back(
                numbers, law, stream, space, lane, k, min(k, number - 1), done, nearest, step, origin
            )
            if not free and done == 0 and not begun:
                _begin(numbers, law, level, stream, space, lane, slot, origin)
                begun = True
            strike_all(numbers, law, stream, places, lane, slot, gathered, begin, counts)
            done = k + 1
            bin_ = origin + k * length
            low, high = _extend(numbers, counts, begin, low, high, bin_, bin_ + length, i, echoes)
        earlier = now
    return low, high


@inlined
def _begin(
    numbers: Numbers, law: Law, level: Level, stream: Stream, space: Space, lane: int, slot: Any, origin: Any
) -> None:
    """Know the detectors that are dead in bin `origin`: the window's end, or long before it."""
    places = space.places
    if slot == LANES:
        strike_before(numbers, law, level, stream, places, lane, slot, origin, waiting_time(stream, places, lane))
        return
    if places.state[KNOWN + lane] > 0:
        catch_up(numbers, stream, places, lane, origin)
    for age in range(1, numbers.dead):
        at = (numbers.dead + origin - age) * LANES + lane
        for _ in range(places.counts[at] - places.own[at]):
            place = unknown_place(numbers, stream, places, lane)
            learn(numbers, places, lane, place, origin - age + numbers.dead)
