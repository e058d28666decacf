"""The firing column of a row, where its channel is known: by azimuth or time; where columns repeat and where not."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IntArray
from lidarcheck.formats.geometry.head import Head

__all__ = [
    "by_azimuth",
    "by_rank",
    "by_time",
    "circular_median",
    "firing_column",
    "is_staggered",
    "losing_rows",
    "since_the_first",
]

_FEWEST = 3
"""Rows of an image's column that tell whether they were fired together."""
_BEFORE = 0.5
"""Columns by which a row may lie before the first one: a turn later, the frame's last stands hardly farther off."""
_ONE_RAY = 0.02
"""Rows of one beam that lie so near to each other, in columns, are returns of one shot."""


def by_azimuth(head: Head, position: FloatArray, layer: IntArray) -> tuple[IntArray, FloatArray]:
    """The column of each row where columns repeat, and how far it lies off the column's middle; shape (n,) each.

    -1 outside the frame's columns; the distance is in columns.
    """
    return _rounded(head, head.columns_of(position, layer))


def since_the_first(head: Head, position: FloatArray, layer: IntArray) -> tuple[IntArray, FloatArray, float]:
    """The same where columns do not repeat: counted from the frame's first; and where that looks [deg], its phase.

    The first column is the earliest one that any channel's first row lies in; the rest of a step that all rows share
    is the phase, by circular median.
    """
    raw = head.columns_of(position, layer)
    turn = head.turn_columns
    _, first = np.unique(layer, return_index=True)
    starts = _wrap(raw[first] - raw[first.min()], turn)
    earliest = float(raw[first.min()] + starts.min())
    # A row may lie a little before the column that was seen first, and yet in the same turn.
    since = (raw - earliest + _BEFORE) % turn - _BEFORE
    rest = circular_median(since, 1.0)
    column = np.rint(since - rest)
    before = float(column.min())
    phase = (earliest + rest + before) * head.step_deg % 360.0
    return _within(column - before, head.points), since - rest - column, phase


def by_time(head: Head, time_s: FloatArray, layer: IntArray) -> tuple[IntArray, FloatArray]:
    """The column of each row by its time [s from the frame's start], and how far that lies off the column's middle.

    Without a time, or where all columns are fired at once, -1.
    """
    if not head.column_s:
        return np.full(len(layer), -1, dtype=np.int32), np.zeros(len(layer))
    column = (time_s - head.fire_s[layer]) / head.column_s
    known = np.isfinite(column)
    at, off = _rounded(head, np.where(known, column, 0.0), closed=False)
    return np.where(known, at, -1).astype(np.int32), off


def by_rank(head: Head, position: FloatArray, layer: IntArray) -> IntArray:
    """The column of each row of a deskewed cloud: its rank by azimuth in its channel, spread over the azimuths."""
    column = np.rint(head.columns_of(position, layer)).astype(np.int64)
    order = np.lexsort((column, layer))
    # No two rows of a channel are one column: a later one moves on to the next that is free.
    place = np.arange(len(order)) - layer[order].astype(np.int64) * (len(order) + 4 * head.points)
    fixed = np.maximum.accumulate(column[order] - place) + place
    ranked = np.empty_like(fixed)
    ranked[order] = fixed
    return _within(ranked, head.points)


def is_staggered(
    image_column: IntArray, layer: IntArray, moment: FloatArray, shift: npt.NDArray[Any], columns: int
) -> bool | None:
    """Whether an organised cloud's columns are firing columns (staggered), and not an image's; None where both fit.

    `moment`, shape (n,): what rows that fire together share, the time or the head's angle in columns; `shift`: each
    channel's `column_shift`. The smaller of the two spreads within a column says it.
    """
    image = firing_column(image_column, layer, shift, columns)
    as_it_is, moved = (_spread(moment, column) for column in (image_column, image))
    if as_it_is == moved or not np.isfinite(as_it_is + moved):
        return None
    return as_it_is < moved


def firing_column(image_column: IntArray, layer: IntArray, shift: npt.NDArray[Any], columns: int) -> IntArray:
    """The firing column of an image's column: the image's is (firing + shift) mod columns."""
    return np.asarray((image_column - shift[layer]) % columns, dtype=np.int32)


def losing_rows(layer: IntArray, point: IntArray, kind: npt.NDArray[Any] | None, off: FloatArray) -> BoolArray:
    """Of rows of one beam and the same return kind, those that are not the nearest to the column's middle; shape (n,).

    `kind`: None where no column tells returns apart; then rows that lie at one place of the column are of one shot.
    """
    keys = [np.abs(off), *([] if kind is None else [kind]), point, layer]
    order = np.lexsort(keys)
    again = np.ones(len(order), dtype=np.bool_)
    for column in keys[1:]:
        again[1:] &= column[order][1:] == column[order][:-1]
    again[:1] = False
    if kind is None:
        # Of the nearest row of each beam.
        nearest = order[np.maximum.accumulate(np.where(again, 0, np.arange(len(order))))]
        again &= np.abs(off[order] - off[nearest]) > _ONE_RAY
    lost = np.zeros(len(layer), dtype=np.bool_)
    lost[order] = again & (point[order] >= 0)
    return lost


def circular_median(values: FloatArray, period: float) -> float:
    """A median of values that count modulo a period: about the middle of their directions; in ± half the period."""
    angle = values * (2.0 * np.pi / period)
    middle = float(np.angle(np.mean(np.exp(1j * angle)))) * period / (2.0 * np.pi)
    return float(_wrap(middle + float(np.median(_wrap(values - middle, period))), period))


def _rounded(head: Head, column: FloatArray, *, closed: bool = True) -> tuple[IntArray, FloatArray]:
    at = np.rint(column)
    off = column - at
    return _within(at % head.points if closed and head.closed else at, head.points), off


def _within(column: npt.NDArray[Any], points: int) -> IntArray:
    return np.where((column >= 0) & (column < points), column, -1).astype(np.int32)


def _spread(moment: FloatArray, column: IntArray) -> float:
    """The median over an image's columns of how far their rows' moments lie apart."""
    known = np.isfinite(moment)
    order = np.lexsort((moment[known], column[known]))
    values = moment[known][order]
    _, start, counts = np.unique(column[known][order], return_index=True, return_counts=True)
    enough = counts >= _FEWEST
    if not enough.any():
        return float("nan")
    first, last = start[enough], start[enough] + counts[enough] - 1
    return float(np.median(values[last] - values[first]))


def _wrap(values: Any, period: float) -> Any:
    return (values + 0.5 * period) % period - 0.5 * period
