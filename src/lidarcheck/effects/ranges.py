"""Moving echoes along their beams, as several effects do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor, beam_directions

__all__ = ["at_range"]


def at_range(scan: Scan, range_m: npt.NDArray[np.float64], sensor: Sensor) -> Scan:
    """The same echoes at other ranges, shape (n,), quantised as the sensor reports them."""
    if sensor.range_resolution_m > 0.0:
        range_m = np.rint(range_m / sensor.range_resolution_m) * sensor.range_resolution_m
    xyz = beam_directions(scan.layer, scan.point) * range_m[:, None]
    return replace(scan, x_m=xyz[:, 0], y_m=xyz[:, 1], z_m=xyz[:, 2])
