"""A group of beams whose avalanches set off others, side by side: the exact chain, but for avalanches that try to.

Of the avalanches one in so many tries to set off neighbours, by a geometric countdown; what comes of that is drawn
before the next bin (`places.py`). Background just before the windows is known strike by strike (`strikes.py`), and what
lies outside is found as in the exact chain (`outside.py`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.jit import inlined, kernel
from lidarcheck.model.clusters.law import (
    ARMED_ALL,
    ARMED_KNOWN,
    FIRST,
    KNOWN,
    NEAR,
    ROOM,
    SPLIT,
    UNKNOWN,
    Law,
    Level,
    Space,
)
from lidarcheck.model.clusters.outside import look_outside
from lidarcheck.model.clusters.places import forget_armed, gap, set_off
from lidarcheck.model.clusters.strikes import strike_before
from lidarcheck.model.exact.abreast import (
    ARMED,
    COUNT,
    FEW,
    RESERVE,
    draw_counts,
    draw_windows,
    find_abreast,
    put_rates,
)
from lidarcheck.model.exact.binomial import binomial
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.lane_draws import begin_draws
from lidarcheck.model.lane_math import LANES, log
from lidarcheck.model.rows import add_row, fire_row, spend_row
from lidarcheck.model.streams import Stream

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
    space: Space,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams of the first `held` lanes, which have one background; each has the draws that are its own."""
    group = space.chain.group
    bins: Any = np.int64(0)
    for lane in range(held):
        group.key[lane] = beams[np.uint64(group.beam[lane])]
        bins = max(bins, group.length[lane])
    draw_windows(stream, group, bins, held, space.chain.draws)
    put_rates(pulses, group, level.per_bin, bins, held)
    for lane in range(held):
        _enter(numbers, law, level, stream, lane, space)
    for lane in range(held, LANES):
        group.state[ARMED + np.uint64(lane)] = 0
        space.places.left[lane] = 0.0
    if held < FEW:
        _run_few(numbers, law, stream, bins, held, space)
    else:
        _run(numbers, law, stream, bins, held, space)
    find_abreast(numbers, group, bins, held, echoes)
    touched = 0
    for lane in range(held):
        touched += space.places.state[SPLIT + lane] + space.places.state[NEAR + lane]
        look_outside(numbers, law, level, stream, space, lane, echoes)
        _forget(numbers, lane, space)
    group.counts[: (numbers.dead + bins) * LANES] = 0
    if touched > 0:
        space.places.own[: (numbers.dead + bins) * LANES] = 0


@inlined
def _enter(numbers: Numbers, law: Law, level: Level, stream: Stream, lane: int, space: Space) -> None:
    """What background has left dead when a lane's window begins, and how many avalanches come before the first try."""
    group, places = space.chain.group, space.places
    state = places.state
    begin_draws(places, lane, group.key[lane])
    places.left[lane] = gap(law, -log(1.0 - group.draws[LANES + lane]))
    group.block[lane] = np.uint64((RESERVE + group.length[lane] + 7) // 8)
    state[FIRST + lane] = state[NEAR + lane] = 0
    armed = numbers.detectors
    if group.draws[lane] < level.some:
        clock = -log(1.0 - group.draws[lane])
        slot: Any = np.int64(lane)
        origin: Any = np.int64(0)
        first, fired, known = strike_before(numbers, law, level, stream, places, lane, slot, origin, clock)
        state[FIRST + lane], state[NEAR + lane], state[KNOWN + lane] = first, fired, known
        forget_armed(numbers, places, lane, 0)
        armed -= state[KNOWN + lane]
        for n in range(fired):
            at = numbers.dead + places.near[lane * ROOM + n]
            if at > 0:
                group.counts[at * LANES + lane] += 1
                places.own[at * LANES + lane] += 1
    group.state[ARMED + np.uint64(lane)] = armed
    state[SPLIT + lane], state[ARMED_ALL + lane], state[ARMED_KNOWN + lane] = 0, armed, 0


@inlined
def _forget(numbers: Numbers, lane: int, space: Space) -> None:
    """Leave all detectors of a lane unknown."""
    places, base = space.places, lane * numbers.detectors
    for n in range(places.state[KNOWN + lane]):
        places.armed_from[base + places.known[base + n]] = UNKNOWN
    places.state[KNOWN + lane] = 0


@kernel
def _run(numbers: Numbers, law: Law, stream: Stream, bins: int, held: int, space: Space) -> None:
    """Run the counts of all lanes through the first `bins` bins of their windows."""
    group, left = space.chain.group, space.places.left
    counts, state = group.counts, group.state
    window = np.uint64(numbers.dead) * _LANES
    for k in range(np.uint64(bins)):
        bin_ = k * _LANES
        add_row(state, ARMED, counts, bin_)
        if draw_counts(group, bin_, _FIRST_DRAW + bin_, space.chain.inverse, numbers.detectors):
            fire_row(state, ARMED, state, COUNT, counts, window + bin_)
            if spend_row(left, _FIRST, state, COUNT) != 0:
                set_off(numbers, law, stream, space.places, state, np.int64(0), held, np.int64(k))


@kernel
def _run_few(numbers: Numbers, law: Law, stream: Stream, bins: int, held: int, space: Space) -> None:
    """The same lane by lane, to the last bit."""
    group, left = space.chain.group, space.places.left
    counts, state = group.counts, group.state
    for lane in range(held):
        for k in range(bins):
            at = k * LANES + lane
            armed: Any = np.int64(state[ARMED + np.uint64(lane)] + counts[at])
            draw = group.draws[RESERVE * LANES + at]
            fired = binomial(draw, armed, group.rates[at], space.chain.inverse)
            counts[numbers.dead * LANES + at] = fired
            state[ARMED + np.uint64(lane)] = armed - fired
            left[lane] -= fired
            if left[lane] < 0.0:
                set_off(numbers, law, stream, space.places, state, lane, lane + 1, k)
