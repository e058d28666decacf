"""Echoes beyond the window of a beam whose detectors have afterpulses; see `exact/background.py`.

Detectors of the pool are candidates of background alone, those that have no afterpulse. The avalanches of followed
detectors stand beside them, known already: no bin can see more detectors ON than two neighbouring blocks have
candidates and such avalanches.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.afterpulses.law import BEGIN, END, POINTS, After, Level
from lidarcheck.model.exact import background as bg
from lidarcheck.model.exact.blocks import Blocks, count_large, count_small
from lidarcheck.model.exact.echoes import EchoArrays, find_echoes
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_math import LANES, log
from lidarcheck.model.streams import Stream, fill_four

__all__ = ["is_quiet", "look_around"]


@inlined
def _block_of(numbers: Numbers, length: int, begin: int, end: int, bin_: Any, back: int) -> Any:
    """The block that a bin outside the window lies in; -1 just before the window, and before all that matters."""
    if bin_ >= end:
        return back + (bin_ - end) // length
    block = (begin - numbers.dead - bin_) // length if bin_ <= begin - numbers.dead else -1
    return block if block < back else -1


@inlined
def _known(stream: Stream, blocks: Blocks, draws: FloatArray, block: Any) -> int:
    """The candidates of a block, which is looked up where it is only known to be small."""
    if blocks.held[block] < 0:
        fill_four(stream, draws)
        blocks.held[block] = count_small(blocks, draws[0])
    return int(blocks.held[block])


@inlined
def _most(blocks: Blocks, block: Any) -> int:
    """The most candidates that a block may have, by what is known of it."""
    held = int(blocks.held[block])
    return held if held >= 0 else blocks.small


@inlined
def _forget(blocks: Blocks, special: IndexArray, found: int, back: int, last: int) -> None:
    """Take all blocks for small again: some of the `found` in `special`, or of their neighbours, were looked up."""
    for n in range(found):
        for block in range(max(special[n] - 1, 0), min(special[n] + 2, last)):
            blocks.held[block] = bg.SMALL
    if last > 0:
        blocks.held[0] = blocks.held[min(back, last - 1)] = bg.SMALL


@inlined
def is_quiet(
    numbers: Numbers, stream: Stream, after: After, lane: int, before: float, behind: float, dead: int, on: int
) -> bool:
    """Whether no echo reaches beyond the window; if not, `blocks.held` tells what is known of each block: it is full of
    `SMALL` before, and left so otherwise.

    `dead` detectors avalanched in the `dead - 1` bins before the window, `on` are ON in its last bin. The stream stands
    where the lane's beam goes on.
    """
    blocks, others, trails = after.chain.blocks, after.held, after.trails
    begin, end, points = trails.state[BEGIN + lane], trails.state[END + lane], trails.state[POINTS + lane]
    start, threshold, draws, special = lane * trails.room, numbers.threshold, after.chain.draws, after.special
    back, last = bg.blocks_around(numbers, blocks, begin, end)
    own = 0
    for n in range(points):
        block = _block_of(numbers, blocks.length, begin, end, np.int64(trails.outside[start + n]), back)
        if block >= 0:
            if others[block] == 0:
                special[own] = block
                own += 1
            others[block] += 1
    log_small, found = blocks.log_small[0], own
    if not bg.are_small(before, back * log_small):
        found = _look_up(stream, blocks, draws, special, before, np.int64(0), back, found)
    if not bg.are_small(behind, (last - back) * log_small):
        found = _look_up(stream, blocks, draws, special, behind, back, last, found)
    of_begin, of_end = dead if begin > 0 else 0, on if end < numbers.bins else 0
    quiet = of_begin <= threshold
    quiet = quiet and (back == 0 or of_begin + others[0] + _most(blocks, np.int64(0)) <= threshold)
    quiet = quiet and (back == last or of_end + others[back] + _most(blocks, back) <= threshold)
    for n in range(found):
        block = special[n]
        most = others[block] + _most(blocks, block)
        if block > 0 and block != back:
            quiet = quiet and most + others[block - 1] + _most(blocks, block - 1) <= threshold
        if block + 1 < last and block + 1 != back:
            quiet = quiet and most + others[block + 1] + _most(blocks, block + 1) <= threshold
    if not quiet:
        quiet = not _is_crowded(numbers, stream, blocks, draws, others, special, found, back, last, of_begin, of_end)
    if quiet:
        _forget(blocks, special, found, back, last)
    for n in range(own):
        others[special[n]] = 0
    return bool(quiet)


@kernel
def _look_up(
    stream: Stream,
    blocks: Blocks,
    draws: FloatArray,
    special: IndexArray,
    draw: float,
    first: Any,
    last: int,
    found: int,
) -> int:
    """Find the large ones among the blocks `first` ... `last - 1`, a geometric number of small ones apart; adds them to
    the `found` in `special`."""
    log_small = blocks.log_small[0]
    at = first
    while not bg.are_small(draw, (last - at) * log_small):
        at += int(min(log(1.0 - draw) / log_small, float(last - at)))
        if at == last:
            break
        fill_four(stream, draws)
        blocks.held[at] = count_large(blocks, draws[1])
        special[found] = at
        found += 1
        draw = draws[2]
        at += 1
    return found


@kernel
def _is_crowded(
    numbers: Numbers,
    stream: Stream,
    blocks: Blocks,
    draws: FloatArray,
    others: IndexArray,
    special: IndexArray,
    found: int,
    back: int,
    last: int,
    of_begin: int,
    of_end: int,
) -> bool:
    """Whether two neighbours are crowded, of which one is among the first `found` of `special`: none else can be.

    `others`: avalanches of followed detectors in each block; `of_begin`, `of_end`: avalanches just before the
    window and in its last bins. What small blocks hold is looked up where it can matter.
    """
    crowded = of_begin > numbers.threshold
    for side in range(2):
        block, beside = (back, of_end) if side else (np.int64(0), of_begin)
        if block < (last if side else back):
            least = beside + others[block]
            if least + _most(blocks, block) > numbers.threshold:
                crowded = crowded or least + _known(stream, blocks, draws, block) > numbers.threshold
    for n in range(2 * found):
        left = special[n >> 1] - (n & 1)
        if left >= 0 and left + 1 < last and left + 1 != back:
            least = others[left] + others[left + 1]
            one, other = blocks.held[left], blocks.held[left + 1]
            if (
                least + (one if one >= 0 else blocks.small) + (other if other >= 0 else blocks.small)
                > numbers.threshold
            ):
                least += _known(stream, blocks, draws, left) + _known(stream, blocks, draws, left + 1)
                crowded = crowded or least > numbers.threshold
    return crowded


@kernel
def look_around(
    numbers: Numbers, level: Level, stream: Stream, after: After, lane: int, i: Any, echoes: EchoArrays
) -> None:
    """Find the echoes of beam `i` all over its trace, where `is_quiet` was false."""
    group, counts, rates, blocks = after.chain.group, after.chain.counts, after.chain.rates, after.chain.blocks
    draws, trails, pad, dead = after.chain.draws, after.trails, numbers.pad, numbers.dead
    begin, length = group.begin[lane], group.length[lane]
    end = begin + length
    back, last = bg.blocks_around(numbers, blocks, begin, end)
    bg.complete(blocks, stream, draws, 0, back)
    bg.complete(blocks, stream, draws, back, last)
    points, start = trails.state[POINTS + lane], lane * trails.room
    rates[:] = level.clean
    step = blocks.length
    for age in range(1, dead):
        counts[pad + begin - age] = int(group.counts[(dead - age) * LANES + lane])
    for n in range(points):
        bin_ = trails.outside[start + n]
        if bin_ < begin and bin_ > begin - dead:
            counts[pad + bin_] -= 1
    for j in range(back):
        bg.place(numbers, blocks, stream, draws, blocks.held[j], begin - dead - j * step, -1, counts)
    bg.thin(numbers, blocks, stream, draws, begin - dead, back * step, -1, level.clean, rates, after.pool[lane], counts)
    for k in range(1, dead):
        counts[pad + end - dead + k] = int(trails.back[(length + k) * LANES + lane])
    for j in range(back, last):
        bg.place(numbers, blocks, stream, draws, blocks.held[j], end + (j - back) * step, 1, counts)
    bg.thin(numbers, blocks, stream, draws, end, (last - back) * step, 1, level.clean, rates, after.later[lane], counts)
    for k in range(1, dead + length):
        counts[pad + begin - dead + k] = int(group.counts[k * LANES + lane])
    for n in range(points):
        bin_ = trails.outside[start + n]
        if bin_ <= begin - dead or bin_ >= end:
            counts[pad + bin_] += 1
    find_echoes(numbers, counts, 0, numbers.bins, i, echoes)
    counts[:] = 0
    blocks.held[:] = bg.SMALL
