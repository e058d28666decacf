"""Writing the table of echoes of beams that have drawn."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.model.echoes import Echoes
from lidarcheck.model.fast import words as w
from lidarcheck.model.jit import inlined, kernel

__all__ = ["Report", "Rows", "write_echoes"]

FloatArray = npt.NDArray[np.float64]

_LIGHT_SPEED_M_PER_NS = 0.299792458
_ONE, _KIND, _SPECIAL = np.uint64(w.ONE), np.uint64(w.KIND), np.uint64(w.SPECIAL)
_WIDTH_AT, _PEAK_AT, _AREA_AT, _CENTRE_AT = (np.uint64(at) for at in (w.WIDTH_AT, w.PEAK_AT, w.AREA_AT, w.CENTRE_AT))
_WIDTH, _PEAK, _AREA = (np.uint64((1 << bits) - 1) for bits in (w.WIDTH_BITS, w.PEAK_BITS, w.AREA_BITS))


class Rows(NamedTuple):
    """The columns of a table of echoes, shape (n_echoes,) each."""

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    layer: npt.NDArray[np.int32]
    point: npt.NDArray[np.int32]
    echo_number: npt.NDArray[np.int32]
    width_ns: FloatArray
    area: FloatArray
    peak: FloatArray


class Report(NamedTuple):
    """How echoes are reported: cosines and sines of layers and points; `resolution_m` 0: ranges are not rounded."""

    cos_layer: FloatArray
    sin_layer: FloatArray
    cos_point: FloatArray
    sin_point: FloatArray
    bin_ns: float
    offset_ns: float
    resolution_m: float
    saturation: int


@inlined
def _put(
    rows: Rows,
    report: Report,
    at: Any,
    layer: Any,
    point: Any,
    number: int,
    range_m: float,
    width: Any,
    area: Any,
    peak: Any,
) -> None:
    """Write an echo into a row, as the sensor reports it."""
    range_m = max(range_m, 0.0)
    if report.resolution_m > 0.0:
        range_m = np.rint(range_m / report.resolution_m) * report.resolution_m
    up, side = np.uint64(layer), np.uint64(point)
    rows.x_m[at] = report.cos_point[side] * report.cos_layer[up] * range_m
    rows.y_m[at] = report.sin_point[side] * report.cos_layer[up] * range_m
    rows.z_m[at] = report.sin_layer[up] * range_m
    rows.layer[at] = layer
    rows.point[at] = point
    rows.echo_number[at] = number
    rows.width_ns[at] = width * report.bin_ns
    rows.area[at] = area
    rows.peak[at] = min(peak, report.saturation)


@kernel
def write_echoes(
    drawn: npt.NDArray[np.uint64],
    echoes: Echoes,
    layer: npt.NDArray[np.int32],
    point: npt.NDArray[np.int32],
    range_m: FloatArray,
    start: int,
    stop: int,
    first: int,
    first_special: int,
    report: Report,
    rows: Rows,
) -> None:
    """The echoes of the beams `start` ... `stop - 1` into `rows` from `first` on; those of special beams stand in
    `echoes`, from `first_special` on."""
    at, special = np.uint64(first), first_special
    half = 0.5 * _LIGHT_SPEED_M_PER_NS
    # away = (steps - zero) * step; as a range: half a bin's light way a bin.
    scale = half * report.bin_ns * w.CENTRE_STEP
    zero = -(w.CENTRE_ZERO * scale) - half * report.offset_ns
    for row in range(start, stop):
        i = np.uint64(row)
        word = drawn[i]
        kind = word & _KIND
        if kind == _ONE:
            away_m = np.float64(np.int64(word >> _CENTRE_AT)) * scale + zero
            width, peak = np.int64(word >> _WIDTH_AT & _WIDTH), np.int64(word >> _PEAK_AT & _PEAK)
            area = np.int64(word >> _AREA_AT & _AREA)
            _put(rows, report, at, layer[i], point[i], 1, range_m[i] + away_m, width, area, peak)
            at += np.uint64(1)
        elif kind == _SPECIAL:
            for j in range(echoes.held[special]):
                time_ns = echoes.centre[special, j] * report.bin_ns - report.offset_ns
                width, area, peak = echoes.width[special, j], echoes.area[special, j], echoes.peak[special, j]
                _put(rows, report, at, layer[i], point[i], j + 1, half * time_ns, width, area, peak)
                at += np.uint64(1)
            special += 1
