"""Background that strikes one detector or another, each in its place: just before a window, and where echoes may be.

Strikes are as rare as background, so every detector that avalanches is known there. Going back from a bin, `dead` - 1
bins without a strike leave all detectors armed behind them, whatever came before: from there on, forwards.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.clusters.law import ROOM, UNKNOWN, Law, Level, Places, Space
from lidarcheck.model.clusters.places import gap, tried
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_draws import secondary, waiting_time
from lidarcheck.model.streams import Stream

__all__ = ["bin_of", "gather", "strike_all", "strike_before"]

_SHIFT, _ORIGIN = 7, 1 << 20
"""An entry of `strikes`: the bin, counted from -_ORIGIN, the detector, the cluster's size; in order of time."""


@inlined
def _fire(numbers: Numbers, places: Places, slot: int, place: Any, bin_: int, fired: int, known: int) -> Any:
    """An avalanche: written down, its detector known. How many of both there are then."""
    base = slot * numbers.detectors
    if places.armed_from[base + place] == UNKNOWN:
        places.known[base + known] = place
        known += 1
    places.armed_from[base + place] = bin_ + numbers.dead
    if fired < ROOM:
        places.near[slot * ROOM + fired] = bin_
        fired += 1
    return fired, known


@kernel
def strike_before(
    numbers: Numbers,
    law: Law,
    level: Level,
    stream: Stream,
    places: Places,
    lane: int,
    slot: Any,
    origin: int,
    clock: float,
) -> Any:
    """What background does just before bin `origin`, with the places of `slot`; `clock`: the first exponential number.

    Returns the bin before which all detectors are armed, how many avalanches stand in `near`, and how many detectors
    in `known`.
    """
    strikes, base = places.earliest, slot * numbers.detectors
    number, first, fired, known = 0, origin, 0, 0
    while number < len(strikes):
        cell = int(min(clock / level.per_bin, 1e15))
        bin_ = origin - 1 - cell // numbers.detectors
        if bin_ <= first - numbers.dead:
            break
        strikes[number] = cell
        number += 1
        first = bin_
        clock += waiting_time(stream, places, lane)
    for n in range(number - 1, -1, -1):
        back = strikes[n] // numbers.detectors
        bin_, struck = origin - 1 - back, strikes[n] - back * numbers.detectors
        if places.armed_from[base + struck] > bin_:
            continue
        done, joined = 0, 1
        places.joined[0] = struck
        fired, known = _fire(numbers, places, slot, struck, bin_, fired, known)
        while done < joined:
            places.left[lane] -= 1.0
            if places.left[lane] < 0.0:
                places.left[lane] += 1.0 + gap(law, waiting_time(stream, places, lane))
                directions = tried(law, stream, places, lane)
                for one in range(8):
                    other = law.neighbour[places.joined[done], one] if directions >> one & 1 else np.int32(-1)
                    if other >= 0 and places.armed_from[base + other] <= bin_:
                        places.joined[joined] = other
                        joined += 1
                        fired, known = _fire(numbers, places, slot, other, bin_, fired, known)
            done += 1
    return first, fired, known


@inlined
def _among_sides(law: Law, draw: float, size: int) -> int:
    """How many of the `size` - 1 tries of a cluster of that size go to sides."""
    if law.chance[4] == 0.0:
        return size - 1
    odds = law.chance[0] / (1.0 - law.chance[0]) * (1.0 - law.chance[4]) / law.chance[4]
    total, term = 0.0, 1.0
    for k in range(size):
        total += term
        term *= odds * (4 * size - k) / (k + 1) * (size - 1 - k) / (4 * size - (size - 1 - k) + 1)
    left, term = draw * total, 1.0
    for k in range(size):
        left -= term
        if left < 0.0:
            return k
        term *= odds * (4 * size - k) / (k + 1) * (size - 1 - k) / (4 * size - (size - 1 - k) + 1)
    return size - 1


@inlined
def _grow(law: Law, stream: Stream, places: Places, lane: int, size: int) -> int:
    """Draw what each avalanche of a cluster of that size tries, into `tree`; which of them comes first.

    Tries are spread over all avalanches and their neighbours; of the orders into which the avalanches can be rotated,
    one is that of a tree: the one that begins behind the first lowest sum of tries - 1.
    """
    tree = places.tree
    for n in range(size):
        tree[n] = 0
    sides = _among_sides(law, secondary(stream, places, lane), size)
    done = 0
    while done < size - 1:
        slot = int(secondary(stream, places, lane) * (4 * size))
        bit = 1 << ((slot & 3) + (0 if done < sides else 4))
        if tree[slot >> 2] & bit == 0:
            tree[slot >> 2] |= bit
            done += 1
    total = lowest = first = 0
    for n in range(size):
        total -= 1
        for one in range(8):
            total += tree[n] >> one & 1
        if total < lowest:
            lowest, first = total, n + 1
    return first if first < size else 0


@inlined
def _strike(
    numbers: Numbers,
    law: Law,
    stream: Stream,
    places: Places,
    lane: int,
    slot: int,
    bin_: int,
    struck: Any,
    size: int,
    counts: IndexArray,
    index: Any,
) -> None:
    """A strike whose cluster, taken without limits, has that size; its avalanches are counted in `counts[index]`."""
    base, room = slot * numbers.detectors, len(places.tree) >> 1
    if places.armed_from[base + struck] > bin_:
        return
    places.armed_from[base + struck] = bin_ + numbers.dead
    counts[index] += 1
    if size == 1:
        return
    tree = places.tree
    first = _grow(law, stream, places, lane, size)
    tree[room] = struck
    grown = 1
    for n in range(size):
        place, directions = tree[room + n], tree[(first + n) % size]
        for one in range(8):
            if directions >> one & 1:
                other = np.int64(law.neighbour[place, one]) if place >= 0 else np.int64(-1)
                if other >= 0 and places.armed_from[base + other] > bin_:
                    other = np.int64(-1)
                if other >= 0:
                    places.armed_from[base + other] = bin_ + numbers.dead
                    counts[index] += 1
                tree[room + grown] = other
                grown += 1


@inlined
def _cluster(law: Law, space: Space, draw: float, total: int, mean: float) -> int:
    """The size of a cluster that one of the `total` avalanches of a block belongs to."""
    left = draw * total * space.totals[total] / mean
    for size in range(1, total):
        left -= size * law.sizes[size] * space.totals[total - size]
        if left < 0.0:
            return size
    return total


@inlined
def gather(
    numbers: Numbers, law: Law, stream: Stream, space: Space, lane: int, total: int, bin_: int, number: int
) -> int:
    """Take the block from `bin_` on, whose clusters without limits have `total` avalanches, apart into strikes.

    They stand in `strikes` behind the `number` of later ones there, the last first; how many there are then.
    """
    places, length = space.places, space.chain.blocks.length
    strikes, start = places.strikes, number
    mean = numbers.detectors * length * space.chain.blocks.rate[0]
    while total > 0:
        size = _cluster(law, space, secondary(stream, places, lane), total, mean)
        total -= size
        cell = int(secondary(stream, places, lane) * (length * numbers.detectors))
        entry = ((bin_ + _ORIGIN) * numbers.detectors + cell) << _SHIFT | size
        at = number
        while at > start and strikes[at - 1] < entry:
            strikes[at] = strikes[at - 1]
            at -= 1
        strikes[at] = entry
        number += 1
    return number


@inlined
def bin_of(numbers: Numbers, entry: int) -> int:
    """The bin of a strike."""
    return int((entry >> _SHIFT) // numbers.detectors - _ORIGIN)


@kernel
def strike_all(
    numbers: Numbers,
    law: Law,
    stream: Stream,
    places: Places,
    lane: int,
    slot: int,
    number: int,
    begin: int,
    counts: IndexArray,
) -> None:
    """Let the first `number` of `strikes` strike detectors in the places of `slot`, the last of them first."""
    for n in range(number - 1, -1, -1):
        entry = places.strikes[n]
        cell, bin_ = entry >> _SHIFT, bin_of(numbers, entry)
        struck = cell - (bin_ + _ORIGIN) * numbers.detectors
        size = entry & ((1 << _SHIFT) - 1)
        _strike(numbers, law, stream, places, lane, slot, bin_, struck, size, counts, numbers.pad + begin + bin_)
