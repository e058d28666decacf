"""Echoes that background alone makes, found without visiting every bin, and exactly so.

Outside a pulse's window each detector avalanches with probability p per bin while it is armed. That process is a
thinning of candidates: every (bin, detector) cell is a candidate with probability p, independently, and a candidate
counts if the detector is armed. Candidate counts of blocks of `on - 1` bins are thus independent binomials, and no bin
can see more detectors ON than two neighbouring blocks have candidates. As long as no two neighbours hold more than
`threshold`, there is no echo, and one draw settles that for all blocks of a beam together. Only when it does not are
counts drawn per block, and only when two neighbours are crowded are the candidates placed and thinned.

Before the window the same holds backwards in time: a stationary renewal process is reversible, so the avalanches before
the window follow from the state at its start as those behind it from the state at its end.

Faint haze behind the window is part of that: candidates then come at the highest rate that there may be, `Blocks.calm`,
and one in a bin of rate r is kept with the ratio of the chances of r and of that rate. Which candidates there are
still settles almost all beams at once, and no light is cut off.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact.blocks import Blocks, count, count_large, count_small
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, add_rates
from lidarcheck.model.lane_math import fired, log
from lidarcheck.model.streams import Stream, fill, fill_four, skip

__all__ = [
    "SMALL",
    "add_outside",
    "are_small",
    "blocks_around",
    "complete",
    "is_plainly_quiet",
    "looks_quiet",
    "place",
    "search",
    "thin",
    "write_down",
]


_FREE, SMALL = -1, -2
"""A block of which nothing is known yet, and one that is known to hold no more than `small` candidates."""
_ALL_SMALL, _APART, _CROWDED = 0, 1, 2
"""What a search found: nothing to look at, large blocks with small neighbours, or neighbours that are crowded."""


@inlined
def are_small(draw: float, log_chance: float) -> bool:
    """Whether blocks are all small, the logarithm of which chance is given."""
    # exp(x) >= 1 + x: most beams are settled without a logarithm.
    return draw >= -log_chance or log(1.0 - draw) <= log_chance


@inlined
def _search(
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    draw: float,
    first: Any,
    last: int,
    beside: int,
    threshold: int,
    record: bool,
    through: bool,
    listed: int,
) -> Any:
    """Look for crowded neighbours among the blocks `first` ... `last - 1`; `beside` avalanches stand before them.

    One draw leads to the next large block, a geometric number of small ones away; only what stands beside a large
    block is drawn. Returns what was found, and how many crowded neighbours are listed; `record`: unless all are small,
    `held` tells what is known of each block, and `crowds`, behind those that are listed, the second of neighbours that
    are crowded. `through`: go on behind them.
    """
    found, log_small, most_beside = _ALL_SMALL, blocks.log_small[0], threshold - blocks.small
    before, at = beside, first
    if beside > most_beside or not are_small(draw, (last - first) * log_small):
        found = _APART if before <= threshold else _CROWDED
        if record:
            blocks.held[first:last] = _FREE
    while (found == _APART or (through and found == _CROWDED)) and at < last:
        far, small = before <= most_beside, 0
        if far:
            small = last - at
            # exp(x) >= 1 + x: the rest of most beams is settled without a logarithm.
            if draw < -small * log_small:
                small = int(min(log(1.0 - draw) / log_small, float(small)))
            if record:
                blocks.held[at : at + small] = SMALL
            at += small
        if at == last:
            skip(stream, 3)
        else:
            fill_four(stream, draws)
            now = count_large(blocks, draws[1]) if far else count(blocks, 1.0 - draws[0])
            if small > 0:
                # What a small block holds is looked up where it can matter.
                before = count_small(blocks, draws[0]) if record or now > most_beside else blocks.small
                if record:
                    blocks.held[at - 1] = before
            if record:
                blocks.held[at] = now
            if before + now > threshold:
                found = _CROWDED
                if record:
                    blocks.crowds[listed] = at
                    listed += 1
            draw = draws[2] if far else draw
            before = now
            at += 1
    return found, listed


@kernel
def search(
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    draw: float,
    first: Any,
    last: int,
    beside: int,
    threshold: int,
    through: bool,
    listed: int,
) -> int:
    """Tell in `blocks.held` what is known of each of the blocks `first` ... `last - 1`, and in `blocks.crowds`, behind
    those that are `listed`, which are the second of crowded neighbours; how many are listed then.

    `through`: also of those behind neighbours that are crowded.
    """
    found, listed = _search(blocks, stream, draws, draw, first, last, beside, threshold, True, through, listed)
    if found == _ALL_SMALL:
        blocks.held[first:last] = SMALL
    return listed


@kernel
def complete(blocks: Blocks, stream: Stream, draws: FloatArray, first: int, last: int) -> None:
    """Draw what a search left open of the blocks `first` ... `last - 1`."""
    for j in range(first, last):
        if blocks.held[j] < 0:
            fill_four(stream, draws)
            small = blocks.held[j] == SMALL
            blocks.held[j] = count_small(blocks, draws[0]) if small else count(blocks, 1.0 - draws[0])


@kernel
def place(
    numbers: Numbers,
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    held: int,
    bin_of_block: int,
    step: int,
    counts: IndexArray,
) -> None:
    """Spread `held` candidates over the distinct cells of a block; they stand in `counts` until thinned."""
    cells = numbers.detectors * blocks.length
    taken, drawn = 0, 4
    while taken < held:
        if drawn == 4:
            fill_four(stream, draws)
            drawn = 0
        cell = int(draws[drawn] * cells)
        drawn += 1
        fresh = True
        for j in range(taken):
            fresh = fresh and blocks.cells[j] != cell
        if fresh:
            blocks.cells[taken] = cell
            taken += 1
            counts[numbers.pad + bin_of_block + step * (cell // numbers.detectors)] += 1


@kernel
def thin(
    numbers: Numbers,
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    first: int,
    number: int,
    step: int,
    per_bin: float,
    rates: FloatArray,
    pool: int,
    counts: IndexArray,
) -> None:
    """Keep candidates whose detector is armed, from bin `first` on in the direction of `step`.

    `pool`: detectors whose avalanches stand in `counts`; those that candidates strike of the others count elsewhere.

    Where the rate is lower than the candidates', it keeps them with the ratio of the chances. `rates`: of each bin from
    bin 0 on; elsewhere, it is `per_bin`.
    """
    for n in range(number):
        index = numbers.pad + first + step * n
        candidates = counts[index]
        if candidates == 0:
            continue
        armed = pool
        for age in range(1, numbers.dead):
            armed -= counts[index - step * age]
        bin_ = first + step * n
        rate = rates[bin_] if 0 <= bin_ < len(rates) else per_bin
        accepted = 1.0 if rate == blocks.rate[0] else fired(rate) / fired(blocks.rate[0])
        if candidates <= 4:
            fill_four(stream, draws)
        else:
            fill(stream, draws, candidates)
        kept = 0
        for j in range(candidates):
            struck = draws[j] * (numbers.detectors - j)
            if struck < armed:
                armed -= 1
                kept += 1 if struck < accepted * (armed + 1) else 0
        counts[index] = kept


@inlined
def blocks_around(numbers: Numbers, blocks: Blocks, begin: int, end: int) -> Any:
    """Blocks before the window `begin` ... `end - 1`, and all of them with those behind it."""
    bins_before = max(begin - numbers.dead + numbers.on, 0) if begin > 0 else 0
    back = (bins_before + blocks.length - 1) // blocks.length
    return back, back + (numbers.bins - end + blocks.length - 1) // blocks.length


@inlined
def is_plainly_quiet(
    numbers: Numbers,
    blocks: Blocks,
    draw_before: float,
    draw_behind: float,
    begin: int,
    end: int,
    dead_at_begin: int,
    on_at_end: int,
) -> bool:
    """Whether `looks_quiet` is sure to say so: true for most beams, and settled without a division or a logarithm."""
    beside = max(dead_at_begin if begin > 0 else 0, on_at_end if end < numbers.bins else 0)
    # exp(x) >= 1 + x, and a stretch of bins holds less than one block more than it has lengths of a block.
    per_bin = -blocks.log_small[0] / blocks.length
    before, behind = per_bin * (begin + blocks.length), per_bin * (numbers.bins - end + blocks.length)
    return beside <= numbers.threshold - blocks.small and draw_before >= before and draw_behind >= behind


@inlined
def looks_quiet(
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
) -> bool:
    """Whether no echo reaches beyond the window `begin` ... `end - 1`; of blocks, nothing is written down."""
    back, last = blocks_around(numbers, blocks, begin, end)
    most = _ALL_SMALL
    for behind in range(2):
        draw, first, stop = (draw_behind, back, last) if behind else (draw_before, np.int64(0), back)
        beside = on_at_end if behind and end < numbers.bins else dead_at_begin if not behind and begin > 0 else 0
        found, _ = _search(blocks, stream, draws, draw, first, stop, beside, numbers.threshold, False, False, 0)
        most = max(most, found)
    return most != _CROWDED


@kernel
def write_down(
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
) -> None:
    """Write down what lies beyond the window `begin` ... `end - 1`, where `looks_quiet` was false, for `add_outside`.

    The stream stands where it stood before `looks_quiet`, whose arguments these are.
    """
    back, last = blocks_around(numbers, blocks, begin, end)
    beside_begin = dead_at_begin if begin > 0 else 0
    beside_end = on_at_end if end < numbers.bins else 0
    search(blocks, stream, draws, draw_before, np.int64(0), back, beside_begin, numbers.threshold, False, 0)
    search(blocks, stream, draws, draw_behind, back, last, beside_end, numbers.threshold, False, 0)
    complete(blocks, stream, draws, 0, back)
    complete(blocks, stream, draws, back, last)


@kernel
def add_outside(
    numbers: Numbers,
    blocks: Blocks,
    stream: Stream,
    draws: FloatArray,
    begin: int,
    end: int,
    per_bin: float,
    pulses: Pulses,
    beam: int,
    rates: FloatArray,
    counts: IndexArray,
) -> None:
    """Add the avalanches before and behind the window to those in `counts`, as `write_down` left them.

    Before the window there is nothing but a background of `per_bin`, behind it perhaps some faint haze besides.
    """
    back, last = blocks_around(numbers, blocks, begin, end)
    for j in range(back):
        bin_of_block = begin - numbers.dead - j * blocks.length
        place(numbers, blocks, stream, draws, blocks.held[j], bin_of_block, -1, counts)
    for j in range(back, last):
        place(numbers, blocks, stream, draws, blocks.held[j], end + (j - back) * blocks.length, 1, counts)
    rates[:] = per_bin
    add_rates(pulses, beam, end, numbers.bins, rates[end:])
    length = blocks.length
    thin(
        numbers,
        blocks,
        stream,
        draws,
        begin - numbers.dead,
        back * length,
        -1,
        per_bin,
        rates,
        numbers.detectors,
        counts,
    )
    thin(numbers, blocks, stream, draws, end, (last - back) * length, 1, per_bin, rates, numbers.detectors, counts)
