"""The exact chain for several beams side by side, bin by bin, one beam in each lane of the processor's vectors.

The chain of a single beam waits: a bin's avalanches must be known before the next bin's can be drawn, and each draw is
a guess that the processor gets wrong. Beams do not wait for each other, and sums and products of many of them cost what
those of one do. Bins are counted from each beam's own window; what each lane works out is, to the last bit, what
`binomial` does for its beam alone, so that neighbours cannot matter.

Arrays are flat: number `row * LANES + lane`. A constant distance between rows is what tells the compiler that they do
not overlap.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray, WordArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.binomial import BELOW_ONE
from lidarcheck.model.exact.echoes import EchoArrays, keep
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_math import LANES, LN2, exp, expm1, log1m

__all__ = [
    "ARMED",
    "COUNT",
    "MOST_BINS",
    "MOST_DETECTORS",
    "RESERVE",
    "Abreast",
    "draw_counts",
    "draw_entry",
    "find_abreast",
    "last_on",
    "new_abreast",
    "run_abreast",
]

RESERVE = 12
"""Draws set aside for entering the window, the last two of them for `is_quiet`; a beam in need of more fetches them."""
MOST_BINS = 4096
"""Bins of the longest window that is run side by side, so that memory stays bounded: more than a sensor's trace has."""
MOST_DETECTORS = 800
"""Up to here P(K = 0) cannot underflow, and `binomial` sums from one end."""

_LANES: Any = np.uint64(LANES)
_ONE, _TWO, _THREE, _FOUR = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
ARMED, _TERM, _ODDS, _GROWTH, _LEFT, COUNT = (np.uint64(k * LANES) for k in range(6))
_ON, _LENGTH, _BEFORE, _WIDTH, _AREA, _MOMENT, _PEAK = (np.uint64(k * LANES) for k in range(7))
"""Rows of `state`: those of the chain, and those of the search for echoes behind it."""


class Abreast(NamedTuple):
    """Work space of a group.

    Flat arrays, a row of `LANES` for each bin: `rates`, avalanches per armed SPAD from the window's first bin on;
    `draws`, those set aside first; `counts`, avalanches from `dead` bins before the window on. `state`: what is known
    of each lane. Shape (LANES,): each lane's `beam`, the window's `begin` and `length` [bins], the detectors `dead` on
    entry, the `key` that streams know the beam by, and the `block` of draws where its stream stands; `alone`: beams to
    be simulated on their own. `words`: work space of draws.
    """

    rates: FloatArray
    draws: FloatArray
    counts: FloatArray
    state: FloatArray
    beam: IndexArray
    begin: IndexArray
    length: IndexArray
    dead: IndexArray
    alone: IndexArray
    key: WordArray
    block: WordArray
    words: WordArray


def new_abreast(numbers: Numbers) -> Abreast:
    """Work space for one group after another; `counts` is zero before a window and must be left so."""
    bins = min(numbers.bins, MOST_BINS)
    beam, begin, length, dead, alone = np.zeros((5, LANES), dtype=np.int64)
    key, block = np.zeros((2, LANES), dtype=np.uint64)
    return Abreast(
        np.zeros(bins * LANES),
        np.zeros((RESERVE + bins + 4) * LANES),
        np.zeros((numbers.dead + bins) * LANES),
        np.zeros(8 * LANES),
        beam,
        begin,
        length,
        dead,
        alone,
        key,
        block,
        np.zeros(4 * LANES, dtype=np.uint64),
    )


@inlined
def _open(group: Abreast, bin_: Any, draw: Any) -> Any:
    """In how many lanes there may be avalanches, and in how many most detectors avalanche."""
    rates, draws, state = group.rates, group.draws, group.state
    some = bright = 0
    for lane in range(_LANES):
        armed, rate = state[ARMED + lane], rates[bin_ + lane]
        # exp(-x) >= 1 - x: most quiet bins are settled without an exponential.
        some += 1 if draws[draw + lane] >= 1.0 - armed * rate else 0
        bright += 1 if rate >= LN2 and armed > 0.0 else 0
    return some, bright


@inlined
def _begin(group: Abreast, bin_: Any, draw: Any) -> int:
    """Set up the sums of a bin where the avalanches are counted; how many lanes have any."""
    rates, draws, state = group.rates, group.draws, group.state
    left = 0
    for lane in range(_LANES):
        armed, rate = state[ARMED + lane], rates[bin_ + lane]
        uniform = draws[draw + lane] * BELOW_ONE
        zero = exp(-armed * rate)
        odds = expm1(rate)
        state[_TERM + lane] = zero
        state[_ODDS + lane] = odds
        state[_GROWTH + lane] = odds * (armed + 1.0)
        state[_LEFT + lane] = uniform if uniform >= zero else -1.0
        state[COUNT + lane] = 0.0
        left += 1 if uniform >= zero else 0
    return left


@inlined
def _begin_bright(group: Abreast, bin_: Any, draw: Any) -> int:
    """The same for a bin where, in some lanes, the detectors are counted that do not avalanche."""
    rates, draws, state = group.rates, group.draws, group.state
    left = 0
    for lane in range(_LANES):
        armed, rate = state[ARMED + lane], rates[bin_ + lane]
        uniform = draws[draw + lane] * BELOW_ONE
        miss = exp(-(rate if rate < 600.0 else 600.0))
        most = rate >= LN2
        zero = exp(armed * (log1m(miss if most else 0.5) if most else -rate))
        odds = miss / (1.0 - miss) if most else expm1(rate if rate < 1.0 else 1.0)
        state[_TERM + lane] = zero
        state[_ODDS + lane] = odds
        state[_GROWTH + lane] = odds * (armed + 1.0)
        state[_LEFT + lane] = uniform if uniform >= zero else -1.0
        state[COUNT + lane] = 0.0
        left += 1 if uniform >= zero else 0
    return left


@inlined
def _step(group: Abreast, inverse: FloatArray, k: Any) -> int:
    """Four terms of the sums from P(K = k) on, as in `binomial`; how many lanes have not found their number yet.

    A lane that has is left with -1, which is below every term.
    """
    state = group.state
    first, second, third, fourth = inverse[k + _ONE], inverse[k + _TWO], inverse[k + _THREE], inverse[k + _FOUR]
    left = 0
    for lane in range(_LANES):
        odds, growth = state[_ODDS + lane], state[_GROWTH + lane]
        term, uniform = state[_TERM + lane], state[_LEFT + lane]
        one = growth * first - odds
        two = one * (growth * second - odds)
        ratio = growth * third - odds
        three = two * ratio
        four = two * (ratio * (growth * fourth - odds))
        up_to_one = 1.0 + one
        up_to_two = up_to_one + two
        step = term * (up_to_two + three)
        above = 1.0 if uniform >= term else 0.0
        above += 1.0 if uniform >= term * up_to_one else 0.0
        above += 1.0 if uniform >= term * up_to_two else 0.0
        above += 1.0 if uniform >= step else 0.0
        state[COUNT + lane] += above
        state[_LEFT + lane] = uniform - step if uniform >= step else -1.0
        state[_TERM + lane] = term * four
        left += 1 if uniform >= step else 0
    return left


@kernel
def draw_counts(group: Abreast, bin_: Any, draw: Any, inverse: FloatArray, detectors: int) -> bool:
    """One number for each lane, as `binomial` draws it, into `COUNT`; False where all of them are 0."""
    some, bright = _open(group, bin_, draw)
    if some + bright == 0:
        return False
    left = _begin(group, bin_, draw) if bright == 0 else _begin_bright(group, bin_, draw)
    term, last = np.uint64(0), np.uint64(detectors)
    while left > 0 and term <= last:
        left = _step(group, inverse, term)
        term += _FOUR
    rates, state = group.rates, group.state
    for lane in range(_LANES):
        armed, count = state[ARMED + lane], state[COUNT + lane]
        count = count if count < armed else armed
        state[COUNT + lane] = armed - count if rates[bin_ + lane] >= LN2 else count
    return True


@kernel
def draw_entry(numbers: Numbers, group: Abreast, dead_rate: float, held: int, inverse: FloatArray) -> None:
    """Draw how many detectors of the first `held` lanes are dead on entry, from draw 0; uses the first row of rates."""
    rates, state, dead = group.rates, group.state, group.dead
    for lane in range(_LANES):
        rates[lane] = dead_rate
        state[ARMED + lane] = numbers.detectors if lane < held else 0
    some = draw_counts(group, np.uint64(0), np.uint64(0), inverse, numbers.detectors)
    for lane in range(_LANES):
        dead[lane] = np.int64(state[COUNT + lane]) if some else 0


@kernel
def run_abreast(numbers: Numbers, group: Abreast, bins: int, inverse: FloatArray) -> None:
    """Run the avalanche counts of all lanes through the first `bins` bins of their windows."""
    counts, state = group.counts, group.state
    for lane in range(_LANES):
        state[ARMED + lane] = numbers.detectors - group.dead[lane]
    window, first_draw = np.uint64(numbers.dead) * _LANES, np.uint64(RESERVE * LANES)
    for k in range(np.uint64(bins)):
        bin_ = k * _LANES
        for lane in range(_LANES):
            state[ARMED + lane] += counts[bin_ + lane]
        some = draw_counts(group, bin_, first_draw + bin_, inverse, numbers.detectors)
        for lane in range(_LANES):
            fired = state[COUNT + lane] if some else 0.0
            counts[window + bin_ + lane] = fired
            state[ARMED + lane] -= fired


@kernel
def find_abreast(numbers: Numbers, group: Abreast, bins: int, held: int, echoes: EchoArrays) -> None:
    """Find the echoes in the first `bins` bins of the first `held` lanes' windows: what `find_echoes` does for each.

    A lane's echo is written down when the next one begins, or at last: most lanes have one.
    """
    counts, state, length = group.counts, group.state, group.length
    window = np.uint64(numbers.dead) * _LANES
    leaving = np.uint64(numbers.dead - numbers.on + 1) * _LANES
    threshold = float(numbers.threshold)
    state[:] = 0.0
    for lane in range(held):
        echoes.held[np.uint64(group.beam[lane])] = 0
    for lane in range(_LANES):
        state[_LENGTH + lane] = length[lane]
    for k in range(leaving, window, _LANES):
        for lane in range(_LANES):
            state[_ON + lane] += counts[k + lane]
    for k in range(np.uint64(bins)):
        bin_, time = k * _LANES, float(k)
        high = 0
        for lane in range(_LANES):
            on = state[_ON + lane] + counts[window + bin_ + lane]
            state[_ON + lane] = on
            high += 1 if on > threshold or state[_BEFORE + lane] > 0.0 else 0
        if high > 0:
            _add_bin(group, time, threshold, echoes)
        for lane in range(_LANES):
            state[_ON + lane] -= counts[leaving + bin_ + lane]
    for lane in range(_LANES):
        _keep_pending(group, lane, echoes)


@inlined
def _add_bin(group: Abreast, bin_: float, threshold: float, echoes: EchoArrays) -> None:
    """Add what a bin has above the threshold to the sums of each lane, within its own window."""
    state = group.state
    again = 0
    for lane in range(_LANES):
        begins = state[_ON + lane] > threshold and state[_BEFORE + lane] <= 0.0
        again += 1 if begins and state[_WIDTH + lane] > 0.0 else 0
    if again > 0:
        for lane in range(_LANES):
            if state[_ON + lane] > threshold and state[_BEFORE + lane] <= 0.0:
                _keep_pending(group, lane, echoes)
    for lane in range(_LANES):
        on = state[_ON + lane]
        above = on if on > threshold and bin_ < state[_LENGTH + lane] else 0.0
        state[_BEFORE + lane] = above
        state[_WIDTH + lane] += 1.0 if above > 0.0 else 0.0
        state[_AREA + lane] += above
        state[_MOMENT + lane] += above * bin_
        state[_PEAK + lane] = above if above > state[_PEAK + lane] else state[_PEAK + lane]


@inlined
def last_on(numbers: Numbers, group: Abreast, lane: int) -> int:
    """Detectors ON in the last bin of a lane's window, 0 where it has none."""
    on, length = 0.0, group.length[lane]
    if length > 0:
        for age in range(numbers.on):
            on += group.counts[(numbers.dead + length - 1 - age) * LANES + lane]
    return int(on)


@kernel
def _keep_pending(group: Abreast, lane: Any, echoes: EchoArrays) -> None:
    """Write down the echo that a lane has ended, if there is one."""
    state = group.state
    if state[_WIDTH + lane] > 0.0:
        beam: Any = np.uint64(group.beam[lane])
        width, area, peak = int(state[_WIDTH + lane]), int(state[_AREA + lane]), int(state[_PEAK + lane])
        keep(echoes, beam, group.begin[lane] + 0.5 + state[_MOMENT + lane] / state[_AREA + lane], width, area, peak)
        for row in (_WIDTH, _AREA, _MOMENT, _PEAK):
            state[row + lane] = 0.0
