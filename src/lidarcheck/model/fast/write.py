"""Writing the table of echoes of beams that have drawn."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import kernel
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.report import EchoTable, Report, put
from lidarcheck.model.fast import words as w

__all__ = ["write_echoes"]

_LIGHT_SPEED_M_PER_NS = 0.299792458
_ONE, _KIND, _SPECIAL = np.uint64(w.ONE), np.uint64(w.KIND), np.uint64(w.SPECIAL)
_WIDTH_AT, _PEAK_AT, _AREA_AT, _CENTRE_AT = (np.uint64(at) for at in (w.WIDTH_AT, w.PEAK_AT, w.AREA_AT, w.CENTRE_AT))
_WIDTH, _PEAK, _AREA = (np.uint64((1 << bits) - 1) for bits in (w.WIDTH_BITS, w.PEAK_BITS, w.AREA_BITS))


@kernel
def write_echoes(
    drawn: npt.NDArray[np.uint64],
    echoes: EchoArrays,
    layer: npt.NDArray[np.int32],
    point: npt.NDArray[np.int32],
    range_m: FloatArray,
    start: int,
    stop: int,
    first: int,
    first_special: int,
    report: Report,
    rows: EchoTable,
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
            put(rows, report, at, layer[i], point[i], layer[i], point[i], 1, range_m[i] + away_m, width, area, peak)
            at += np.uint64(1)
        elif kind == _SPECIAL:
            for j in range(echoes.held[special]):
                time_ns = echoes.centre[special, j] * report.bin_ns - report.offset_ns
                width, area, peak = echoes.width[special, j], echoes.area[special, j], echoes.peak[special, j]
                put(rows, report, at, layer[i], point[i], layer[i], point[i], j + 1, half * time_ns, width, area, peak)
                at += np.uint64(1)
            special += 1
