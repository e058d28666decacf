"""The exact chain: from the light of beams to their echoes.

The N detectors of a beam are exchangeable, so the avalanche counts of the last `dead_bins` bins are all that the future
depends on: K_k ~ Binomial(armed_k, 1 - exp(-rate_k)). Beams are run side by side (`group.py`). Long beams, such as hazy
ones, are left to `long_kernel.py`, which is compiled when it is first needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.abreast import MOST_BINS, MOST_DETECTORS
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.group import simulate_group
from lidarcheck.model.exact.long_alone import is_long
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses, add_rates, pulse_window
from lidarcheck.model.exact.single import (
    RESERVE,
    BackgroundLevel,
    Scratch,
    chain,
    enter,
    level_of,
    new_scratch,
)
from lidarcheck.model.lane_math import LANES, fired, log1p
from lidarcheck.model.streams import Stream, fill, rewind

__all__ = ["Scratch", "new_scratch", "simulate_beams", "trace_beams"]


@kernel
def trace_beams(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    scratch: Scratch,
    traces: npt.NDArray[np.int32],
) -> None:
    """Run the chain through all bins of every beam; `traces` (n, bins) takes the detectors ON in each bin."""
    counts, rates, draws = scratch.counts, scratch.rates, scratch.draws
    for i in range(len(beams)):
        rewind(stream, beams[i])
        rates[:] = per_bin[i]
        add_rates(pulses, i, 0, numbers.bins, rates)
        fill(stream, draws, RESERVE + numbers.bins)
        dead_rate = log1p((numbers.dead - 1) * fired(per_bin[i]))
        dead = enter(numbers, stream, scratch, dead_rate, 0)
        chain(numbers, scratch, 0, numbers.bins, dead)
        for k in range(numbers.bins):
            on = 0
            for age in range(numbers.on):
                on += counts[numbers.pad + k - age]
            traces[i, k] = on
        counts[:] = 0


def simulate_beams(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    order: IndexArray,
    scratch: Scratch,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams in `order`, independent of each other, into `echoes`.

    `beams` (n,): numbers that streams know them by; `per_bin` (n,): background avalanches per armed SPAD and bin. Beams
    of one background should stand together in `order`, since each change of it costs a table.
    """
    long = np.empty(len(order), dtype=np.int64)
    found = _simulate_short(numbers, stream, beams, per_bin, pulses, order, scratch, echoes, long)
    rest = long[:found]
    if found and (numbers.detectors > MOST_DETECTORS or numbers.bins > MOST_BINS):
        from lidarcheck.model.exact.long_alone import simulate_each

        simulate_each(numbers, stream, beams, per_bin, pulses, rest, scratch, echoes)
    elif found:
        from lidarcheck.model.exact.long_kernel import new_lanes, simulate_long_beams

        simulate_long_beams(numbers, stream, beams, per_bin, pulses, rest, scratch, new_lanes(numbers), echoes)


@kernel
def _simulate_short(
    numbers: Numbers,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    order: IndexArray,
    scratch: Scratch,
    echoes: EchoArrays,
    long: IndexArray,
) -> int:
    """Simulate the beams that are not long and fit side by side; the others to `long`, and their number."""
    group, n = scratch.group, len(order)
    level = BackgroundLevel(-1.0, 0.0, 0.0)
    most_bins = MOST_BINS if numbers.detectors <= MOST_DETECTORS else -1
    at: Any = np.int64(0)
    held: Any = np.int64(0)
    found = 0
    while True:
        alike = at < n and per_bin[np.uint64(order[at])] == level.per_bin
        if alike and held < LANES:
            # An unsigned index cannot count from the array's end, which saves the tests for it.
            beam: Any = np.uint64(order[at])
            at += 1
            begin, end = pulse_window(numbers, pulses, beam)
            if is_long(scratch.blocks, pulses, beam) or end - begin > most_bins:
                long[found] = beam
                found += 1
            else:
                group.beam[held], group.begin[held], group.length[held] = beam, begin, end - begin
                held += 1
        elif held > 0:
            simulate_group(numbers, stream, beams, level, pulses, held, scratch, echoes)
            held = 0
        elif at < n:
            level = level_of(numbers, scratch.blocks, pulses, per_bin[np.uint64(order[at])])
        else:
            return found
