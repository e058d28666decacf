"""How the sensor reports echoes: the table of their columns, and an echo's row in it."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.shared.ranges import reported, within_gate
from lidarcheck.jit import inlined
from lidarcheck.model.placing import placed
from lidarcheck.scan import Scan
from lidarcheck.sensor import Beams, SpadArray
from lidarcheck.sensor.grid import GridBeams

__all__ = ["EchoTable", "Report", "angles_of", "put", "report_of", "room_for", "scan_of_table"]

Angles = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


class EchoTable(NamedTuple):
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
    """How echoes are reported: cosines and sines of elevations and azimuths, those of the sensor's own beams by layer
    and point; `resolution_m` 0: ranges are not rounded."""

    cos_layer: FloatArray
    sin_layer: FloatArray
    cos_point: FloatArray
    sin_point: FloatArray
    bin_ns: float
    offset_ns: float
    resolution_m: float
    saturation: int


def room_for(echoes: int) -> EchoTable:
    """Columns for that many echoes, in one piece of memory: a piece of that size is made up of large pages."""
    types = [np.int32 if name in ("layer", "point", "echo_number") else np.float64 for name in EchoTable._fields]
    sizes = [(echoes * np.dtype(kind).itemsize + 63) // 64 * 64 for kind in types]
    memory = np.empty(sum(sizes), dtype=np.uint8)
    columns: list[Any] = []
    for size, kind in zip(sizes, types, strict=True):
        columns.append(memory[:size].view(kind)[:echoes])
        memory = memory[size:]
    return EchoTable(*columns)


def report_of(sensor: SpadArray, rounded: bool, beams: Beams, angles: Angles | None = None) -> Report:
    """How the sensor reports echoes; ranges as they are where not `rounded`. `angles`: of beams not its own."""
    resolution_m = sensor.range_resolution_m if rounded and _simple(sensor, beams) else 0.0
    own = _angles(beams) if angles is None else angles
    return Report(*own, sensor.bin_ns, sensor.time_offset_ns, resolution_m, sensor.peak_saturation)


@functools.lru_cache(maxsize=16)
def _angles(beams: Beams) -> Angles:
    """Of a grid its beams'; of others what writes an echo's range as its X, for `scan_of_table`."""
    if isinstance(beams, GridBeams):
        return angles_of(beams, np.arange(beams.layers), np.arange(beams.points))
    return np.ones(beams.layers), np.zeros(beams.layers), np.ones(beams.points), np.zeros(beams.points)


def angles_of(beams: GridBeams, layer: npt.ArrayLike, point: npt.ArrayLike) -> Angles:
    """Cosines and sines of layers and of points of a grid; same shapes."""
    return *beams.elevation.cos_sin(layer), *beams.azimuth.cos_sin(point)


def scan_of_table(rows: EchoTable, beams: Beams, sensor: SpadArray, rounded: bool) -> Scan:
    """The echoes of a table that was written for these beams; `rounded`: as they are reported."""
    if isinstance(beams, GridBeams):
        scan = Scan(*rows, beams=beams)
        return reported(scan, sensor) if rounded and not _simple(sensor, beams) else scan
    more_m, step_m = (sensor.range_offset_m, sensor.range_resolution_m) if rounded else (0.0, 0.0)
    xyz = placed(beams, rows.layer, rows.point, rows.x_m, more_m=more_m, step_m=step_m)
    scan = Scan(*rows._replace(x_m=xyz[0], y_m=xyz[1], z_m=xyz[2]), beams=beams)
    return within_gate(scan, sensor) if rounded else scan


def _simple(sensor: SpadArray, beams: Beams) -> bool:
    """Whether an echo's way, rounded, is what the sensor reports."""
    return isinstance(beams, GridBeams) and sensor.range_offset_m == 0.0 and sensor.min_range_m == 0.0


@inlined
def put(
    rows: EchoTable,
    report: Report,
    at: Any,
    up: Any,
    side: Any,
    layer: Any,
    point: Any,
    number: int,
    range_m: float,
    width: Any,
    area: Any,
    peak: Any,
) -> None:
    """Write an echo into a row, as the sensor reports it; `up` and `side`: where the angles of its beam stand."""
    # An echo of the first bins is timed before the shot; it is reported at the sensor, not behind it.
    range_m = max(range_m, 0.0)
    if report.resolution_m > 0.0:
        range_m = np.rint(range_m / report.resolution_m) * report.resolution_m
    of_layer, of_point = np.uint64(up), np.uint64(side)
    rows.x_m[at] = report.cos_point[of_point] * report.cos_layer[of_layer] * range_m
    rows.y_m[at] = report.sin_point[of_point] * report.cos_layer[of_layer] * range_m
    rows.z_m[at] = report.sin_layer[of_layer] * range_m
    rows.layer[at] = layer
    rows.point[at] = point
    rows.echo_number[at] = number
    rows.width_ns[at] = width * report.bin_ns
    rows.area[at] = area
    rows.peak[at] = min(peak, report.saturation)
