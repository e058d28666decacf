"""Echoes as the sensor reports them, in one table; beams are listed in chunks, on several threads."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.ranges import quantised
from lidarcheck.model.echoes import Echoes, list_echoes
from lidarcheck.model.sharing import Share
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Sensor

__all__ = ["scan_of"]

_CHUNK = 16384
"""Beams whose echoes are listed at a time: few enough for what lies between to stay in the cache."""
_FLOATS = ("x_m", "y_m", "z_m", "width_ns", "area", "peak")
_INTS = ("layer", "point", "echo_number")


def scan_of(echoes: Echoes, light: Light, sensor: Sensor, rounded: bool, share: Share) -> Scan:
    """The echoes of all beams: PEAK saturated, numbered from 1, no range below 0; `rounded`: as they are reported."""
    starts = range(0, len(light), _CHUNK)
    ends = np.cumsum([0, *(int(echoes.held[start : start + _CHUNK].sum()) for start in starts)])
    # Columns that lie in one piece take large pages of memory, which are much faster to come by.
    floats, ints = np.empty((len(_FLOATS), ends[-1])), np.empty((len(_INTS), ends[-1]), dtype=np.int32)
    columns = {**dict(zip(_FLOATS, floats, strict=True)), **dict(zip(_INTS, ints, strict=True))}

    def write(start: int) -> None:
        beams, place = slice(start, start + _CHUNK), start // _CHUNK
        some = Echoes._make(column[beams] for column in echoes)
        part = _listed(some, light.layer[beams], light.point[beams], sensor, rounded)
        for name, column in columns.items():
            column[ends[place] : ends[place + 1]] = getattr(part, name)

    share(write, starts)
    return Scan(**columns)


def _listed(
    echoes: Echoes, layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32], sensor: Sensor, rounded: bool
) -> Scan:
    n = int(echoes.held.sum())
    row, slot = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    centre, features = np.empty(n), np.empty((3, n))
    list_echoes(echoes, row, slot, centre, features)
    # An echo of the first bins is timed before the shot; it is reported at the sensor, not behind it.
    range_m = np.maximum(0.5 * LIGHT_SPEED_M_PER_NS * (centre * sensor.bin_ns - sensor.time_offset_ns), 0.0)
    if rounded:
        range_m = quantised(range_m, sensor)
    return Scan.from_beams(
        layer[row],
        point[row],
        range_m,
        echo_number=(slot + 1).astype(np.int32),
        width_ns=features[0] * sensor.bin_ns,
        area=features[1],
        peak=np.minimum(features[2], sensor.peak_saturation),
    )
