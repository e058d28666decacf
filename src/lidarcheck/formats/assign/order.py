"""The beam of each row, by what is known of it, the surest first.

Layer and Point; the place in an organised cloud; ring and column; ring and time; ring and azimuth; the direction alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.assign import columns
from lidarcheck.formats.assign.nearest import nearest_channels
from lidarcheck.formats.assign.rings import channels_of, reversed_order, says_nothing
from lidarcheck.formats.geometry.head import Head, angles_of_deg

__all__ = ["Assigned", "Known", "Rows", "assign"]

Column = npt.NDArray[Any]


@dataclass(frozen=True)
class Rows:
    """What is known of one frame's echoes, columns of shape (n,), None where the file does not say it.

    `position` (n, 3) [m]; `layer`, `point`; `ring`, `column` as the file numbers them; `time_s` from the frame's start,
    NaN where a row has none; `kind`: return kind or echo number. `cell` (n,): where each row stands in an organised
    cloud of `height` x `width`.
    """

    position: FloatArray | None = None
    layer: Column | None = None
    point: Column | None = None
    ring: Column | None = None
    column: Column | None = None
    time_s: FloatArray | None = None
    kind: Column | None = None
    cell: Column | None = None
    height: int = 1
    width: int = 0

    def __len__(self) -> int:
        given = (self.position, self.layer, self.ring, self.column, self.time_s, self.cell)
        return next((len(one) for one in given if one is not None), 0)


@dataclass(frozen=True)
class Known:
    """What the sensor file says of beams and rows: `ring`, each channel's number in files, empty for its index."""

    head: Head
    ring: Sequence[int] = ()
    column_shift: npt.NDArray[Any] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    deskewed: bool = False


@dataclass(frozen=True)
class Assigned:
    """`layer`, `point` (n,) of each row, -1 for a row of no beam, and how they were found.

    `layers_told`, `points_told`: whether the file says them, so that the directions can be checked against them; those
    that were made from directions prove nothing. `phase_deg`: where column 0 looks, of columns that do not repeat.
    """

    layer: IntArray
    point: IntArray
    by: str
    layers_told: bool
    points_told: bool
    notes: tuple[str, ...] = ()
    phase_deg: float = 0.0


def assign(rows: Rows, known: Known) -> Assigned:
    """The beam of each row. `UsageError` where nothing tells them, or a ring is none of the sensor's."""
    head = known.head
    if rows.layer is not None and rows.point is not None:
        layer, point = rows.layer.astype(np.int32), rows.point.astype(np.int32)
        return Assigned(layer, point, "Layer and Point", layers_told=True, points_told=True)
    if rows.cell is not None and rows.height == head.layers and rows.width == head.points and rows.height > 1:
        return _organised(rows, known)
    layer, by, notes = _layers(rows, known)
    told = by != "direction"
    point, off, found = _points(rows, known, layer)
    lost = columns.losing_rows(layer, point, rows.kind, off)
    point = np.where(lost, -1, point).astype(np.int32)
    if lost.any():
        count = int(np.count_nonzero(lost))
        notes = (*notes, f"{count} row{'s' * (count > 1)} of beams that have another, nearer to their column")
    by = "direction alone" if not told and found.by == "azimuth" else f"{by} and {found.by}"
    return Assigned(layer, point, by, told, found.by in ("column", "time"), notes, found.phase_deg)


def _layers(rows: Rows, known: Known) -> tuple[IntArray, str, tuple[str, ...]]:
    """The channels, how they were found, and what to say."""
    head = known.head
    if rows.layer is not None:
        # Without a ring list: the channel's index.
        return channels_of(rows.layer, (), head.layers, "Layer"), "Layer", ()
    if rows.ring is not None and not says_nothing(rows.ring):
        layer = channels_of(rows.ring, known.ring, head.layers)
        if rows.position is not None:
            other = reversed_order(layer, angles_of_deg(rows.position)[0], head.elevation_deg)
            if other is not None:
                return other[layer], "ring", ("the rings count from the other end: their order was reversed",)
        return layer, "ring", ()
    if rows.position is None:
        raise UsageError(
            "nothing tells the beams of the rows", fix="give X, Y, Z, or Layer and Point, or ring and time"
        )
    return nearest_channels(head, rows.position), "direction", ()


@dataclass(frozen=True)
class _Found:
    """What the columns were found by, and the phase."""

    by: str
    phase_deg: float = 0.0


def _points(rows: Rows, known: Known, layer: IntArray) -> tuple[IntArray, FloatArray, _Found]:
    """The firing columns, how far each row lies off its column's middle, and what they were found by."""
    head, zero = known.head, np.zeros(len(layer))
    if rows.point is not None:
        return rows.point.astype(np.int32), zero, _Found("column")
    if rows.column is not None:
        inside = (rows.column >= 0) & (rows.column < head.points)
        return np.where(inside, rows.column, -1).astype(np.int32), zero, _Found("column")
    timed = rows.time_s is not None and bool(head.column_s) and bool(np.isfinite(rows.time_s).any())
    if rows.time_s is not None and timed and (not head.repeats or known.deskewed or rows.position is None):
        point, off = columns.by_time(head, rows.time_s, layer)
        phase = 0.0
        if not head.repeats and rows.position is not None:
            phase = _phase(head, rows.position, layer, point)
        return point, off, _Found("time", phase)
    if rows.position is None:
        raise UsageError("nothing tells the columns of the rows", fix="give X, Y, Z, a time, or Point")
    if known.deskewed:
        return columns.by_rank(head, rows.position, layer), zero, _Found("azimuth")
    if head.repeats:
        point, off = columns.by_azimuth(head, rows.position, layer)
        return point, off, _Found("azimuth")
    point, off, phase = columns.since_the_first(head, rows.position, layer)
    return point, off, _Found("azimuth", phase)


def _phase(head: Head, position: FloatArray, layer: IntArray, point: IntArray) -> float:
    """Where column 0 looks [deg], by the circular median of what the azimuths have beside their columns'."""
    within = point >= 0
    rest = head.columns_of(position[within], layer[within]) - point[within]
    return columns.circular_median(rest * head.step_deg, 360.0)


def _organised(rows: Rows, known: Known) -> Assigned:
    """By the place in an organised cloud: its row is the channel, its column an image's or a firing's."""
    head = known.head
    assert rows.cell is not None, "asked for"
    layer, image = (a.astype(np.int32) for a in np.divmod(rows.cell, rows.width))
    shift = known.column_shift if len(known.column_shift) else np.zeros(head.layers, dtype=np.int64)
    shift = np.asarray(shift, dtype=np.int64)
    staggered: bool | None = None
    if shift.any():
        if rows.time_s is not None and head.column_s:
            moment: FloatArray | None = (rows.time_s - head.fire_s[layer]) / head.column_s
        else:
            moment = None if rows.position is None else _beside(head, rows.position, layer, image)
        if moment is not None:
            staggered = columns.is_staggered(image, layer, moment, shift, rows.width)
        if staggered is None:
            fix = "give the file its times or X, Y, Z, or Layer and Point"
            raise UsageError("nothing tells whether the organised cloud is staggered", fix=fix)
    point = columns.firing_column(image, layer, shift, rows.width) if staggered is False else image
    notes = () if staggered is not False else ("the cloud is an image: its columns were turned into firing columns",)
    return Assigned(layer, point, "place in the organised cloud", layers_told=True, points_told=True, notes=notes)


def _beside(head: Head, position: FloatArray, layer: IntArray, image: IntArray) -> FloatArray:
    """The head's angle in columns beside the image's column: of a turn around, so that none is torn apart."""
    turn = head.turn_columns
    beside = head.columns_of(position, layer) - image
    middle = columns.circular_median(beside[np.isfinite(beside)], turn) if len(beside) else 0.0
    return np.asarray((beside - middle + 0.5 * turn) % turn - 0.5 * turn + image)
