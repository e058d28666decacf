"""The exact chain of a beam on its own: from its light to its echoes, bin by bin, for all its detectors at once.

The N detectors of a beam are exchangeable, so the avalanche counts of the last `dead_bins` bins are all that the future
depends on: K_k ~ Binomial(armed_k, 1 - exp(-rate_k)). The chain runs explicitly where signal is expected; what lies
before and after is background alone, whose rare echoes `background.py` finds without visiting every bin.

Arrays of a beam's trace start `pad` bins before bin 0: bin k stands at index pad + k.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.exact import background as bg
from lidarcheck.model.exact.abreast import RESERVE, Abreast, new_abreast
from lidarcheck.model.exact.binomial import binomial, inverses
from lidarcheck.model.exact.blocks import Blocks, new_blocks, tabulate
from lidarcheck.model.exact.crowd import find_locally
from lidarcheck.model.exact.echoes import EchoArrays, find_echoes
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, add_pulses, pulse_window
from lidarcheck.model.lane_math import fired, log1p
from lidarcheck.model.streams import Stream, fill, fill_twice, rewind

__all__ = [
    "RESERVE",
    "BackgroundLevel",
    "Scratch",
    "chain",
    "enter",
    "level_of",
    "look_around",
    "look_outside",
    "new_scratch",
    "place_dead",
    "simulate_alone",
]

_FIRST_DRAW = np.uint64(RESERVE)


class BackgroundLevel(NamedTuple):
    """A background: avalanches per armed SPAD and bin; see `enter`; and the faint haze that may lie over it."""

    per_bin: float
    dead_rate: float
    faint: float


class Scratch(NamedTuple):
    """What a thread works in: avalanches per bin, all zero; rates per bin; draws; 1 / k; background blocks; beams that
    are simulated side by side."""

    counts: IndexArray
    rates: FloatArray
    draws: FloatArray
    inverse: FloatArray
    blocks: Blocks
    group: Abreast


def new_scratch(numbers: Numbers) -> Scratch:
    """Work space for one thread."""
    return Scratch(
        counts=np.zeros(2 * numbers.pad + numbers.bins, dtype=np.int64),
        rates=np.empty(numbers.bins),
        draws=np.empty(RESERVE + numbers.bins + 8),
        inverse=inverses(numbers.detectors),
        blocks=new_blocks(numbers),
        group=new_abreast(numbers),
    )


@inlined
def level_of(numbers: Numbers, blocks: Blocks, pulses: Pulses, per_bin: float) -> BackgroundLevel:
    """A background's level, for which it fills the blocks' table."""
    dead_rate = log1p((numbers.dead - 1) * fired(per_bin))
    faint = max(blocks.calm - per_bin, 0.0) if pulses.haze.last > 0 else 0.0
    tabulate(blocks, numbers.detectors, numbers.threshold, per_bin + faint)
    return BackgroundLevel(per_bin, dead_rate, faint)


@inlined
def enter(numbers: Numbers, stream: Stream, scratch: Scratch, dead_rate: float, begin: int) -> int:
    """Put the avalanches of the `dead - 1` bins before `begin` into `counts` as background alone leaves them.

    In the steady state a detector is dead with probability (dead - 1) p / (1 + (dead - 1) p), its last avalanche
    equally likely in each of those bins: with probability 1 - exp(-dead_rate). Returns how many are dead.
    """
    dead = binomial(scratch.draws[0], numbers.detectors, dead_rate, scratch.inverse)
    place_dead(numbers, stream, scratch, dead, begin)
    return dead


@inlined
def place_dead(numbers: Numbers, stream: Stream, scratch: Scratch, dead: int, begin: Any) -> None:
    """Spread the last avalanches of `dead` detectors over the `dead - 1` bins before `begin`; draws from 1 on."""
    draws = scratch.draws
    at, limit = 1, RESERVE - 2
    for _ in range(dead):
        if at == limit:
            fill(stream, draws, 8)
            at, limit = 0, 8
        age = 1 + int(draws[at] * (numbers.dead - 1))
        scratch.counts[numbers.pad + begin - age] += 1
        at += 1


@kernel
def chain(numbers: Numbers, scratch: Scratch, begin: int, end: int, dead: int) -> None:
    """Run the avalanche counts from `begin` to `end - 1`, given `dead` detectors that are dead on entry."""
    counts, draws, rates = scratch.counts, scratch.draws, scratch.rates
    armed = numbers.detectors - dead
    first = np.uint64(numbers.pad + begin)
    rearmed = np.uint64(numbers.pad + begin - numbers.dead)
    for k in range(np.uint64(end - begin)):
        armed += counts[rearmed + k]
        fired = binomial(draws[_FIRST_DRAW + k], armed, rates[k], scratch.inverse)
        counts[first + k] = fired
        armed -= fired


@kernel
def simulate_alone(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    level: BackgroundLevel,
    pulses: Pulses,
    i: Any,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Simulate beam `i`, which is not long; `level`: its background, for which the blocks' table is filled."""
    counts, rates, draws, blocks = scratch.counts, scratch.rates, scratch.draws, scratch.blocks
    rewind(stream, beams[i])
    begin, end = pulse_window(numbers, pulses, i)
    fill_twice(stream, draws, RESERVE + end - begin)
    before, behind = draws[RESERVE - 2], draws[RESERVE - 1]
    dead = enter(numbers, stream, scratch, level.dead_rate, begin)
    rates[: end - begin] = level.per_bin
    add_pulses(pulses, i, begin, end, rates)
    chain(numbers, scratch, begin, end, dead)
    on = find_echoes(numbers, counts, begin, end, i, echoes)
    block = stream.counter[0]
    if bg.looks_quiet(numbers, blocks, stream, draws, before, behind, begin, end, dead, on):
        counts[numbers.pad + begin - numbers.dead : numbers.pad + end] = 0
    else:
        stream.counter[0] = block
        look_outside(numbers, stream, level, pulses, i, begin, end, dead, on, before, behind, scratch, echoes)


@kernel
def look_outside(
    numbers: Numbers,
    stream: Stream,
    level: BackgroundLevel,
    pulses: Pulses,
    i: Any,
    begin: Any,
    end: Any,
    dead: int,
    on: int,
    before: float,
    behind: float,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Find the echoes of beam `i`, whose surroundings do not look quiet; clear `counts`.

    The stream stands where it stood before `looks_quiet`, whose arguments these are.
    """
    blocks, draws = scratch.blocks, scratch.draws
    if level.faint == 0.0:
        find_locally(
            numbers,
            blocks,
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
        bg.write_down(numbers, blocks, stream, draws, before, behind, begin, end, dead, on)
        look_around(numbers, stream, level, pulses, i, begin, end, scratch, echoes)


@kernel
def look_around(
    numbers: Numbers,
    stream: Stream,
    level: BackgroundLevel,
    pulses: Pulses,
    i: Any,
    begin: int,
    end: int,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Find the echoes of beam `i` all over its trace, since some may reach beyond its window; clear `counts`."""
    counts = scratch.counts
    bg.add_outside(
        numbers,
        scratch.blocks,
        stream,
        scratch.draws,
        begin,
        end,
        level.per_bin,
        pulses,
        i,
        scratch.rates,
        counts,
    )
    find_echoes(numbers, counts, 0, numbers.bins, i, echoes)
    counts[:] = 0
