"""A group of beams through the exact chain, side by side: draws and rates, avalanches, echoes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact import background as bg
from lidarcheck.model.exact.abreast import Abreast, draw_entry, find_abreast, last_on, put_rates, run_abreast
from lidarcheck.model.exact.crowd import find_locally
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.exact.single import RESERVE, BackgroundLevel, Scratch, look_around, place_dead
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.streams import Stream, fill_twice_abreast, rewind

__all__ = ["simulate_group"]


@kernel
def simulate_group(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    level: BackgroundLevel,
    pulses: Pulses,
    held: int,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams of the group's first `held` lanes, which have one background and no haze.

    Each beam's draws are those that `simulate_alone` gives it, and so are its echoes.
    """
    group = scratch.group
    bins: Any = np.int64(0)
    for lane in range(held):
        group.key[lane] = beams[np.uint64(group.beam[lane])]
        bins = max(bins, group.length[lane])
    fill_twice_abreast(stream, group.key, (RESERVE + bins + 7) // 8, group.words, group.draws)
    draw_entry(numbers, group, level.dead_rate, held, scratch.inverse)
    put_rates(pulses, group, level.per_bin, bins, held)
    for lane in range(held):
        _enter(numbers, stream, lane, scratch)
    run_abreast(numbers, group, bins, scratch.inverse)
    find_abreast(numbers, group, bins, held, echoes)
    for lane in range(held):
        _finish(numbers, stream, level, pulses, lane, scratch, echoes)
    group.counts[: numbers.dead * LANES] = 0


@inlined
def _enter(numbers: Numbers, stream: Stream, lane: int, scratch: Scratch) -> None:
    """Put the avalanches before the window where they belong; `block` is the first that the beam has not used yet."""
    group = scratch.group
    dead = group.dead[lane]
    group.block[lane] = np.uint64((RESERVE + group.length[lane] + 7) // 8)
    if dead <= RESERVE - 3:
        for k in range(1, dead + 1):
            age = 1 + int(group.draws[k * LANES + lane] * (numbers.dead - 1))
            group.counts[(numbers.dead - age) * LANES + lane] += 1
    else:
        _enter_many(numbers, stream, lane, scratch)


@kernel
def _enter_many(numbers: Numbers, stream: Stream, lane: int, scratch: Scratch) -> None:
    """The same for more detectors that are dead than draws are set aside for."""
    group, counts = scratch.group, scratch.counts
    _rewind_lane(group, stream, lane)
    for k in range(1, RESERVE - 2):
        scratch.draws[k] = group.draws[k * LANES + lane]
    place_dead(numbers, stream, scratch, group.dead[lane], 0)
    for age in range(1, numbers.dead):
        group.counts[(numbers.dead - age) * LANES + lane] = counts[numbers.pad - age]
        counts[numbers.pad - age] = 0
    group.block[lane] = stream.counter[0]


@inlined
def _finish(
    numbers: Numbers,
    stream: Stream,
    level: BackgroundLevel,
    pulses: Pulses,
    lane: int,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Look for a lane's echoes that reach beyond its window."""
    group = scratch.group
    begin, dead, on = group.begin[lane], group.dead[lane], last_on(numbers, group, lane)
    end = begin + group.length[lane]
    before, behind = group.draws[(RESERVE - 2) * LANES + lane], group.draws[(RESERVE - 1) * LANES + lane]
    quiet = bg.is_plainly_quiet(numbers, scratch.blocks, before, behind, begin, end, dead, on)
    if not quiet:
        _rewind_lane(group, stream, lane)
        quiet = bg.looks_quiet(numbers, scratch.blocks, stream, scratch.draws, before, behind, begin, end, dead, on)
    if not quiet:
        _look_closer(numbers, stream, level, pulses, lane, on, scratch, echoes)


@inlined
def _rewind_lane(group: Abreast, stream: Stream, lane: int) -> None:
    """Go to the first draw of a lane's beam that the group has not used."""
    rewind(stream, group.key[lane])
    stream.counter[0] = group.block[lane]


@kernel
def _look_closer(
    numbers: Numbers,
    stream: Stream,
    level: BackgroundLevel,
    pulses: Pulses,
    lane: int,
    on: int,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Find the echoes of a lane that may have some beyond its window; `on`: detectors ON at its end."""
    group = scratch.group
    i: Any = np.uint64(group.beam[lane])
    begin, end = group.begin[lane], group.begin[lane] + group.length[lane]
    before, behind = group.draws[(RESERVE - 2) * LANES + lane], group.draws[(RESERVE - 1) * LANES + lane]
    _rewind_lane(group, stream, lane)
    dead, draws = group.dead[lane], scratch.draws
    if level.faint == 0.0:
        _copy(numbers, lane, scratch)
        find_locally(
            numbers,
            scratch.blocks,
            stream,
            draws,
            before,
            behind,
            begin,
            end,
            dead,
            on,
            scratch.rates,
            scratch.counts,
            i,
            echoes,
        )
    else:
        bg.write_down(numbers, scratch.blocks, stream, draws, before, behind, begin, end, dead, on)
        _copy(numbers, lane, scratch)
        look_around(numbers, stream, level, pulses, i, begin, end, scratch, echoes)


@kernel
def _copy(numbers: Numbers, lane: int, scratch: Scratch) -> None:
    """Put a lane's avalanches where those of a beam on its own stand."""
    group = scratch.group
    first = numbers.pad + group.begin[lane] - numbers.dead
    for k in range(numbers.dead + group.length[lane]):
        scratch.counts[first + k] = int(group.counts[k * LANES + lane])
