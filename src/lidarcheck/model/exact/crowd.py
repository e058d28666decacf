"""Crowded background looked up where it is crowded, not all over the trace.

Few crowded pairs of blocks have an echo: often its candidates, placed, are spread too widely for any bin to see enough
of them. For the others, whether a candidate counts depends on what its detector did within a dead time before it, and a
stretch of a dead time without any candidate leaves all detectors armed, whatever came before. So the candidates of such
a pair are thinned from the nearest such stretch on; where there is none, from the window on. "Before" is meant in the
order in which candidates are thinned: away from the window, on either side of it (`background.py`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact import background as bg
from lidarcheck.model.exact.blocks import Blocks, count_small
from lidarcheck.model.exact.echoes import EchoArrays, add_echoes
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.streams import Stream, fill_four

__all__ = ["find_locally"]

_PLACED, _THINNED = -3, -4
"""Blocks whose candidates stand in the trace, and those of which the ones that count are left."""


@kernel
def find_locally(
    numbers: Numbers,
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    draw_before: float,
    draw_behind: float,
    begin: int,
    end: int,
    dead_at_begin: int,
    on_at_end: int,
    rates: FloatArray,
    counts: IndexArray,
    i: Any,
    echoes: EchoArrays,
) -> None:
    """Find the echoes of beam `i`, of which some may reach beyond its window; clear `counts`.

    The stream stands where it stood before `looks_quiet`, whose arguments these are.
    """
    back, last = bg.blocks_around(numbers, blocks, begin, end)
    before, behind = dead_at_begin if begin > 0 else 0, on_at_end if end < numbers.bins else 0
    ahead = bg.search(blocks, stream, draws, draw_before, np.int64(0), back, before, numbers.threshold, True, 0)
    listed = bg.search(blocks, stream, draws, draw_behind, back, last, behind, numbers.threshold, True, ahead)
    gap = begin - numbers.dead
    _settle(numbers, blocks, stream, draws, np.int64(0), 0, ahead, gap, np.int64(-1), rates, counts)
    _settle(numbers, blocks, stream, draws, back, ahead, listed, end, np.int64(1), rates, counts)
    echoes.held[i] = 0
    low = _find_before(numbers, blocks, ahead, begin, counts, i, echoes)
    _find_behind(numbers, blocks, ahead, listed, low, end, back, counts, i, echoes)
    counts[numbers.pad + gap : numbers.pad + end] = 0
    for n in range(listed):
        block, least = blocks.crowds[n], 0 if n < ahead else back
        while block >= least and blocks.held[block] <= _PLACED:
            bin_ = gap - (block + 1) * blocks.length + 1 if n < ahead else end + (block - back) * blocks.length
            counts[numbers.pad + bin_ : numbers.pad + bin_ + blocks.length] = 0
            blocks.held[block] = 0
            block -= 1


@inlined
def _find_before(
    numbers: Numbers, blocks: Blocks, ahead: int, begin: Any, counts: IndexArray, i: Any, echoes: EchoArrays
) -> Any:
    """Find the echoes of the first `ahead` listed blocks, those before the window; the first bin of what is thinned up
    to the window."""
    gap, length = begin - numbers.dead, blocks.length
    # Bins just before the window may be crowded by themselves, where there is no block before them.
    low: Any = max(min(gap + 1, begin), 0)
    done: Any = np.int64(len(blocks.held))
    for n in range(ahead - 1, -1, -1):
        block = blocks.crowds[n]
        if block < done and blocks.held[block] == _THINNED:
            first = max(gap - (block + 1) * length + 1, 0)
            while block > 0 and blocks.held[block - 1] == _THINNED:
                block -= 1
            done = block
            if block == 0:
                low = first
            else:
                add_echoes(numbers, counts, first, max(gap - block * length + 1, first), i, echoes)
    return low


@inlined
def _find_behind(
    numbers: Numbers,
    blocks: Blocks,
    ahead: int,
    listed: int,
    low: Any,
    end: Any,
    back: Any,
    counts: IndexArray,
    i: Any,
    echoes: EchoArrays,
) -> None:
    """Find the echoes of the window, which begins with bin `low`, and of the listed blocks from `ahead` on."""
    length = blocks.length
    done, high = back, end
    for n in range(ahead, listed):
        block = blocks.crowds[n]
        if block >= done and blocks.held[block] == _THINNED:
            first = block
            while first > done and blocks.held[first - 1] == _THINNED:
                first -= 1
            if first > done:
                add_echoes(numbers, counts, low, high, i, echoes)
                low = end + (first - back) * length
            done = block + 1
            high = min(end + (done - back) * length, numbers.bins)
    add_echoes(numbers, counts, low, high, i, echoes)


@kernel
def _settle(
    numbers: Numbers,
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    first: Any,
    a: int,
    b: int,
    origin: int,
    step: Any,
    rates: FloatArray,
    counts: IndexArray,
) -> None:
    """Leave, in crowded neighbours that a bin can see enough of, the avalanches that candidates set off.

    `crowds[a]` ... `crowds[b - 1]`: the second of neighbours. Block `first` begins at bin `origin` and goes on in the
    direction of `step`.
    """
    held, length = blocks.held, blocks.length
    reach = (numbers.dead - 2) // length + 1
    done = first
    for n in range(a, b):
        j = blocks.crowds[n]
        start = max(j - 1, done)
        for block in range(start, j + 1):
            _put(numbers, blocks, stream, draws, block, origin + step * (block - first) * length, step, counts)
        at = origin + step * (start - first) * length
        if not _stands_out(numbers, counts, at, step, (j + 1 - start) * length):
            continue
        while start > done:
            for block in range(max(start - reach, done), start):
                _put(numbers, blocks, stream, draws, block, origin + step * (block - first) * length, step, counts)
            if (start - first) * length >= numbers.dead - 1:
                held_by = 0
                for age in range(1, numbers.dead):
                    held_by += counts[numbers.pad + origin + step * ((start - first) * length - age)]
                if held_by == 0:
                    break
            start -= 1
        bins = (j + 1 - start) * length
        at = origin + step * (start - first) * length
        alike = rates[:0]
        bg.thin(numbers, blocks, stream, draws, at, bins, step, blocks.rate[0], alike, numbers.detectors, counts)
        held[start : j + 1] = _THINNED
        done = j + 1


@inlined
def _stands_out(numbers: Numbers, counts: IndexArray, at: Any, step: Any, bins: int) -> bool:
    """Whether a bin can see more detectors ON than the threshold, of `bins` bins from `at` on in the direction of
    `step` and what stands before them."""
    on = 0
    for age in range(1, numbers.on):
        on += counts[numbers.pad + at - step * age]
    most = 0
    for k in range(bins):
        index = numbers.pad + at + step * k
        on += counts[index]
        most = max(most, on)
        on -= counts[index - step * (numbers.on - 1)]
    return most > numbers.threshold


@inlined
def _put(
    numbers: Numbers,
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    block: Any,
    bin_: int,
    step: int,
    counts: IndexArray,
) -> None:
    """Put a block's candidates into the trace, unless they stand there."""
    if blocks.held[block] > _PLACED:
        candidates = blocks.held[block]
        if candidates < 0:
            fill_four(stream, draws)
            candidates = count_small(blocks, draws[0])
        bg.place(numbers, blocks, stream, draws, candidates, bin_, step, counts)
        blocks.held[block] = _PLACED
