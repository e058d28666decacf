"""From light to histograms and their echoes, chunk by chunk, on several threads."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import kernel
from lidarcheck.model import streams
from lidarcheck.model.detector_echoes import (
    Candidates,
    DetectorEchoes,
    Gate,
    Rows,
    echoes_from,
    gate_of,
    joined,
    new_candidates,
    new_rows,
    put,
)
from lidarcheck.model.histogram.counts import add_rates, draw_counts
from lidarcheck.model.histogram.numbers import HistogramNumbers, ZoneLight, histogram_numbers, zone_light
from lidarcheck.model.histogram.search import SearchSpace, background_of, coates, find, new_search_space
from lidarcheck.model.many_trials import INVERSES
from lidarcheck.model.sharing import Progress, share
from lidarcheck.scan import Light
from lidarcheck.sensor import PhotonHistogram
from lidarcheck.sensor.laws import EchoNumbers

__all__ = ["histogram_echoes"]

_CHUNK = 256
"""Zones a thread takes at a time."""
_ROOM = 64
"""Echoes of one zone before the sensor chooses."""


@kernel
def _zones(
    numbers: HistogramNumbers,
    gate: Gate,
    light: ZoneLight,
    key: npt.NDArray[np.uint64],
    frame: Any,
    inverse: FloatArray,
    start: int,
    stop: int,
    work: FloatArray,
    space: SearchSpace,
    found: Candidates,
    rows: Rows,
    background: FloatArray,
    histogram: npt.NDArray[np.uint32],
) -> int:
    """Histograms and echoes of the zones `start` ... `stop - 1`; returns how many echoes stand in `rows`."""
    at = 0
    rates, chances, counts = work[0], work[1], work[2]
    for row in range(start, stop):
        zone: Any = np.uint64(row)
        add_rates(light, zone, rates)
        draw_counts(numbers, rates, key, light.beams[zone], frame, inverse, chances, counts)
        if len(histogram) > 0:
            for k in range(numbers.bins):
                histogram[zone, k] = np.uint32(counts[k])
        if numbers.coates:
            coates(numbers.trials, counts)
        background[zone] = background_of(counts, space.sorted)
        held = find(numbers, gate, counts, background[zone], light.offset[zone], space, found)
        if held > 0:
            at = put(gate, found, held, row, rows, at)
    return at


def histogram_echoes(
    light: Light,
    sensor: PhotonHistogram,
    *,
    seed: int = 0,
    frame: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    rounded: bool = True,
) -> DetectorEchoes:
    """The histograms of a chip's zones and the echoes found in them, draws keyed by seed, frame, zone and bin.

    `light.background_per_ns` is all light that does not depend on time, per SPAD, shot and ns. `rounded`: ranges as
    they are reported, else before the sensor's constant error and its step.
    """
    n = len(light)
    numbers, gate, seen = histogram_numbers(sensor), gate_of(sensor, rounded), zone_light(light, sensor)
    key = streams.new_stream(seed, "photon histogram", frame).key
    shown = any(feature.law == "histogram" for feature in sensor.features)
    histogram = np.empty((n if shown else 0, numbers.bins), dtype=np.uint32)
    background = np.empty(n)
    starts = range(0, n, _CHUNK)
    parts, held = [new_rows(0)] * len(starts), [0] * len(starts)

    def run(start: int) -> None:
        stop = min(start + _CHUNK, n)
        rows, found = new_rows((stop - start) * min(_ROOM, sensor.max_echoes)), new_candidates(_ROOM)
        work, space = np.empty((3, numbers.bins)), new_search_space(numbers.bins)
        asked = (numbers, gate, seen, key, np.uint64(frame), INVERSES, start, stop)
        found_rows = _zones(*asked, work, space, found, rows, background, histogram)
        parts[start // _CHUNK], held[start // _CHUNK] = rows, found_rows

    share(run, starts, threads, lambda done: progress and progress(min(done * _CHUNK, n), n))
    rows = joined(parts, held)
    about = EchoNumbers(
        rows.amplitude,
        rows.range_m - seen.offset[rows.beam],
        background=background[rows.beam] * numbers.bins,
        floor_counts=rows.more,
    )
    return echoes_from(rows, about, sensor, histogram if shown else None)
