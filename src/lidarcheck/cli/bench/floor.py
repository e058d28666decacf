"""What a beam of a SPAD array must cost at least: the bins that light reaches, each a binomial draw, timed alone.

The bins that the exact chain walks are counted beside them; the difference is what a faster way could save.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.cli.bench.kit import times
from lidarcheck.jit import kernel
from lidarcheck.model import streams
from lidarcheck.model.exact.binomial import binomial, inverses
from lidarcheck.model.exact.haze_rates import haze_end
from lidarcheck.model.exact.long_alone import crowded
from lidarcheck.model.exact.numbers import Numbers, numbers_of
from lidarcheck.model.exact.pulses import Pulses, add_rates, pulse_window, pulses_of
from lidarcheck.model.exact.single import Scratch, level_of, new_scratch
from lidarcheck.model.streams import Stream, fill
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = ["Floor", "floor_of"]

_BEAMS = 1024
_DRAWS = 1 << 18
_WORTH = 0.01
"""Avalanches of all detectors that light must set off in a bin, on average, for the bin to be worth a draw of its own:
background alone, which may set off more, is drawn for many bins at once."""


class Floor(NamedTuple):
    """Bins of a beam that the chain walks and those worth a draw, both on average, and what a draw takes [ns]."""

    walked: float
    worth: float
    draw_ns: float

    @property
    def beam_ns(self) -> float:
        """What a beam must cost at least, on one core."""
        return self.worth * self.draw_ns


def floor_of(light: Light, sensor: SpadArray) -> Floor:
    """The floor of some of the light's beams, spread evenly over all."""
    if not len(light):
        return Floor(0.0, 0.0, 0.0)
    numbers = numbers_of(sensor)
    rows = np.unique(np.linspace(0, len(light) - 1, _BEAMS).astype(np.int64))
    rates, found = np.zeros(len(rows) * numbers.bins), np.zeros(2, dtype=np.int64)
    pulses, per_bin = pulses_of(light, sensor, numbers), light.background_per_ns * sensor.bin_ns
    kept = _count(numbers, pulses, per_bin, rows, new_scratch(numbers), _WORTH, rates, found)
    draw_ns = 0.0
    if kept:
        tried = np.resize(rates[:kept], _DRAWS)
        stream, draws = streams.new_stream(0, "floor"), np.empty(_DRAWS + 4)
        inverse, counts = inverses(numbers.detectors), np.empty(_DRAWS, dtype=np.int64)
        seconds = times(lambda: _draw(stream, numbers.detectors, tried, inverse, draws, counts), 3)
        draw_ns = 1e9 * min(seconds) / _DRAWS
    return Floor(found[0] / len(rows), kept / len(rows), draw_ns)


@kernel
def _count(
    numbers: Numbers,
    pulses: Pulses,
    per_bin: FloatArray,
    rows: IndexArray,
    scratch: Scratch,
    worth: float,
    rates: FloatArray,
    found: IndexArray,
) -> int:
    """The bins walked, into `found`; the rates of those worth a draw, to the front of `rates`, and their number."""
    kept = 0
    for row in rows:
        i: Any = np.uint64(row)
        level = level_of(numbers, scratch.blocks, pulses, per_bin[i])
        begin, end = pulse_window(numbers, pulses, i)
        hazy = haze_end(numbers, pulses.haze, i, level.faint)
        if hazy > 0:
            begin = pulses.haze.begin if end == 0 else min(begin, pulses.haze.begin)
            end = max(end, hazy)
        if crowded(scratch.blocks):
            begin, end = 0, numbers.bins
        found[0] += max(end - begin, 0)
        scratch.rates[:] = 0.0
        add_rates(pulses, i, 0, numbers.bins, scratch.rates)
        for k in range(numbers.bins):
            if scratch.rates[k] * numbers.detectors >= worth:
                rates[kept] = scratch.rates[k] + per_bin[i]
                kept += 1
    return kept


@kernel
def _draw(
    stream: Stream,
    detectors: int,
    rates: FloatArray,
    inverse: FloatArray,
    draws: FloatArray,
    counts: npt.NDArray[np.int64],
) -> None:
    """A uniform number and the binomial one that it makes, for each of `rates`."""
    fill(stream, draws, len(rates))
    for k in range(len(rates)):
        counts[k] = binomial(draws[k], detectors, rates[k], inverse)
