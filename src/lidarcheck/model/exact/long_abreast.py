"""Long beams through the exact chain side by side: their avalanches, bin by bin, and their echoes.

A bin is settled for all lanes at once as far as bounds settle it. Let v be one minus the uniform number, and x the
avalanches expected, r of each detector: there is none for v above 1 - exp(-x). The chance of two or more is at most
that of a Poisson number, 1 - (1 + x) exp(-x), and at least that less x r (1 / 2 + r); that of three at most x^3 / 6.
Powers of x bound the exponentials. What is left, where few lanes are, is worked out for each of them, else by sums for
all. Counts are those of `short_draws.count_of`, whichever way they are found, so that neighbours cannot matter.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.echoes import EchoArrays, keep
from lidarcheck.model.exact.long_space import ABOVE, ARMED, FIRED, LANE, ON, Lanes
from lidarcheck.model.exact.long_sums import BRIGHT, sum_doubles, sum_singles
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.short_draws import BINS, CELL, FIRST_BLOCK, WIDE, count_of, fill_words
from lidarcheck.model.rows import lowest
from lidarcheck.model.streams import Stream

__all__ = ["run_lanes"]

_FEW = 14
"""Lanes that bounds leave open, up to which each is worked out on its own."""
_LENGTH, _WIDTH, _AREA, _MOMENT, _PEAK = (np.uint64(k * WIDE) for k in range(5))
"""Rows of `echoes`."""
_ONE, _FOUR, _SHORT = np.uint64(1), np.uint64(4), np.uint64(0xFFFF)
_F0, _F3, _F2ND, _F3RD, _F6TH, _F24TH = (np.float32(x) for x in (0.0, 3.0, 1 / 2, 1 / 3, 1 / 6, 1 / 24))
_F_CELL, _F_CELLS = np.float32(CELL), np.float32(1.0 / CELL)
_F_MARGIN = np.float32(2e-6)
"""More than rounding to seven digits can move a bound."""


@inlined
def _bound(lanes: Lanes, bin_: Any, draw: Any) -> Any:
    """The counts of a bin as far as bounds settle them; which lanes are left open, one bit each, and how many."""
    state, rates, counts, short = lanes.state, lanes.rates, lanes.counts, lanes.short
    open_, left = np.uint64(0), 0
    for lane in range(LANE):
        armed, rate = state[ARMED + lane] + counts[bin_ + lane], rates[bin_ + lane]
        x = armed * rate
        v = (_F_CELLS - np.float32(short[draw + lane])) * _F_CELL
        least = v - _F_CELL - _F_MARGIN
        square = x * x
        cube = square * x
        fourth = square * square * _F24TH
        some_most = x - _F2ND * square + _F6TH * cube
        two_least = _F2ND * square - _F3RD * cube - x * rate * (_F2ND + rate) - _F_MARGIN
        dim = rate < BRIGHT
        one = dim & (v <= some_most - fourth - _F_MARGIN) & (least >= _F2ND * square - _F3RD * cube + _F3 * fourth)
        two = dim & (v <= two_least) & (least >= _F6TH * cube)
        settled = one | two | (dim & (least >= some_most))
        fired = np.float32(one) + (np.float32(two) + np.float32(two))
        state[FIRED + lane] = fired
        state[ARMED + lane] = armed - fired
        open_ |= np.uint64(0) if settled else np.uint64(1) << np.uint64(lane)
        left += 0 if settled else 1
    return open_, left


@kernel
def run_lanes(
    numbers: Numbers, stream: Stream, lanes: Lanes, held: Any, bins: Any, inverse: FloatArray, echoes: EchoArrays
) -> None:
    """Run the avalanche counts of all lanes through the bins 0 ... `bins - 1` and find their echoes."""
    counts, state = lanes.counts, lanes.state
    window, left_behind = np.uint64(numbers.dead) * LANE, np.uint64(numbers.dead - numbers.on) * LANE
    _open_lanes(numbers, lanes)
    threshold = np.float32(numbers.threshold)
    for lane in range(held):
        echoes.held[np.uint64(lanes.beam[lane])] = 0
    for k in range(np.uint64(bins)):
        part = k % np.uint64(BINS)
        if part == np.uint64(0):
            _fill(stream, lanes, np.uint64(FIRST_BLOCK) + k // np.uint64(BINS))
        bin_, draw = k * LANE, part * LANE
        new = bin_ + window
        open_, left = _bound(lanes, bin_, draw)
        if left > _FEW:
            for lane in range(LANE):
                state[ARMED + lane] += state[FIRED + lane]
            open_, too_bright = sum_singles(lanes, bin_, draw, numbers.detectors)
            if too_bright:
                open_ = sum_doubles(lanes, bin_, draw, inverse, numbers.detectors)
        while open_ != np.uint64(0):
            one = lowest(open_)
            open_ &= open_ - np.uint64(1)
            armed, rate, short = (
                np.int64(state[ARMED + one]),
                np.float64(lanes.rates[bin_ + one]),
                lanes.short[draw + one],
            )
            fired = count_of(stream, lanes.key[one], k, short, armed, rate, numbers.detectors, inverse)
            state[FIRED + one] = fired
            state[ARMED + one] = armed - fired
        high = 0
        for lane in range(LANE):
            on = state[ON + lane] + (state[FIRED + lane] - counts[left_behind + bin_ + lane])
            some = (on > threshold) | (state[ABOVE + lane] > _F0)
            high += 1 if some else 0
            state[ON + lane] = on
        for lane in range(LANE):
            counts[new + lane] = state[FIRED + lane]
        if high > 0:
            _add_bin(lanes, float(k), threshold, echoes)
    for lane in range(LANE):
        _keep_pending(lanes.echoes, lanes.beam, lane, echoes)


@kernel
def _fill(stream: Stream, lanes: Lanes, block: Any) -> None:
    """The draws of 16 bins."""
    fill_words(stream, lanes.key, block, lanes.words)
    words, short = lanes.words, lanes.short
    for word in range(np.uint64(4)):
        for part in range(np.uint64(4)):
            at, shift = (word * _FOUR + part) * LANE, np.uint64(16) * part
            for lane in range(LANE):
                short[at + lane] = np.uint16((words[word * LANE + lane] >> shift) & _SHORT)


@inlined
def _open_lanes(numbers: Numbers, lanes: Lanes) -> None:
    state, counts = lanes.state, lanes.counts
    left_behind = np.uint64(numbers.dead - numbers.on) * LANE
    lanes.echoes[:] = 0.0
    for lane in range(LANE):
        state[ARMED + lane] = numbers.detectors - lanes.dead[lane]
        state[ON + lane] = 0.0
        state[ABOVE + lane] = 0.0
        lanes.echoes[_LENGTH + lane] = lanes.length[lane]
    for k in range(left_behind, np.uint64(numbers.dead) * LANE, LANE):
        for lane in range(LANE):
            state[ON + lane] += counts[k + lane]


@inlined
def _add_bin(lanes: Lanes, bin_: float, threshold: Any, echoes: EchoArrays) -> None:
    """Add what a bin has above the threshold to the sums of each lane, within its own window."""
    state, sums = lanes.state, lanes.echoes
    again = np.uint64(0)
    for lane in range(LANE):
        begins = (state[ON + lane] > threshold) & (state[ABOVE + lane] <= _F0) & (sums[_WIDTH + lane] > 0.0)
        again |= np.uint64(1) << np.uint64(lane) if begins else np.uint64(0)
    while again != np.uint64(0):
        _keep_pending(sums, lanes.beam, lowest(again), echoes)
        again &= again - np.uint64(1)
    for lane in range(LANE):
        on = state[ON + lane]
        inside = (on > threshold) & (bin_ < sums[_LENGTH + lane])
        state[ABOVE + lane] = on if inside else _F0
        above = np.float64(on) if inside else 0.0
        sums[_WIDTH + lane] += 1.0 if inside else 0.0
        sums[_AREA + lane] += above
        sums[_MOMENT + lane] += above * bin_
        sums[_PEAK + lane] = above if above > sums[_PEAK + lane] else sums[_PEAK + lane]


@kernel
def _keep_pending(sums: FloatArray, beams: IndexArray, lane: Any, echoes: EchoArrays) -> None:
    """Write down the echo that a lane has ended, if there is one."""
    if sums[_WIDTH + lane] > 0.0:
        beam: Any = np.uint64(beams[lane])
        width, area, peak = int(sums[_WIDTH + lane]), int(sums[_AREA + lane]), int(sums[_PEAK + lane])
        keep(echoes, beam, 0.5 + sums[_MOMENT + lane] / sums[_AREA + lane], width, area, peak)
        for row in (_WIDTH, _AREA, _MOMENT, _PEAK):
            sums[row + lane] = 0.0
