"""How the table of echoes is laid out and what it needs to know of the sensor."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.model.fast.write import Report, Rows
from lidarcheck.sensor import LAYERS, POINTS, Sensor, azimuth_deg, elevation_deg

__all__ = ["report_of", "room_for"]

FloatArray = npt.NDArray[np.float64]


def room_for(echoes: int) -> Rows:
    """Columns for that many echoes, in one piece of memory: a piece of that size is made up of large pages."""
    types = [np.int32 if name in ("layer", "point", "echo_number") else np.float64 for name in Rows._fields]
    sizes = [(echoes * np.dtype(kind).itemsize + 63) // 64 * 64 for kind in types]
    memory = np.empty(sum(sizes), dtype=np.uint8)
    columns: list[Any] = []
    for size, kind in zip(sizes, types, strict=True):
        columns.append(memory[:size].view(kind)[:echoes])
        memory = memory[size:]
    return Rows(*columns)


def report_of(sensor: Sensor, rounded: bool) -> Report:
    """How the sensor reports echoes; ranges as they are where not `rounded`."""
    resolution_m = sensor.range_resolution_m if rounded else 0.0
    return Report(*_angles(), sensor.bin_ns, sensor.time_offset_ns, resolution_m, sensor.peak_saturation)


@functools.cache
def _angles() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Cosines and sines of layers and points, as `beam_directions` takes them."""
    up, side = np.deg2rad(elevation_deg(np.arange(LAYERS))), np.deg2rad(azimuth_deg(np.arange(POINTS)))
    return np.cos(up), np.sin(up), np.cos(side), np.sin(side)
