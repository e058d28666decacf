"""Echoes of sensors whose SPADs disturb each other: what `kernel.py` is to the exact chain.

The detectors themselves are followed in `detector_kernel.py`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.detectors.array import Detectors, detectors_of
from lidarcheck.model.detectors.kernel import follow
from lidarcheck.model.detectors.scratch import DetectorScratch, new_scratch, set_all
from lidarcheck.model.exact.echoes import EchoArrays, find_echoes
from lidarcheck.model.exact.numbers import Numbers, numbers_of
from lidarcheck.model.exact.pulses import Pulses, pulses_of
from lidarcheck.model.streams import Stream, beam_keys, new_stream
from lidarcheck.model.way import Way
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = ["count_beams", "draw_avalanches", "simulate_beams", "way"]


@inlined
def _busy(numbers: Numbers, scratch: DetectorScratch) -> Any:
    """The bins among which all are that more than `threshold` detectors can be ON in; clears `scratch.blocks`.

    Such a bin sees the avalanches of its own block and the one before, at most.
    """
    blocks, length = scratch.blocks, 1 << scratch.shift
    start = scratch.lead >> scratch.shift
    before = blocks[start - 1]
    begin = end = 0
    for j in range(start, len(blocks)):
        if before + blocks[j] > numbers.threshold:
            begin = (j - start) * length if end == 0 else begin
            end = min((j - start + 1) * length, numbers.bins)
        before = blocks[j]
    set_all(blocks, len(blocks), 0)
    return begin, end


@kernel
def count_beams(
    numbers: Numbers,
    detectors: Detectors,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    scratch: DetectorScratch,
    avalanches: npt.NDArray[np.int32],
) -> None:
    """Follow the detectors of every beam; `avalanches` (n, bins) takes how many avalanche in each bin."""
    for i in range(len(beams)):
        follow(numbers, detectors, stream, scratch, beams[i], per_bin[i], pulses, i)
        for k in range(numbers.bins):
            avalanches[i, k] = scratch.counts[numbers.pad + k]
        set_all(scratch.counts, len(scratch.counts), 0)
        set_all(scratch.blocks, len(scratch.blocks), 0)


@kernel
def simulate_beams(
    numbers: Numbers,
    detectors: Detectors,
    stream: Stream,
    beams: npt.NDArray[np.uint64],
    per_bin: FloatArray,
    pulses: Pulses,
    order: IndexArray,
    scratch: DetectorScratch,
    echoes: EchoArrays,
) -> None:
    """Simulate the beams of `order`, independent of each other, into `echoes`; see `kernel.simulate_beams`.

    `scratch.size[1]` counts afterpulses that found no room: there must be none, see `_simulate_all`.
    """
    for i in order:
        follow(numbers, detectors, stream, scratch, beams[i], per_bin[i], pulses, i)
        begin, end = _busy(numbers, scratch)
        find_echoes(numbers, scratch.counts, begin, end, i, echoes)
        set_all(scratch.counts, len(scratch.counts), 0)


def way(sensor: SpadArray, numbers: Numbers) -> Way:
    """How SPADs of any kind are simulated."""
    return Way((detectors_of(sensor, numbers),), new_scratch, _simulate_all)


def _simulate_all(*arguments: Any) -> None:
    """`simulate_beams`; `UsageError` where more afterpulses wait than the work space has room for."""
    simulate_beams(*arguments)
    _check_room(arguments[-2])


def draw_avalanches(light: Light, sensor: SpadArray, *, seed: int = 0, frame: int = 0) -> npt.NDArray[np.int32]:
    """Avalanches of all detectors in each bin, shape (n_beams, bins): what the echoes of the same seed are made of."""
    numbers = numbers_of(sensor)
    detectors = detectors_of(sensor, numbers)
    scratch = new_scratch(numbers, detectors)
    avalanches = np.empty((len(light), sensor.bins), dtype=np.int32)
    count_beams(
        numbers,
        detectors,
        new_stream(seed, "spads", frame),
        beam_keys(light.layer, light.point),
        light.background_per_ns * sensor.bin_ns,
        pulses_of(light, sensor, numbers),
        scratch,
        avalanches,
    )
    _check_room(scratch)
    return avalanches


def _check_room(scratch: DetectorScratch) -> None:
    if scratch.size[1] > 0:
        raise UsageError(
            f"more than {len(scratch.heap)} afterpulses of a beam wait at the same time",
            fix="lower the background, the afterpulses' delay or the number of SPADs",
        )
