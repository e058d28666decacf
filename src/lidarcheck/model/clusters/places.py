"""What an avalanche sets off, where all that is known of most detectors is how many avalanched in each bin.

Detectors are alike until somebody asks for one by its place in the array. An avalanche that tries to set off a
neighbour is asked for its place, one of all those that it may be, with equal chances; the neighbour is asked what it
did, which the counts tell with their chances: armed, avalanching in this bin, or dead since any of the last ones. From
then on both are known, and stand out from the others: of later avalanches, those that struck them are drawn once
somebody asks again, bin by bin, as balls out of an urn. Nothing else depends on places, so this is exact, not a guess.

Known detectors that are armed are forgotten as soon as all others are armed, too: they are alike again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import ShortArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.clusters.law import ARMED_ALL, ARMED_KNOWN, KNOWN, SPLIT, UNKNOWN, Law, Places
from lidarcheck.model.exact.abreast import ARMED
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_draws import secondary, waiting_time
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.streams import Stream

__all__ = ["catch_up", "forget_armed", "gap", "learn", "set_off", "tried", "unknown_place"]


@inlined
def gap(law: Law, waiting: float) -> float:
    """How many avalanches that try nothing come before the next that does, from an exponential number."""
    return float(int(min(waiting * law.per_log, 1e9)))


@kernel
def tried(law: Law, stream: Stream, places: Places, lane: int) -> int:
    """Which neighbours an avalanche tries to set off that tries at least one: a bit for each direction."""
    quiet, chance = law.quiet, law.chance
    draw = quiet[0] + (1.0 - quiet[0]) * secondary(stream, places, lane)
    found, first = 0, 0
    while first < 8 and draw >= quiet[first]:
        survival, one = 1.0, first
        while one < 7:
            survival *= 1.0 - chance[one]
            if survival <= draw:
                break
            one += 1
        found |= 1 << one
        first = one + 1
        draw = secondary(stream, places, lane)
    return found


@inlined
def learn(numbers: Numbers, places: Places, lane: int, place: Any, armed_from: int) -> None:
    """From now on a detector is known."""
    base, number = lane * numbers.detectors, places.state[KNOWN + lane]
    places.armed_from[base + place] = armed_from
    places.known[base + number] = place
    places.state[KNOWN + lane] = number + 1


@inlined
def unknown_place(numbers: Numbers, stream: Stream, places: Places, lane: int) -> int:
    """The place of one of the detectors that are not known, of which there must be one."""
    base = lane * numbers.detectors
    place = int(secondary(stream, places, lane) * numbers.detectors)
    while places.armed_from[base + place] != UNKNOWN:
        place = int(secondary(stream, places, lane) * numbers.detectors)
    return place


@kernel
def forget_armed(numbers: Numbers, places: Places, lane: int, bin_: int) -> None:
    """Of the known detectors, keep those that are dead at the beginning of a bin."""
    base, kept = lane * numbers.detectors, 0
    for n in range(places.state[KNOWN + lane]):
        place = places.known[base + n]
        if places.armed_from[base + place] > bin_:
            places.known[base + kept] = place
            kept += 1
        else:
            places.armed_from[base + place] = UNKNOWN
    places.state[KNOWN + lane] = kept


@inlined
def _split(
    numbers: Numbers, stream: Stream, places: Places, lane: int, bin_: int, armed: int, known: int, fired: int
) -> int:
    """Draw which `known` ones are among the `fired` of all `armed` detectors; into `places.fired`, and how many."""
    base, listed, n = lane * numbers.detectors, 0, 0
    while known > 0 and fired > 0:
        draw = 1.0 - secondary(stream, places, lane)
        fewer, more = min(known, fired), max(known, fired)
        none = 1.0
        for k in range(fewer):
            none *= max(armed - more - k, 0) * places.inverse[armed - k]
        if draw <= none:
            break
        passed, survival = 0, (armed - fired) * places.inverse[armed]
        while survival >= draw and passed < known - 1:
            passed += 1
            survival *= (armed - passed - fired) * places.inverse[armed - passed]
        armed, known, fired = armed - passed - 1, known - passed - 1, fired - 1
        while True:
            place = places.known[base + n]
            n += 1
            if places.armed_from[base + place] <= bin_:
                if passed == 0:
                    break
                passed -= 1
        places.armed_from[base + place] = bin_ + numbers.dead
        places.own[(numbers.dead + bin_) * LANES + lane] += 1
        places.fired[listed] = place
        listed += 1
    return listed


@kernel
def catch_up(numbers: Numbers, stream: Stream, places: Places, lane: int, bin_: int) -> int:
    """Split the avalanches of all bins up to `bin_` among detectors that are known and others.

    How many of the former avalanche in `bin_` itself, in `places.fired`. `state` tells how many detectors are armed at
    the beginning of that bin, and how many of the known ones do not avalanche.
    """
    state, counts, own = places.state, places.counts, places.own
    armed, mine, listed = state[ARMED_ALL + lane], state[ARMED_KNOWN + lane], 0
    for k in range(state[SPLIT + lane], bin_ + 1):
        armed += counts[k * LANES + lane]
        mine += own[k * LANES + lane]
        if mine > 0 and armed - mine == numbers.detectors - state[KNOWN + lane]:
            forget_armed(numbers, places, lane, k)
            mine = 0
        fired: Any = np.int64(counts[(numbers.dead + k) * LANES + lane])
        listed = 0
        if mine > 0 and fired > 0:
            listed = _split(numbers, stream, places, lane, k, armed, mine, fired)
            mine -= listed
        if k < bin_:
            armed -= fired
    state[SPLIT + lane], state[ARMED_ALL + lane], state[ARMED_KNOWN + lane] = bin_, armed, mine
    return listed


@inlined
def _try_all(
    numbers: Numbers,
    law: Law,
    stream: Stream,
    places: Places,
    lane: int,
    bin_: int,
    place: Any,
    others_armed: int,
    others_fired: int,
    listed: int,
    joined: int,
) -> Any:
    """Try to set off neighbours of an avalanche that tries at least one.

    Of the detectors that are not known, `others_armed` are armed and have not fired in this bin, `others_fired` have;
    `listed` known ones have by themselves, `joined` have been set off. Returns these four numbers.
    """
    state, own, base = places.state, places.own, lane * numbers.detectors
    directions = tried(law, stream, places, lane)
    row = (numbers.dead + bin_) * LANES + lane
    for one in range(8):
        other = law.neighbour[place, one] if directions >> one & 1 else np.int32(-1)
        if other < 0:
            continue
        fires = False
        armed_from = places.armed_from[base + other]
        if armed_from == UNKNOWN:
            ball = secondary(stream, places, lane) * (numbers.detectors - state[KNOWN + lane])
            if ball < others_armed:
                fires = True
                others_armed -= 1
                learn(numbers, places, lane, other, bin_)
            elif ball < others_armed + others_fired:
                others_fired -= 1
                learn(numbers, places, lane, other, bin_ + numbers.dead)
                own[row] += 1
                places.fired[listed] = other
                listed += 1
            else:
                ball -= others_armed + others_fired
                age = 1
                while age < numbers.dead - 1:
                    at = row - age * LANES
                    ball -= places.counts[at] - own[at]
                    if ball < 0.0:
                        break
                    age += 1
                learn(numbers, places, lane, other, bin_ - age + numbers.dead)
                own[row - age * LANES] += 1
        elif armed_from <= bin_:
            fires = True
            state[ARMED_KNOWN + lane] -= 1
        if fires:
            places.armed_from[base + other] = bin_ + numbers.dead
            own[row] += 1
            places.joined[joined] = other
            joined += 1
    return others_armed, others_fired, listed, joined


@kernel
def set_off(
    numbers: Numbers, law: Law, stream: Stream, places: Places, armed: ShortArray, first: Any, last: int, bin_: Any
) -> None:
    """Set off what the avalanches of a bin of the windows try to, in those of the lanes `first` ... `last - 1` in
    which `left` is below 0; `armed`: the group's `state`."""
    for lane in range(first, last):
        if places.left[lane] < 0.0:
            _set_off(numbers, law, stream, places, armed, lane, bin_)


@inlined
def _set_off(
    numbers: Numbers, law: Law, stream: Stream, places: Places, armed: ShortArray, lane: int, bin_: int
) -> None:
    state, left = places.state, places.left
    row = (numbers.dead + bin_) * LANES + lane
    fired: Any = np.int64(places.counts[row])
    listed = 0
    if state[KNOWN + lane] > 0:
        listed = catch_up(numbers, stream, places, lane, bin_)
    else:
        state[ARMED_KNOWN + lane] = 0
        state[ARMED_ALL + lane] = armed[ARMED + np.uint64(lane)] + fired
    others_fired = fired - listed
    others_armed = state[ARMED_ALL + lane] - state[ARMED_KNOWN + lane] - fired
    joined = 0
    while left[lane] < 0.0:
        ball = int(secondary(stream, places, lane) * (listed + others_fired))
        if ball < listed:
            listed -= 1
            place: Any = places.fired[ball]
            places.fired[ball] = places.fired[listed]
        else:
            place = np.int64(unknown_place(numbers, stream, places, lane))
            others_fired -= 1
            learn(numbers, places, lane, place, bin_ + numbers.dead)
            places.own[row] += 1
        others_armed, others_fired, listed, joined = _try_all(
            numbers, law, stream, places, lane, bin_, place, others_armed, others_fired, listed, joined
        )
        left[lane] += 1.0 + gap(law, waiting_time(stream, places, lane))
    done = 0
    while done < joined:
        left[lane] -= 1.0
        if left[lane] < 0.0:
            place = places.joined[done]
            others_armed, others_fired, listed, joined = _try_all(
                numbers, law, stream, places, lane, bin_, place, others_armed, others_fired, listed, joined
            )
            left[lane] += 1.0 + gap(law, waiting_time(stream, places, lane))
        done += 1
    places.counts[row] += joined
    armed[ARMED + np.uint64(lane)] -= joined
    state[SPLIT + lane] = bin_ + 1
    state[ARMED_ALL + lane] -= fired + joined
