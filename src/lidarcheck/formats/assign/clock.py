"""When rows were measured, counted from their frame's start: the unit and the zero of a driver's time field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.times import TIME_UNITS

__all__ = ["DRIVERS", "Driver", "FrameTime", "frame_time"]

Zero = Literal["first", "last", "epoch"]

_SPAN = (0.2, 1.5)
"""A frame spans so many of its 1/frame_rate: units lie a factor of 1000 apart, so at most one fits."""


class Driver(NamedTuple):
    """The time field of a driver's clouds: its name in lower case, dtype, unit and zero."""

    driver: str
    field: str
    dtype: str
    unit: str
    zero: Zero


DRIVERS = (
    Driver("velodyne (ROS)", "time", "float32", "s", "last"),
    Driver("ouster-ros", "t", "uint32", "ns", "first"),
    Driver("Hesai, RoboSense", "timestamp", "float64", "s", "epoch"),
    Driver("Livox PointCloud2", "timestamp", "float64", "ns", "epoch"),
    Driver("Livox CustomMsg", "offset_time", "uint32", "ns", "first"),
    Driver("nebula", "time_stamp", "uint32", "ns", "first"),
    Driver("velodyne-decoder", "time", "float32", "s", "first"),
)
"""What drivers write; two of one field and dtype are told apart by the span and by the sign of the values."""


@dataclass(frozen=True)
class FrameTime:
    """`time_s` (n,) from the frame's start, NaN where a row has none; the unit and zero that were found or declared."""

    time_s: FloatArray
    unit: str
    zero: Zero


def frame_time(
    values: npt.NDArray[Any],
    frame_s: float,
    *,
    unit: str = "auto",
    zero: str = "auto",
    duration_s: float | None = None,
    stamp_s: float | None = None,
) -> FrameTime:
    """The times of one frame's rows, shape (n,), as the file has them, in seconds from its start.

    `frame_s`: 1/frame rate; `duration_s`: of the sweep, else the same. `stamp_s`: the frame's own stamp, if it has one.
    Whole numbers are subtracted as such. `UsageError` where the span of the frame fits no unit.
    """
    duration = frame_s if duration_s is None else duration_s
    known = np.isfinite(values) if values.dtype.kind == "f" else np.ones(len(values), dtype=np.bool_)
    if not known.any():
        return FrameTime(np.full(len(values), np.nan), "s" if unit == "auto" else unit, "first")
    low, high = values[known].min(), values[known].max()
    found = _unit(float(high - low) if values.dtype.kind == "f" else float(int(high) - int(low)), frame_s, unit)
    unit_s = TIME_UNITS[found]  # type: ignore[index]
    start = _zero(float(low) * unit_s, float(high) * unit_s, frame_s, zero)
    if start == "epoch":
        time_s = (values - low).astype(np.float64) * unit_s
        first_s = float(low) * unit_s
        if stamp_s is not None and 0.0 <= first_s - stamp_s <= frame_s:  # a later one is of the frame's end
            time_s = time_s + (first_s - stamp_s)
    else:
        time_s = values.astype(np.float64) * unit_s
        time_s = time_s + duration if start == "last" else time_s
    return FrameTime(np.where(known, time_s, np.nan), found, start)


def _unit(span: float, frame_s: float, unit: str) -> str:
    low, high = (share * frame_s for share in _SPAN)
    fitting = [name for name, unit_s in TIME_UNITS.items() if low <= span * unit_s <= high]
    if unit == "auto":
        if len(fitting) != 1:
            what = f"the times span {span:g}, which is no frame of {frame_s:g} s in s, ms, us or ns"
            raise UsageError(what, fix='give the sensor file time_unit = "s", "ms", "us" or "ns"')
        return fitting[0]
    if span * TIME_UNITS[unit] > high:  # type: ignore[index]
        what = f"the times span {span * TIME_UNITS[unit]:g} s in {unit}, a frame lasts {frame_s:g} s"  # type: ignore[index]
        fix = f'time_unit = "{fitting[0]}"' if fitting else "give each frame a file, or Frame numbers"
        raise UsageError(what, fix=fix)
    return unit


def _zero(low_s: float, high_s: float, frame_s: float, zero: str) -> Zero:
    if zero != "auto":
        return zero  # type: ignore[return-value]
    if high_s <= 0.0 and low_s < 0.0:
        return "last"
    return "first" if low_s >= 0.0 and high_s <= _SPAN[1] * frame_s else "epoch"
