"""Long beams, which visit many bins, one at a time: beams in haze, and all where background crowds its blocks.

Beams run side by side (`long_group.py`) have the same draws and the same echoes. Their windows begin in bin 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact import background as bg
from lidarcheck.model.exact.blocks import Blocks
from lidarcheck.model.exact.echoes import EchoArrays, find_echoes
from lidarcheck.model.exact.haze_rates import haze_end
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, add_rates, pulse_window
from lidarcheck.model.exact.short_draws import BINS, FIRST_BLOCK, count_of, fill_short
from lidarcheck.model.exact.single import (
    RESERVE,
    BackgroundLevel,
    Scratch,
    enter,
    level_of,
    look_outside,
    simulate_alone,
)
from lidarcheck.model.streams import Stream, fill, rewind

__all__ = ["crowded", "first_free_block", "hazy", "is_long", "long_end", "simulate_each", "simulate_one"]

_MOST_PAIRS = 2.5
"""Expected crowded neighbours of a beam above which to visit all bins is the faster way."""
_OFTEN = 0.022
"""Share of blocks that are not small from which on to visit all bins is the faster way."""


@inlined
def first_free_block(numbers: Numbers) -> Any:
    """The first block of draws behind those of all bins."""
    return np.uint64(FIRST_BLOCK + (numbers.bins + BINS - 1) // BINS)


@inlined
def crowded(blocks: Blocks) -> Any:
    """Whether background crowds so many blocks that every beam visits all bins sooner than it looks them up."""
    return blocks.pairs[0] > _MOST_PAIRS


@inlined
def visits_all(blocks: Blocks) -> Any:
    """Whether background crowds so many blocks that a beam in haze visits all bins sooner than it looks them up."""
    return crowded(blocks) or blocks.log_small[0] < -_OFTEN


@inlined
def is_long(blocks: Blocks, pulses: Pulses, i: Any) -> Any:
    """Whether beam `i` visits many bins."""
    return crowded(blocks) or (pulses.haze.last > 0 and pulses.haze.first[i] < pulses.haze.first[i + np.uint64(1)])


@inlined
def long_end(numbers: Numbers, blocks: Blocks, level: BackgroundLevel, pulses: Pulses, i: Any) -> Any:
    """The bin that the window of such a beam ends before; it begins in bin 0."""
    _, end = pulse_window(numbers, pulses, i)
    return numbers.bins if visits_all(blocks) else max(end, haze_end(numbers, pulses.haze, i, level.faint))


@kernel
def hazy(
    numbers: Numbers, stream: Stream, scratch: Scratch, pulses: Pulses, beam: Any, per_bin: float, begin: int, end: int
) -> None:
    """Run the avalanche counts from `begin` to `end - 1`, given those before."""
    rates, counts = scratch.rates, scratch.counts
    draws: Any = scratch.draws
    rates[: end - begin] = per_bin
    add_rates(pulses, beam, begin, end, rates)
    armed = numbers.detectors
    for age in range(1, numbers.dead + 1):
        armed -= counts[numbers.pad + begin - age]
    for k in range(begin, end):
        if k == begin or k % BINS == 0:
            fill_short(stream, np.uint64(FIRST_BLOCK + k // BINS), draws)
        armed += counts[numbers.pad + k - numbers.dead]
        rate, short = np.float64(np.float32(rates[k - begin])), draws[k % BINS]
        fired = count_of(stream, stream.counter[1], k, short, armed, rate, numbers.detectors, scratch.inverse)
        counts[numbers.pad + k] = fired
        armed -= fired


@kernel
def _simulate_long(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    level: BackgroundLevel,
    pulses: Pulses,
    i: Any,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Simulate beam `i`, which is long; `level`: its background, for which the blocks' table is filled."""
    counts, draws, blocks = scratch.counts, scratch.draws, scratch.blocks
    begin: Any = np.int64(0)
    end = long_end(numbers, blocks, level, pulses, i)
    rewind(stream, beams[i])
    fill(stream, draws, RESERVE)
    before, behind = draws[RESERVE - 2], draws[RESERVE - 1]
    stream.counter[0] = first_free_block(numbers)
    dead = enter(numbers, stream, scratch, level.dead_rate, begin)
    hazy(numbers, stream, scratch, pulses, i, level.per_bin, begin, end)
    on = find_echoes(numbers, counts, begin, end, i, echoes)
    block = stream.counter[0]
    if bg.looks_quiet(numbers, blocks, stream, draws, before, behind, begin, end, dead, on):
        counts[numbers.pad + begin - numbers.dead : numbers.pad + end] = 0
    else:
        stream.counter[0] = block
        look_outside(numbers, stream, level, pulses, i, begin, end, dead, on, before, behind, scratch, echoes)


@kernel
def simulate_one(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    level: BackgroundLevel,
    pulses: Pulses,
    i: Any,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Simulate beam `i`, long or not."""
    if is_long(scratch.blocks, pulses, i):
        _simulate_long(numbers, stream, beams, level, pulses, i, scratch, echoes)
    else:
        simulate_alone(numbers, stream, beams, level, pulses, i, scratch, echoes)


@kernel
def simulate_each(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    order: IndexArray,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams in `order`, each on its own; see `kernel.simulate_beams`."""
    level = BackgroundLevel(-1.0, 0.0, 0.0)
    for k in range(len(order)):
        beam: Any = np.uint64(order[k])
        if per_bin[beam] != level.per_bin:
            level = level_of(numbers, scratch.blocks, pulses, per_bin[beam])
        simulate_one(numbers, stream, beams, level, pulses, beam, scratch, echoes)
