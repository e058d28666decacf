"""Crowded background looked up where it is crowded, not all over the trace.

Whether a candidate counts depends on what its detector did within a dead time before it, and a stretch of a dead time
without any candidate leaves all detectors armed, whatever came before. So the candidates of a crowded pair of blocks
are thinned from the nearest such stretch on; where there is none, from the window on. "Before" is meant in the order in
which candidates are thinned: away from the window, on either side of it (`background.py`).
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

__all__ = ["find_locally", "is_local"]

_RARE = 1.5e-3
"""Share of blocks that are not small up to which whole traces are looked at: so few beams have crowded ones."""
_PLACED, _THINNED = -3, -4
"""Blocks whose candidates stand in the trace, and those of which the ones that count are left."""


@inlined
def is_local(blocks: Blocks, faint: float) -> bool:
    """Whether crowded blocks are looked up where they are: under the sun, without haze."""
    return blocks.log_small[0] < -_RARE and faint == 0.0


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
    bg.search(blocks, stream, draws, draw_before, np.int64(0), back, before, numbers.threshold, True)
    bg.search(blocks, stream, draws, draw_behind, back, last, behind, numbers.threshold, True)
    rates[:] = blocks.rate[0]
    _settle(
        numbers, blocks, stream, draws, np.int64(0), back, before, begin - numbers.dead, np.int64(-1), rates, counts
    )
    _settle(numbers, blocks, stream, draws, back, last, behind, end, np.int64(1), rates, counts)
    echoes.held[i] = 0
    step, gap = blocks.length, begin - numbers.dead
    low: Any = np.int64(0)
    open_ = False
    for j in range(back - 1, -1, -1):
        if blocks.held[j] == _THINNED and not open_:
            low, open_ = max(gap - (j + 1) * step + 1, 0), True
        elif blocks.held[j] != _THINNED and open_:
            add_echoes(numbers, counts, low, max(gap - (j + 1) * step + 1, low), i, echoes)
            open_ = False
    # Bins just before the window may be crowded by themselves, where there is no block before them.
    low = low if open_ else max(min(gap + 1, begin), 0)
    high: Any = end
    for j in range(back, last):
        if blocks.held[j] == _THINNED:
            low = low if open_ or j == back else end + (j - back) * step
            open_, high = True, min(end + (j - back + 1) * step, numbers.bins)
        elif open_ or j == back:
            add_echoes(numbers, counts, low, high, i, echoes)
            open_ = False
    if open_ or last == back:
        add_echoes(numbers, counts, low, high, i, echoes)
    counts[:] = 0


@kernel
def _settle(
    numbers: Numbers,
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    first: Any,
    last: int,
    beside: int,
    origin: int,
    step: Any,
    rates: FloatArray,
    counts: IndexArray,
) -> None:
    """Leave, in crowded pairs of the blocks `first` ... `last - 1`, the avalanches that candidates set off.

    `beside` avalanches stand before them; block `first` begins at bin `origin` and goes on in the direction of `step`.
    """
    held, length = blocks.held, blocks.length
    reach = (numbers.dead - 2) // length + 1
    done, before = first, beside
    for j in range(first, last):
        now = held[j]
        if now >= 0 and before >= 0 and before + now > numbers.threshold:
            start = max(j - 1, done)
            for block in range(start, j + 1):
                _put(numbers, blocks, stream, draws, block, origin + step * (block - first) * length, step, counts)
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
            bg.thin(numbers, blocks, stream, draws, at, bins, step, blocks.rate[0], rates, numbers.detectors, counts)
            held[start : j + 1] = _THINNED
            done = j + 1
        before = now


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
