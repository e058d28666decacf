"""What each ring looks beside its column, and when in the column it fires."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.assign.columns import circular_median
from lidarcheck.formats.guess.columns import Steps, offsets
from lidarcheck.formats.guess.rows import Labelled
from lidarcheck.formats.guess.turning import Turning

__all__ = ["Beside", "beside_columns"]

_ROUNDS = 8
_SNAP = 0.5
"""A first azimuth within this part of a step of a right angle is the right angle."""


@dataclass(frozen=True)
class Beside:
    """`offset_deg` (rings,) beside the column's azimuth, what the head turns until the ring fires included.

    `whole_turns`: whether they are known but for a whole turn, not only but for a step. `fire_us` (rings,) after the
    column's start, None without times. `first_deg`: where column 0 of the first frame looks; `phase_deg` (frames,).
    `residual_deg` (rings,): the median distance of a ring's rows from their columns, NaN without columns.
    """

    offset_deg: FloatArray
    whole_turns: bool
    fire_us: FloatArray | None
    first_deg: float
    phase_deg: FloatArray
    residual_deg: FloatArray


def beside_columns(rows: Labelled, step: Steps | None, sense: int, turning: Turning | None) -> Beside:
    """What the rings look beside their columns: by the file's columns, by times, by the order of firing, or modulo."""
    count = int(rows.ring.max()) + 1
    if step is None:
        none = np.full(count, np.nan)
        return Beside(np.zeros(count), False, None, 0.0, np.zeros(rows.frames), none)
    signed = step.step_deg * (sense or 1)
    azimuth, fire = rows.azimuth_deg, None
    column = None if rows.point is None else rows.point.astype(np.float64)
    if column is None and turning is not None:
        fire, column = _fired(rows, abs(step.step_deg / turning.deg_per_s), turning)
    whole = column is not None
    period = 360.0 if whole else step.step_deg
    start = np.zeros(count)
    if not whole and rows.by_firing and count > 1:
        start, whole = _by_order(rows, azimuth, count, signed), True
    value = azimuth - (0.0 if column is None else column * signed) - start[rows.ring]
    rest, phase, off = _settled(rows, value, count, period)
    offset = start + rest
    middle = circular_median(offset, 360.0 if whole else period)
    first, beside = phase[0] + middle, offset - middle
    if column is None:
        # Any column may be column 0; of numbered ones it is the file's own.
        first %= step.step_deg
    else:
        snapped = 90.0 * round(first / 90.0)
        snapped = snapped if step.whole and abs(first - snapped) <= _SNAP * step.step_deg else first
        beside, first = beside + first - snapped, snapped
    offset = (beside + 180.0) % 360.0 - 180.0
    residual = np.array([float(np.median(np.abs(off[rows.ring == k]))) for k in range(count)])
    return Beside(offset, whole, fire, (first + 180.0) % 360.0 - 180.0, phase, residual)


def _settled(rows: Labelled, value: FloatArray, count: int, period: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Each ring's and each frame's share of values that count modulo a period, and what is left of each row."""
    numbers = np.arange(count)
    phase = np.zeros(rows.frames)
    offset = np.zeros(count)
    for _ in range(3):
        offset = offsets(value - phase[rows.frame], rows.ring, numbers, period)
        left = value - offset[rows.ring]
        phase = np.array([circular_median(left[rows.frame == k], period) for k in range(rows.frames)])
    off = value - offset[rows.ring] - phase[rows.frame]
    # All about one middle: a ring at the period's end is not a period beside its neighbour.
    middle = circular_median(offset, period)
    offset = middle + (offset - middle + 0.5 * period) % period - 0.5 * period
    return offset, phase, (off + 0.5 * period) % period - 0.5 * period


def _fired(rows: Labelled, column_s: float, turning: Turning) -> tuple[FloatArray, FloatArray]:
    """When in the column each ring fires [us], shape (rings,), and the column of each row, shape (n,)."""
    numbers = np.arange(int(rows.ring.max()) + 1)
    start = np.zeros(rows.frames)
    fire = np.zeros(len(numbers))
    for _ in range(3):
        fire = offsets(turning.time_s - start[rows.frame], rows.ring, numbers, column_s) % column_s
        left = turning.time_s - fire[rows.ring]
        start = np.array([circular_median(left[rows.frame == k], column_s) for k in range(rows.frames)])
    # The column starts behind the longest time without a shot.
    ordered = np.sort(fire)
    gaps = np.diff(np.r_[ordered, ordered[0] + column_s])
    begin = float(ordered[(int(np.argmax(gaps)) + 1) % len(ordered)])
    fire = (fire - begin) % column_s
    fire = np.where(fire > column_s * (1.0 - 1e-3), 0.0, fire)
    column = np.rint((turning.time_s - start[rows.frame] - begin - fire[rows.ring]) / column_s)
    return 1e6 * fire, column


def _by_order(rows: Labelled, azimuth: FloatArray, count: int, step_deg: float) -> FloatArray:
    """What each ring looks beside its column [deg], of rows in the order of firing: about where those around it look.

    The rows around the last of a column are half of the next one, and so on: each ring's rank in the column counts.
    """
    width = 2 * count
    offset = np.zeros(count)
    kernel = np.ones(2 * width + 1)
    for _ in range(_ROUNDS):
        around = np.exp(1j * np.deg2rad(azimuth - offset[rows.ring]))
        head = np.angle(np.convolve(around, kernel, "same"))
        beside = (azimuth - np.rad2deg(head) + 180.0) % 360.0 - 180.0
        offset = np.array([float(np.median(beside[rows.ring == k])) for k in range(count)])
        offset = offset - np.median(offset)
    return np.asarray(offset + (_ranks(rows, count) / count - 0.5) * step_deg)


def _ranks(rows: Labelled, count: int) -> FloatArray:
    """The rank of each ring in a column, which begins with the file's first row."""
    begins = np.flatnonzero(rows.ring == rows.ring[0])
    since = np.arange(len(rows)) - begins[np.searchsorted(begins, np.arange(len(rows)), side="right") - 1]
    middle = np.array([float(np.median(since[rows.ring == k])) for k in range(count)])
    return np.asarray(np.argsort(np.argsort(middle, kind="stable"), kind="stable"), dtype=np.float64)
