"""Long beams, 64 at a time: their rates, avalanches and echoes, and what lies behind their windows."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact import background as bg
from lidarcheck.model.exact.abreast import RESERVE
from lidarcheck.model.exact.binomial import binomial
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.haze_rates import uncut_until, weight_of
from lidarcheck.model.exact.long_abreast import run_lanes
from lidarcheck.model.exact.long_alone import first_free_block
from lidarcheck.model.exact.long_space import LANE, Lanes
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, add_rates, pulse_window
from lidarcheck.model.exact.short_draws import FIRST_BLOCK, WIDE, fill_words
from lidarcheck.model.exact.single import BackgroundLevel, Scratch, look_outside, place_dead
from lidarcheck.model.streams import Stream, rewind, unit

__all__ = ["simulate_queue"]


@kernel
def simulate_queue(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    level: BackgroundLevel,
    pulses: Pulses,
    queued: Any,
    scratch: Scratch,
    lanes: Lanes,
    echoes: EchoArrays,
) -> None:
    """Simulate the queue's first beams, which have one background, those side by side whose windows end together."""
    _sort(lanes, queued)
    for start in range(0, queued, WIDE):
        held = min(queued - start, WIDE)
        most: Any = np.int64(0)
        for lane in range(WIDE):
            lanes.length[lane], lanes.dead[lane], lanes.key[lane] = 0, 0, np.uint64(0)
            if lane < held:
                place = lanes.order[start + lane]
                lanes.beam[lane], lanes.length[lane] = lanes.queue[place], lanes.ends[place]
                lanes.key[lane] = beams[np.uint64(lanes.queue[place])]
            most = max(most, lanes.length[lane])
        _fill_rates(numbers, level, pulses, held, most, scratch, lanes)
        _enter(numbers, stream, level, held, scratch, lanes)
        run_lanes(numbers, stream, lanes, held, most, scratch.inverse, echoes)
        for lane in range(held):
            _finish(numbers, stream, level, pulses, lane, scratch, lanes, echoes)
        lanes.counts[: numbers.dead * WIDE] = 0.0


@inlined
def _sort(lanes: Lanes, queued: Any) -> None:
    """Put the queue's places in order of their ends, by counting them."""
    heads, ends = lanes.heads, lanes.ends
    heads[:] = 0
    for place in range(queued):
        heads[ends[place] + 1] += 1
    for end in range(1, len(heads)):
        heads[end] += heads[end - 1]
    for place in range(queued):
        lanes.order[heads[ends[place]]] = place
        heads[ends[place]] += 1


@inlined
def _fill_rates(
    numbers: Numbers, level: BackgroundLevel, pulses: Pulses, held: Any, most: Any, scratch: Scratch, lanes: Lanes
) -> None:
    """Avalanches per armed SPAD in each bin of each lane: the uncut haze for all at once, then what else each has."""
    own, haze = scratch.rates, pulses.haze
    rates, weights = lanes.rates, lanes.sums
    for lane in range(WIDE):
        weights[lane] = weight_of(haze, np.uint64(lanes.beam[lane])) if lane < held and haze.last > 0 else 0.0
    for k in range(np.uint64(most)):
        whole = haze.whole[k] if haze.begin <= np.int64(k) < haze.last else 0.0
        row = k * LANE
        for lane in range(LANE):
            rates[row + lane] = level.per_bin + weights[lane] * whole
    for lane in range(WIDE):
        end = lanes.length[lane]
        if lane < held:
            i: Any = np.uint64(lanes.beam[lane])
            low, high = pulse_window(numbers, pulses, i)
            first = min(uncut_until(haze, i, end) if haze.last > 0 else end, low if high > 0 else end)
            own[: end - first] = level.per_bin
            add_rates(pulses, i, first, end, own)
            at = np.uint64(first * WIDE + lane)
            for k in range(np.uint64(end - first)):
                rates[at + k * LANE] = own[k]
        for k in range(end, most):
            rates[np.uint64(k * WIDE + lane)] = 0.0


@inlined
def _enter(numbers: Numbers, stream: Stream, level: BackgroundLevel, held: Any, scratch: Scratch, lanes: Lanes) -> None:
    """Put the avalanches before bin 0 as background alone leaves them."""
    draws, counts = scratch.draws, scratch.counts
    for block in range(np.uint64(FIRST_BLOCK)):
        fill_words(stream, lanes.key, block, lanes.words)
        row = block * np.uint64(4 * WIDE)
        for k in range(np.uint64(4 * WIDE)):
            lanes.reserve[row + k] = unit(lanes.words[k])
    for lane in range(held):
        dead = binomial(lanes.reserve[lane], numbers.detectors, level.dead_rate, scratch.inverse)
        lanes.dead[lane] = dead
        lanes.block[lane] = first_free_block(numbers)
        if dead > RESERVE - 3:
            rewind(stream, lanes.key[lane])
            stream.counter[0] = lanes.block[lane]
            for k in range(1, RESERVE - 2):
                draws[k] = lanes.reserve[k * WIDE + lane]
            place_dead(numbers, stream, scratch, dead, 0)
            lanes.block[lane] = stream.counter[0]
            for age in range(1, numbers.dead):
                lanes.counts[(numbers.dead - age) * WIDE + lane] = counts[numbers.pad - age]
                counts[numbers.pad - age] = 0
        else:
            for k in range(1, dead + 1):
                age = 1 + int(lanes.reserve[k * WIDE + lane] * (numbers.dead - 1))
                lanes.counts[(numbers.dead - age) * WIDE + lane] += np.float32(1.0)


@inlined
def _finish(
    numbers: Numbers,
    stream: Stream,
    level: BackgroundLevel,
    pulses: Pulses,
    lane: Any,
    scratch: Scratch,
    lanes: Lanes,
    echoes: EchoArrays,
) -> None:
    """Look for a lane's echoes that reach beyond its window."""
    blocks = scratch.blocks
    begin: Any = np.int64(0)
    end, dead = lanes.length[lane], lanes.dead[lane]
    on: Any = np.int64(0)
    for age in range(numbers.on if end > 0 else numbers.on - 1):
        on += np.int64(lanes.counts[(numbers.dead + end - 1 - age) * WIDE + lane])
    before, behind = lanes.reserve[(RESERVE - 2) * WIDE + lane], lanes.reserve[(RESERVE - 1) * WIDE + lane]
    if bg.is_plainly_quiet(numbers, blocks, before, behind, begin, end, dead, on):
        return
    rewind(stream, lanes.key[lane])
    stream.counter[0] = lanes.block[lane]
    if bg.looks_quiet(numbers, blocks, stream, scratch.draws, before, behind, begin, end, dead, on):
        return
    stream.counter[0] = lanes.block[lane]
    first = numbers.pad - numbers.dead
    for k in range(numbers.dead + end):
        scratch.counts[first + k] = np.int64(lanes.counts[k * WIDE + lane])
    i: Any = np.uint64(lanes.beam[lane])
    look_outside(numbers, stream, level, pulses, i, begin, end, dead, on, before, behind, scratch, echoes)
