"""The beams of a sensor's file for the rows of a cloud: what both say of rings, columns and times."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.assign.clock import frame_time
from lidarcheck.formats.assign.cloud import Cloud
from lidarcheck.formats.assign.order import Assigned, Known, Rows, assign
from lidarcheck.formats.geometry.head import Head
from lidarcheck.sensor.channels import ChannelBeams
from lidarcheck.sensor.sensor import Sensor

__all__ = ["assigned_to"]


def assigned_to(sensor: Sensor, cloud: Cloud, position: FloatArray) -> Assigned:
    """The beam of each row of one frame, by whatever its file says of it; `position` (n, 3) [m], right-handed.

    `UsageError` where nothing tells them, a ring is none of the sensor's, or times do not have the unit that the
    sensor's file says.
    """
    head = Head.of(sensor.beams)
    if head is None:
        if cloud.layer is not None and cloud.point is not None:
            told = (cloud.layer.astype(np.int32), cloud.point.astype(np.int32))
            return Assigned(*told, "Layer and Point", layers_told=True, points_told=True)
        layer, point = sensor.beams.nearest(position)
        return Assigned(layer, point, "direction alone", layers_told=False, points_told=False)
    channels = sensor.beams.channels if isinstance(sensor.beams, ChannelBeams) else None
    rows = Rows(
        position, cloud.layer, cloud.point, cloud.ring, cloud.column, _time(cloud, sensor), cloud.kind, cloud.cell,
        cloud.height, cloud.width,
    )  # fmt: skip
    known = Known(
        head,
        () if channels is None else channels.ring,
        np.zeros(0, dtype=np.int64) if channels is None else np.asarray(channels.column_shift),
        sensor.deskewed,
    )
    return assign(rows, known)


def _time(cloud: Cloud, sensor: Sensor) -> FloatArray | None:
    if cloud.time is None or sensor.sweep.order == "flash":
        return None
    rate_s = 1.0 / sensor.frame_rate_hz
    unit, zero = sensor.time_unit, sensor.time_zero
    try:
        duration_s, stamp_s = sensor.sweep.duration_s, cloud.stamp_s
        return frame_time(cloud.time, rate_s, unit=unit, zero=zero, duration_s=duration_s, stamp_s=stamp_s).time_s
    except UsageError:
        # Part of a frame spans too little to show its unit; then the azimuth tells the column.
        if sensor.time_unit == "auto":
            return None
        raise
