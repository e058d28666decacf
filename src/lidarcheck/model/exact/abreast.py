"""The exact chain for several beams side by side, bin by bin, one beam in each lane of the processor's vectors.

The chain of a single beam waits: a bin's avalanches must be known before the next bin's can be drawn, and each draw is
a guess that the processor gets wrong. Beams do not wait for each other, and sums and products of many of them cost what
those of one do. Bins are counted from each beam's own window. Of most bins, few lanes have an avalanche: these are
drawn by `binomial`, and of brighter bins all lanes at once, to the same number (`quick_sums.py`). What each lane gets
is, to the last bit, what its beam gets alone, so that neighbours cannot matter.

Arrays are flat: number `row * LANES + lane`. A constant distance between rows is what tells the compiler that they do
not overlap.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray, IntArray, ShortArray, SingleArray, WordArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact import quick_sums
from lidarcheck.model.exact.binomial import binomial, inverses
from lidarcheck.model.exact.echoes import EchoArrays, keep
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, add_pulses
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.rows import add_echo, add_row, clear_row, fire_row, how_many, lowest, on_row, open_row, take_row
from lidarcheck.model.streams import Stream, fill_twice, fill_twice_abreast, rewind

__all__ = [
    "ARMED",
    "COUNT",
    "FEW",
    "MOST_BINS",
    "MOST_DETECTORS",
    "RESERVE",
    "Abreast",
    "draw_counts",
    "draw_entry",
    "draw_windows",
    "find_abreast",
    "last_on",
    "new_abreast",
    "put_rates",
    "run_abreast",
]

RESERVE = 12
"""Draws set aside for entering the window, the last two of them for `looks_quiet`; who needs more fetches them."""
MOST_BINS = 4096
"""Bins of the longest window that is run side by side, so that memory stays bounded: more than a sensor's trace has."""
MOST_DETECTORS = 800
"""Up to here P(K = 0) cannot underflow, and `binomial` sums from one end."""

_LANES: Any = np.uint64(LANES)
_FIRST, _ONE = np.uint64(0), np.uint64(1)
ARMED, COUNT, _ON, _LAST, _LENGTH = (np.uint64(k * LANES) for k in range(5))
"""Rows of `state`: those of the chain, and those of the search for echoes behind it."""
_WIDTH, _AREA, _PEAK = (np.uint64(k * LANES) for k in range(3))
"""Rows of `echo`."""
_MOST_THRESHOLD = 32767
"""Rows hold numbers of 16 bits."""
_FEW_OPEN = 3
"""Lanes with an avalanche up to which it is faster to draw them one by one."""
FEW = 8
"""Beams fewer than which are faster one by one."""


class Abreast(NamedTuple):
    """Work space of a group.

    Flat arrays, a row of `LANES` for each bin: `rates`, avalanches per armed SPAD from the window's first bin on;
    `draws`, those set aside first; `counts`, avalanches from `dead` bins before the window on. What is known of each
    lane, a row for each thing: `state`; `sums`, see `quick_sums`; `echo`, the width, area and peak of the echo that
    goes on, and its `moment`. Shape (LANES,): each lane's `beam`, the window's `begin` and `length` [bins], the
    detectors `dead` on entry, the `key` that streams know the beam by, and the `block` of draws where its stream
    stands; `alone`: beams to be simulated on their own. `words`: work space of draws. `inverse`: 1 / k.
    """

    rates: FloatArray
    draws: FloatArray
    counts: ShortArray
    state: ShortArray
    sums: SingleArray
    echo: IntArray
    moment: FloatArray
    beam: IndexArray
    begin: IndexArray
    length: IndexArray
    dead: IndexArray
    alone: IndexArray
    key: WordArray
    block: WordArray
    words: WordArray
    inverse: SingleArray


def new_abreast(numbers: Numbers) -> Abreast:
    """Work space for one group after another; `counts` is zero before a window and must be left so."""
    bins = min(numbers.bins, MOST_BINS)
    beam, begin, length, dead, alone = np.zeros((5, LANES), dtype=np.int64)
    key, block = np.zeros((2, LANES), dtype=np.uint64)
    return Abreast(
        np.zeros(bins * LANES),
        np.zeros((RESERVE + bins + 8) * LANES),
        np.zeros((numbers.dead + bins) * LANES, dtype=np.int16),
        np.zeros(5 * LANES, dtype=np.int16),
        np.zeros(quick_sums.ROWS * LANES, dtype=np.float32),
        np.zeros(3 * LANES, dtype=np.int32),
        np.zeros(LANES),
        beam,
        begin,
        length,
        dead,
        alone,
        key,
        block,
        np.zeros(4 * LANES, dtype=np.uint64),
        inverses(numbers.detectors).astype(np.float32),
    )


@kernel
def _draw_some(
    rates: FloatArray, bin_: Any, draws: FloatArray, draw: Any, state: ShortArray, inverse: FloatArray, mask: Any
) -> None:
    """The numbers of the lanes of a mask, one by one."""
    while mask != 0:
        lane = lowest(mask)
        mask &= mask - _ONE
        armed: Any = np.int64(state[ARMED + lane])
        state[COUNT + lane] = binomial(draws[draw + lane], armed, rates[bin_ + lane], inverse)


@inlined
def draw_counts(group: Abreast, bin_: Any, draw: Any, inverse: FloatArray, detectors: int) -> bool:
    """One number for each lane, as `binomial` draws it, into `COUNT`; False where all of them are 0."""
    rates, draws, state = group.rates, group.draws, group.state
    # With two trials or more, bins so bright that the trials are counted that do not fire are always open.
    open_ = open_row(draws, draw, rates, bin_, float(max(detectors, 2)))
    if open_ == 0:
        return False
    if how_many(open_) <= _FEW_OPEN:
        clear_row(state, COUNT)
    else:
        open_ = quick_sums.settle(rates, bin_, draws, draw, group.inverse, state, group.sums, detectors)
    if open_ != 0:
        _draw_some(rates, bin_, draws, draw, state, inverse, open_)
    return True


@inlined
def draw_windows(stream: Stream, group: Abreast, bins: int, held: int, draws: FloatArray) -> None:
    """Fill the draws of the first `held` lanes, for windows of up to `bins` bins; `draws` is work space."""
    if held >= FEW:
        fill_twice_abreast(stream, group.key, (RESERVE + bins + 7) // 8, group.words, group.draws)
    else:
        for lane in range(held):
            rewind(stream, group.key[lane])
            fill_twice(stream, draws, RESERVE + bins)
            for k in range(RESERVE + bins):
                group.draws[k * LANES + lane] = draws[k]


@inlined
def put_rates(pulses: Pulses, group: Abreast, per_bin: float, bins: int, held: int) -> None:
    """The rates of the first `held` lanes' windows; 0 behind them, up to `bins` bins, and in the other lanes."""
    group.rates[: bins * LANES] = per_bin
    for lane in range(LANES):
        if lane < held:
            begin, end = group.begin[lane], group.begin[lane] + group.length[lane]
            i: Any = np.uint64(group.beam[lane])
            add_pulses(pulses, i, begin, end, group.rates, lane, LANES)
        for k in range(group.length[lane] if lane < held else 0, bins):
            group.rates[k * LANES + lane] = 0.0


@inlined
def draw_entry(numbers: Numbers, group: Abreast, dead_rate: float, held: int, inverse: FloatArray) -> None:
    """Draw how many detectors of the first `held` lanes are dead on entry, from draw 0; uses the first row of rates."""
    rates, state, dead = group.rates, group.state, group.dead
    for lane in range(_LANES):
        rates[lane] = dead_rate
        state[ARMED + lane] = numbers.detectors if lane < held else 0
    some = draw_counts(group, _FIRST, _FIRST, inverse, numbers.detectors)
    for lane in range(_LANES):
        dead[lane] = np.int64(state[COUNT + lane]) if some else 0


@inlined
def run_abreast(numbers: Numbers, group: Abreast, bins: int, inverse: FloatArray) -> None:
    """Run the avalanche counts of all lanes through the first `bins` bins of their windows."""
    counts, state = group.counts, group.state
    for lane in range(_LANES):
        state[ARMED + lane] = numbers.detectors - group.dead[lane]
    window, first_draw = np.uint64(numbers.dead) * _LANES, np.uint64(RESERVE * LANES)
    for k in range(np.uint64(bins)):
        bin_ = k * _LANES
        add_row(state, ARMED, counts, bin_)
        if draw_counts(group, bin_, first_draw + bin_, inverse, numbers.detectors):
            fire_row(state, ARMED, state, COUNT, counts, window + bin_)
        else:
            clear_row(counts, window + bin_)


@inlined
def find_abreast(numbers: Numbers, group: Abreast, bins: int, held: int, echoes: EchoArrays) -> None:
    """Find the echoes in the first `bins` bins of the first `held` lanes' windows; keep what is ON last for `last_on`.

    A lane's echo is written down when the next one begins, or at last: most lanes have one.
    """
    counts, state = group.counts, group.state
    window = np.uint64(numbers.dead) * _LANES
    leaving = np.uint64(numbers.dead - numbers.on + 1) * _LANES
    clear_row(state, _ON)
    clear_row(state, _LAST)
    for lane in range(_LANES):
        state[_LENGTH + lane] = group.length[lane] if lane < held else 0
    for lane in range(held):
        echoes.held[np.uint64(group.beam[lane])] = 0
    for k in range(leaving, window, _LANES):
        add_row(state, _ON, counts, k)
    # A beam that nothing comes back to has no window: what background has left ON reaches into its first bins.
    add_row(state, _LAST, state, _ON)
    pending = before = np.uint64(0)
    threshold = min(np.int64(numbers.threshold), np.int64(_MOST_THRESHOLD))
    for k in range(np.uint64(bins)):
        bin_ = k * _LANES
        above = on_row(state, _ON, counts, window + bin_, state, _LENGTH, np.int64(k), threshold)
        if above != 0:
            ended = above & ~before & pending
            if ended != 0:
                _keep_all(group, ended, echoes)
            add_echo(state, _ON, group.echo, _FIRST, group.moment, _FIRST, above, np.int64(k))
            pending |= above
        before = above
        take_row(state, _ON, counts, leaving + bin_)
    _keep_all(group, pending, echoes)


@kernel
def _keep_all(group: Abreast, mask: Any, echoes: EchoArrays) -> None:
    """Write down the echoes that the lanes of a mask have ended."""
    echo, moment = group.echo, group.moment
    width: Any
    area: Any
    peak: Any
    while mask != 0:
        lane = lowest(mask)
        mask &= mask - _ONE
        # Numbers of one kind, for which `keep` is compiled once.
        width, area, peak = np.int64(echo[_WIDTH + lane]), np.int64(echo[_AREA + lane]), np.int64(echo[_PEAK + lane])
        centre = group.begin[lane] + 0.5 + moment[lane] / area
        beam: Any = np.uint64(group.beam[lane])
        keep(echoes, beam, centre, width, area, peak)
        echo[_WIDTH + lane] = echo[_AREA + lane] = echo[_PEAK + lane] = 0
        moment[lane] = 0.0


@inlined
def last_on(numbers: Numbers, group: Abreast, lane: int) -> int:
    """Detectors ON in the last bin of a lane's window, or still ON behind it where it has none; see `find_abreast`."""
    on: Any = np.int64(group.state[_LAST + np.uint64(lane)])
    return int(on)
