"""Echoes of detectors that are described by a file: what their kernels write, and the table that comes of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.jit import inlined
from lidarcheck.model.picks import KEEP_CODES, pick
from lidarcheck.sensor import Sensor
from lidarcheck.sensor.laws import EchoNumbers, value

__all__ = [
    "Candidates",
    "DetectorEchoes",
    "Gate",
    "Rows",
    "add",
    "echoes_from",
    "features_of",
    "fixed",
    "gate_of",
    "joined",
    "new_candidates",
    "new_rows",
    "put",
    "write",
]

_ROUNDER = 6755399441055744.0
"""1.5 x 2^52: what is added to it is rounded to a whole number, halves to the even one."""
_SLACK = 1e-9
"""Of a range step: by so much may a range that was rounded to a limit of the gate seem to lie outside."""


@dataclass(frozen=True)
class DetectorEchoes:
    """Echoes, a row each, in order of (beam, range); columns of shape (n,).

    `beam`: its row in the light. `echo_number` counts a beam's echoes from 1 in order of range; `made_number` is the
    number that the sensor gives them (`return_order`), `pick` the place of the word of `keep` that chose them, from 0.
    `range_m`: as reported, or, where ranges are not rounded yet, the way from the beam's origin and the channel's
    `range_offset` without the sensor's own `range_offset_m`. `numbers`: what laws of features ask, the amplitude among
    it, before calibration and quantisation: what "strongest" compares. `features`: by the sensor's names, as reported;
    `features_of` gives them anew where a range has changed since. `histogram`: counts, shape (n_beams, bins), None
    where the sensor reports none; every beam has its row, with an echo or without.
    """

    beam: IndexArray
    echo_number: IntArray
    made_number: IntArray
    pick: IntArray
    range_m: FloatArray
    numbers: EchoNumbers
    features: Mapping[str, FloatArray]
    histogram: npt.NDArray[np.uint32] | None = None

    def __len__(self) -> int:
        return len(self.beam)

    @property
    def amplitude(self) -> FloatArray:
        """Of each echo, before calibration and quantisation."""
        return self.numbers.amplitude


class Gate(NamedTuple):
    """What becomes of a beam's echoes, as kernels see it; lengths in m."""

    low: float
    high: float
    step: float
    offset: float
    keep: int
    most: int
    as_kept: bool
    rounded: bool


class Candidates(NamedTuple):
    """The echoes of one beam before any is left out, nearest first: shape (room,) each; `order` is work space.

    `path`: from the beam's origin, with the channel's range offset. `more`: a further number of each, which differs
    from detector to detector.
    """

    path: FloatArray
    reported: FloatArray
    amplitude: FloatArray
    more: FloatArray
    order: IndexArray


class Rows(NamedTuple):
    """Echoes of a chunk of beams, a row each: shape (room,)."""

    beam: IndexArray
    number: IntArray
    made: IntArray
    pick: IntArray
    range_m: FloatArray
    amplitude: FloatArray
    more: FloatArray


def fixed(array: npt.NDArray[Any]) -> Any:
    """The array, read-only as the columns of tables are: kernels are compiled for either, and one is enough."""
    view = array.view()
    view.flags.writeable = False
    return view


def gate_of(sensor: Sensor, rounded: bool) -> Gate:
    """The sensor's gate, range step and choice of echoes."""
    return Gate(
        low=float(sensor.min_range_m),
        high=float(sensor.max_range_m),
        step=float(sensor.range_resolution_m),
        offset=float(sensor.range_offset_m),
        keep=KEEP_CODES[sensor.keep],
        most=int(sensor.max_echoes),
        as_kept=sensor.return_order == "as_kept",
        rounded=bool(rounded),
    )


def new_candidates(room: int) -> Candidates:
    """Work space for the echoes of one beam."""
    path, reported, amplitude, more = np.empty((4, room))
    return Candidates(path, reported, amplitude, more, np.empty(room, dtype=np.int64))


def new_rows(room: int) -> Rows:
    """Room for the echoes of a chunk."""
    number, made, place = np.empty((3, room), dtype=np.int32)
    range_m, amplitude, more = np.empty((3, room))
    return Rows(np.empty(room, dtype=np.int64), number, made, place, range_m, amplitude, more)


@inlined
def add(gate: Gate, found: Candidates, held: int, path: float, amplitude: float, more: float) -> int:
    """Add an echo in its place by range, where the sensor reports its range at all; returns how many there are."""
    reported = path + gate.offset
    slack = _SLACK * (gate.step + reported)
    if gate.step > 0.0:
        reported = ((reported / gate.step + _ROUNDER) - _ROUNDER) * gate.step
    if not (reported >= gate.low - slack and reported <= gate.high + slack) or held == len(found.path):
        return held
    j = held
    while j > 0 and found.path[j - 1] > path:
        found.path[j], found.reported[j] = found.path[j - 1], found.reported[j - 1]
        found.amplitude[j], found.more[j] = found.amplitude[j - 1], found.more[j - 1]
        j -= 1
    found.path[j], found.reported[j], found.amplitude[j], found.more[j] = path, reported, amplitude, more
    return held + 1


@inlined
def write(
    gate: Gate, found: Candidates, i: int, number: int, made: int, place: int, beam: int, rows: Rows, row: int
) -> None:
    """Write echo `i` of a beam to a row: its number by range, the sensor's own number, its place in `keep`."""
    rows.beam[row], rows.number[row], rows.made[row], rows.pick[row] = beam, number, made, place
    rows.range_m[row] = found.reported[i] if gate.rounded else found.path[i]
    rows.amplitude[row], rows.more[row] = found.amplitude[i], found.more[i]


@inlined
def put(gate: Gate, found: Candidates, held: int, beam: int, rows: Rows, at: int) -> int:
    """Write those of the beam's echoes that are kept below row `at`, nearest first; returns the next free row."""
    order = found.order
    kept = pick(gate.keep, gate.most, held, found.amplitude, order)
    for j in range(kept):
        nearer = 0
        for other in range(kept):
            if order[other] < order[j]:
                nearer += 1
        made = j + 1 if gate.as_kept else nearer + 1
        write(gate, found, order[j], nearer + 1, made, j, beam, rows, at + nearer)
    return at + kept


def joined(parts: Sequence[Rows], held: Sequence[int]) -> Rows:
    """The first rows of each chunk, as many as it holds, one below the other."""
    chunks = list(zip(parts, held, strict=True)) or [(new_rows(0), 0)]
    columns: Any = ([part[name][:n] for part, n in chunks] for name in range(len(Rows._fields)))
    return Rows(*map(np.concatenate, columns))


def features_of(numbers: EchoNumbers, sensor: Sensor) -> dict[str, FloatArray]:
    """Every feature of the sensor that is one number an echo, as it is reported."""
    return {feature.name: value(feature, numbers, sensor) for feature in sensor.features if feature.law != "histogram"}


def echoes_from(
    rows: Rows, numbers: EchoNumbers, sensor: Sensor, histogram: npt.NDArray[np.uint32] | None = None
) -> DetectorEchoes:
    """The table of a detector's rows."""
    features = features_of(numbers, sensor)
    return DetectorEchoes(rows.beam, rows.number, rows.made, rows.pick, rows.range_m, numbers, features, histogram)
