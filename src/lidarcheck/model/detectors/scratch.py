"""What a thread works in while it follows detectors, and the random numbers it draws there."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.detectors.array import Detectors
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.lane_math import log
from lidarcheck.model.streams import Stream, fill, rewind

__all__ = ["DetectorScratch", "add_fired", "new_scratch", "primary", "rewind_both", "secondary", "set_all", "waiting"]

_BATCH = 64
"""Draws that are made at a time."""


class DetectorScratch(NamedTuple):
    """What a thread works in. `counts`: avalanches per bin, all zero, `numbers.pad` bins before bin 0 included.

    `blocks`: the same in blocks of 2^`shift` bins, of which one begins with bin 0 and the first with bin -`lead`.
    `armed_from` (detectors,): the first bin in which each can avalanche again. `fired`, `armed` (detectors,): those
    that avalanche in a bin, those that could. `heap`: afterpulses to come, `size[0]` of them. `clock[0]`: what is left
    of the exponential number. `primary`, `secondary`: draws, `at[0]` and `at[1]` of them used up; `waits`: exponential
    numbers that the former make; `counter`: where the second stream stands.
    """

    counts: IndexArray
    blocks: IndexArray
    shift: int
    lead: int
    rates: FloatArray
    armed_from: npt.NDArray[np.int32]
    fired: npt.NDArray[np.int32]
    armed: npt.NDArray[np.int32]
    heap: IndexArray
    size: IndexArray
    clock: FloatArray
    primary: FloatArray
    waits: FloatArray
    secondary: FloatArray
    at: IndexArray
    counter: npt.NDArray[np.uint64]


def new_scratch(numbers: Numbers, detectors: Detectors) -> DetectorScratch:
    """Work space for one thread."""
    shift = max(numbers.on - 2, 0).bit_length()
    lead = -(-numbers.pad >> shift) << shift
    return DetectorScratch(
        counts=np.zeros(2 * numbers.pad + numbers.bins, dtype=np.int64),
        blocks=np.zeros(((lead + numbers.bins) >> shift) + 1, dtype=np.int64),
        shift=shift,
        lead=lead,
        rates=np.empty(max(numbers.bins, detectors.warm_up)),
        armed_from=np.empty(numbers.detectors, dtype=np.int32),
        fired=np.empty(numbers.detectors, dtype=np.int32),
        armed=np.empty(numbers.detectors + 1, dtype=np.int32),
        heap=np.empty(detectors.room, dtype=np.int64),
        size=np.zeros(2, dtype=np.int64),
        clock=np.empty(1),
        primary=np.empty(_BATCH),
        waits=np.empty(_BATCH),
        secondary=np.empty(_BATCH),
        at=np.empty(2, dtype=np.int64),
        counter=np.zeros(4, dtype=np.uint64),
    )


@inlined
def set_all(numbers: Any, count: int, value: Any) -> None:
    """Set the first `count` to a value, at the speed of memory: an assignment to a slice goes from one to the next."""
    for k in range(np.uint64(count)):
        numbers[k] = value


@kernel
def _fill_primary(stream: Stream, primary: FloatArray, waits: FloatArray) -> None:
    """The next draws, and all their logarithms at once: several of them cost what one does."""
    fill(stream, primary, _BATCH)
    for k in range(_BATCH):
        waits[k] = -log(1.0 - primary[k])


@inlined
def _taken(stream: Stream, scratch: DetectorScratch) -> int:
    """Where the next draw for primary avalanches stands."""
    at = scratch.at[0]
    if at == _BATCH:
        _fill_primary(stream, scratch.primary, scratch.waits)
        at = 0
    scratch.at[0] = at + 1
    return int(at)


@inlined
def primary(stream: Stream, scratch: DetectorScratch) -> float:
    """The next draw for primary avalanches."""
    return float(scratch.primary[_taken(stream, scratch)])


@inlined
def waiting(stream: Stream, scratch: DetectorScratch) -> float:
    """The next draw for primary avalanches as an exponential number of mean 1."""
    return float(scratch.waits[_taken(stream, scratch)])


@inlined
def add_fired(numbers: Numbers, scratch: DetectorScratch, bin_: int, fired: int) -> None:
    """Count avalanches of a bin, which may lie before those that matter."""
    if bin_ >= -numbers.pad:
        scratch.counts[numbers.pad + bin_] += fired
        scratch.blocks[(scratch.lead + bin_) >> scratch.shift] += fired


@inlined
def secondary(stream: Stream, scratch: DetectorScratch) -> float:
    """The next draw for what an avalanche sets off and how long it leaves its detector dead."""
    at = scratch.at[1]
    if at == _BATCH:
        fill(Stream(scratch.counter, stream.key), scratch.secondary, _BATCH)
        at = 0
    scratch.at[1] = at + 1
    return float(scratch.secondary[at])


@inlined
def rewind_both(stream: Stream, scratch: DetectorScratch, beam: Any) -> None:
    """Go to the first draws of a beam; the second stream differs from the first in its counter's last word."""
    rewind(stream, beam)
    for j in range(3):
        scratch.counter[j] = stream.counter[j]
    scratch.counter[3] = np.uint64(1)
    scratch.at[:] = _BATCH
