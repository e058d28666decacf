"""Echoes as the sensor reports them, in one table; beams are listed in chunks, on several threads."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.jit import kernel
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.report import EchoTable, Report, angles_of, put, report_of, room_for, scan_of_table
from lidarcheck.model.sharing import Share
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, SpadArray
from lidarcheck.sensor.grid import GridBeams

__all__ = ["scan_of"]

ColumnArray = npt.NDArray[np.int32]

_CHUNK = 16384
"""Beams whose echoes are listed at a time: few enough to share the work evenly."""
_HALF_LIGHT_SPEED = 0.5 * LIGHT_SPEED_M_PER_NS


def scan_of(echoes: EchoArrays, light: Light, sensor: SpadArray, rounded: bool, share: Share) -> Scan:
    """The echoes of all beams: PEAK saturated, numbered from 1, no range below 0; `rounded`: as they are reported."""
    starts = range(0, len(light), _CHUNK)
    ends = np.cumsum([0, *(int(echoes.held[start : start + _CHUNK].sum()) for start in starts)])
    rows, layer, point = room_for(int(ends[-1])), light.layer, light.point
    beams = light.beams
    if not isinstance(beams, GridBeams) or (_own(layer, beams.layers) and _own(point, beams.points)):
        up, side, report = layer, point, report_of(sensor, rounded, beams)
    else:
        up = side = np.arange(len(light), dtype=np.int32)
        report = report_of(sensor, rounded, beams, angles_of(beams, layer, point))

    def write(start: int) -> None:
        stop, first = min(start + _CHUNK, len(light)), ends[start // _CHUNK]
        _list_echoes(echoes, layer, point, up, side, start, stop, first, report, rows)

    share(write, starts)
    return scan_of_table(rows, beams, sensor, rounded)


def _own(index: ColumnArray, number: int) -> bool:
    """Whether these are layers, or points, of the sensor."""
    return len(index) == 0 or bool(index.min() >= 0 and index.max() < number)


@kernel
def _list_echoes(
    echoes: EchoArrays,
    layer: ColumnArray,
    point: ColumnArray,
    up: ColumnArray,
    side: ColumnArray,
    start: int,
    stop: int,
    first: int,
    report: Report,
    rows: EchoTable,
) -> None:
    """Write the echoes of the beams `start` ... `stop - 1` one below the other, from row `first` on."""
    at = np.uint64(first)
    for row in range(start, stop):
        i: Any = np.uint64(row)
        for j in range(echoes.held[i]):
            range_m = _HALF_LIGHT_SPEED * (echoes.centre[i, j] * report.bin_ns - report.offset_ns)
            width, area, peak = echoes.width[i, j], echoes.area[i, j], echoes.peak[i, j]
            put(rows, report, at, up[i], side[i], layer[i], point[i], j + 1, range_m, width, area, peak)
            at += np.uint64(1)
