"""How the sensor reports echoes: the table of their columns, and an echo's row in it."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.model.jit import inlined
from lidarcheck.sensor import LAYERS, POINTS, Sensor, cos_sin

__all__ = ["EchoTable", "Report", "angles_of", "put", "report_of", "room_for"]

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


def report_of(sensor: Sensor, rounded: bool, angles: Angles | None = None) -> Report:
    """How the sensor reports echoes; ranges as they are where not `rounded`. `angles`: of beams not its own."""
    resolution_m = sensor.range_resolution_m if rounded else 0.0
    own = _angles() if angles is None else angles
    return Report(*own, sensor.bin_ns, sensor.time_offset_ns, resolution_m, sensor.peak_saturation)


@functools.cache
def _angles() -> Angles:
    return angles_of(np.arange(LAYERS), np.arange(POINTS))


def angles_of(layer: npt.ArrayLike, point: npt.ArrayLike) -> Angles:
    """Cosines and sines of layers and of points, as `beam_directions` takes them; same shapes."""
    return *cos_sin(layer, "layer"), *cos_sin(point, "point")


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
