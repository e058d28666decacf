"""When each row was measured, in seconds from its frame's start, from whatever column a file has for it.

The column itself is kept as the file has it: an integer of nanoseconds has more digits than a float64. Its unit follows
from its name, unless the values cannot be in that unit; else from how long a frame lasts and from today's date, and
where these leave more than one unit or none, it has to be said.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError

__all__ = ["FRAME_COLUMNS", "TIME_UNITS", "Clock", "TimeUnit", "clock_of", "frame_of", "seconds"]

Column = npt.NDArray[Any]
TimeUnit = Literal["s", "ms", "us", "ns"]

TIME_UNITS: dict[TimeUnit, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units of time columns, in seconds."""

FRAME_COLUMNS = ("Frame", "frame_id", "FrameNumber")
"""What a column that numbers the frames is called, in any case."""

TIME_COLUMNS: dict[str, TimeUnit | None] = {
    "offset_time": "ns",
    "t": "ns",
    "time_stamp": "ns",
    "gps_time": "s",
    "time": "s",
    "timestamp": None,
}
"""What drivers call a row's time, in lower case, and its unit; None: programs differ."""

FRAME_S = (0.004, 1.5)
"""0.2 frames at 50 Hz to 1.5 frames at 1 Hz. Units lie a factor of 1000 apart, so at most one fits."""
ENOUGH_TIMES = 100
"""A whole frame shows at least as many moments; what shows fewer may be any part of one and tells no unit."""
EPOCH_S = (946_684_800.0, 4_102_444_800.0)
"""The years 2000 to 2100, since 1970."""


@dataclass(frozen=True, slots=True)
class Clock:
    """The column that says when a row was measured, its unit, and who says which unit it is."""

    column: str
    unit: TimeUnit
    said_by: Literal["its name", "the length of a frame", "its digits", "you"]


def frame_of(columns: Mapping[str, Column]) -> Column | None:
    """The column that numbers the frames, shape (n,), None where there is none."""
    by_name = {name.casefold(): column for name, column in columns.items()}
    return next((by_name[name.casefold()] for name in FRAME_COLUMNS if name.casefold() in by_name), None)


def clock_of(columns: Mapping[str, Column], unit: TimeUnit | None = None) -> Clock | None:
    """Which of a file's columns is its time, and in which unit; None where it has no such column.

    Whole numbers go before others. `unit`: what the user says that it is. `UsageError` where more than one unit fits,
    or none.
    """
    found = [(known, name) for known in TIME_COLUMNS for name in columns if name.casefold() == known]
    if not found:
        return None
    known, name = min(found, key=lambda one: columns[one[1]].dtype.kind not in "iu")
    if unit is not None:
        return Clock(name, unit, "you")
    times, frame = columns[name], frame_of(columns)
    named = TIME_COLUMNS[known]
    if named is not None and _may_be(times, frame, TIME_UNITS[named]):
        return Clock(name, named, "its name")
    by_length, by_digits = _by_length(times, frame), _by_digits(times, frame)
    fitting = sorted({*by_length, *by_digits})
    if len(fitting) != 1:
        why = f"{' and '.join(fitting)} fit" if fitting else "no unit fits its values for sure"
        raise UsageError(f"the unit of the column {name} is not known: {why}", fix="give it with --time-unit")
    return Clock(name, fitting[0], "its digits" if by_digits else "the length of a frame")


def seconds(columns: Mapping[str, Column], clock: Clock) -> FloatArray:
    """When each row was measured [s from its frame's start], shape (n,), NaN where the column has no value.

    Times that begin below 0 count back from the frame's end, and those too long for a frame count from somewhere else;
    both are taken from the frame's first. Differences of whole numbers are exact.
    """
    times, frame = columns[clock.column], frame_of(columns)
    if not len(times):
        return np.zeros(0)
    low, high = (float(f(times)) for f in (np.nanmin, np.nanmax)) if _any_known(times) else (0.0, 0.0)
    unit_s = TIME_UNITS[clock.unit]
    if low >= 0.0 and high * unit_s <= FRAME_S[1]:
        return times * unit_s
    first = _of_frames(np.fmin, times, frame)
    since = times - first
    return np.asarray(since.astype(np.float64) * unit_s)


def _any_known(times: Column) -> bool:
    return times.dtype.kind != "f" or not bool(np.isnan(times).all())


def _may_be(times: Column, frame: Column | None, unit_s: float) -> bool:
    """Whether values of such a unit can be the times of frames."""
    if not len(times) or not _any_known(times):
        return True
    span = _span(times, frame)
    if times.dtype.kind == "f" and 0.0 < span < 1.0 and unit_s == TIME_UNITS["ns"]:
        return False  # parts of a nanosecond
    if times.dtype.kind in "iu" and span > 0 and unit_s == 1.0:
        return False  # whole seconds
    return span * unit_s <= FRAME_S[1] and float(np.nanmax(times)) * unit_s <= EPOCH_S[1]


def _by_length(times: Column, frame: Column | None) -> list[TimeUnit]:
    if len(times) < ENOUGH_TIMES or len(np.unique(times[:: max(1, len(times) // 100_000)])) < ENOUGH_TIMES:
        return []
    span = _span(times, frame)
    latest = float(np.nanmax(times))
    whole = [unit for unit, unit_s in TIME_UNITS.items() if FRAME_S[0] <= span * unit_s <= FRAME_S[1]]
    return [unit for unit in whole if latest * TIME_UNITS[unit] <= EPOCH_S[1]]


def _by_digits(times: Column, frame: Column | None) -> list[TimeUnit]:
    """The units in which the times are a date, and no frame is too long: 40 min in ns are a date of 2047 in ms."""
    if not len(times) or not _any_known(times):
        return []
    low, high = float(np.nanmin(times)), float(np.nanmax(times))
    dated = [unit for unit, unit_s in TIME_UNITS.items() if EPOCH_S[0] <= low * unit_s <= high * unit_s <= EPOCH_S[1]]
    return [unit for unit in dated if _span(times, frame) * TIME_UNITS[unit] <= FRAME_S[1]]


def _span(times: Column, frame: Column | None) -> float:
    """The longest frame, in the column's own unit."""
    return float(np.nanmax(_of_frames(np.fmax, times, frame) - _of_frames(np.fmin, times, frame)))


def _of_frames(extreme: np.ufunc, times: Column, frame: Column | None) -> Column:
    """The first or last time of each row's frame, in the column's own type."""
    if frame is None:
        return np.asarray(extreme.reduce(times))
    order = np.argsort(frame, kind="stable")
    starts = np.flatnonzero(np.r_[True, np.diff(frame[order]) != 0])
    of_frame = extreme.reduceat(times[order], starts)
    row = np.empty(len(times), dtype=np.intp)
    row[order] = np.repeat(np.arange(len(starts)), np.diff(np.r_[starts, len(times)]))
    return np.asarray(of_frame[row])
