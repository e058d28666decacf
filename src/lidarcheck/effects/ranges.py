"""Moving echoes along their beams, as several effects do, and rounding their ranges as the sensor reports them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor, beam_directions

__all__ = ["at_range", "quantised"]


def quantised(range_m: npt.NDArray[np.float64], sensor: Sensor) -> npt.NDArray[np.float64]:
    """Ranges as the sensor reports them: a multiple of its resolution, and none behind the sensor; same shape."""
    range_m = np.maximum(range_m, 0.0)
    if sensor.range_resolution_m > 0.0:
        range_m = np.rint(range_m / sensor.range_resolution_m) * sensor.range_resolution_m
    return range_m


def at_range(scan: Scan, range_m: npt.NDArray[np.float64]) -> Scan:
    """The same echoes at other ranges, shape (n,), not rounded yet: several effects may move an echo.

    No echo lies behind the sensor: a range below 0 becomes 0. Echoes of a beam that have changed places change rows
    and numbers too, so that both still go by range; all other rows stay where they are.
    """
    range_m = np.maximum(range_m, 0.0)
    xyz = beam_directions(scan.layer, scan.point) * range_m[:, None]
    moved = replace(scan, x_m=xyz[:, 0], y_m=xyz[:, 1], z_m=xyz[:, 2])
    return _in_order(moved, range_m)


def _in_order(scan: Scan, range_m: npt.NDArray[np.float64]) -> Scan:
    """The same echoes; those of a beam whose numbers do not go by range share out its rows and numbers anew."""
    key = scan.layer.astype(np.int64) << 32 | scan.point
    same_beam = key[1:] == key[:-1]
    listed = np.all((key[1:] > key[:-1]) | (same_beam & (scan.echo_number[1:] >= scan.echo_number[:-1])))
    place = np.arange(len(scan)) if listed else np.lexsort((scan.echo_number, key))
    in_order, by_number_m = key[place], range_m[place]
    broken = (in_order[1:] == in_order[:-1]) & (by_number_m[1:] < by_number_m[:-1])
    if not broken.any():
        return scan
    place = place[np.isin(in_order, in_order[1:][broken])]
    by_range = np.lexsort((scan.echo_number[place], range_m[place], key[place]))
    row = np.arange(len(scan))
    row[place] = place[by_range]
    return replace(scan.take(row), echo_number=scan.echo_number)
