"""A scan or ideal scan from one file format into another."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarcheck.arrays import BoolArray
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.columns import missing
from lidarcheck.formats.describe import FileDescription, describe
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.ideals import ideal_from_table, is_ideal
from lidarcheck.formats.recognise import read_table, recognise, target_format
from lidarcheck.formats.returns import no_returns
from lidarcheck.formats.scans import positions_of, read_scan
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic
from lidarcheck.formats.sensor_columns import right_handed
from lidarcheck.formats.table import Table
from lidarcheck.formats.times import TimeUnit, clock_of, seconds
from lidarcheck.sensor import Sensor

__all__ = ["STREAMED", "FileDescription", "convert", "converted", "describe"]

STREAMED = ("mcap", "rosbag", "osi")
"""Formats that are written a frame at a time alone (`formats.field.write`)."""

_WHOLE = ("Layer", "Point", "EchoNumber", "MaterialID", "ObjectID")
_TIME_AS_WRITTEN = "TimeRaw"
_NEEDS_POSITION = ("las", "ply", "pcd", *STREAMED)
_NO_POSITION = {"las": 0.0, "pcd": np.nan, **dict.fromkeys(STREAMED, np.nan)}
"""What a format has in X, Y and Z of a row without a return; the others keep what the row says."""


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    placement: Placement = AS_IT_IS,
    *,
    drop_empty: bool = False,
    time_unit: TimeUnit | None = None,
    sensor: Sensor | None = None,
) -> None:
    """Write the file `source` as `target`, in the format of the target's suffix.

    All columns are kept with their names, order and values, the numbers of echoes as they are written; only hits of a
    semantic LiDAR become an ideal scan, and X, Y, Z of a scan are placed as declared. From text to text (or CSV to CSV)
    every other byte stays as it was. Rows without a return stay such, as the target's format has them; `drop_empty`
    leaves them out. `time_unit`: the unit of the time column, which makes a column `Time` [s from the frame's start]
    beside it; a column of that name becomes `TimeRaw`. `sensor`: what measured, a built-in one where None;
    its hand is that of both files.

    `UsageError` for a suffix that cannot be written, when `target` is `source`, or for a `time_unit` without a time;
    `InputError` for what is wrong with the file. Nothing is written then.
    """
    form = target_format(target)
    if Path(target).exists() and Path(source).exists() and Path(target).samefile(source):
        raise UsageError(f"{target} would be overwritten by its own conversion", fix="name another file to write")
    same = recognise(source) == form.name
    form.write(converted(read_table(source), form.name, placement, drop_empty, time_unit, sensor, same=same), target)


def converted(
    table: Table,
    form: str,
    placement: Placement = AS_IT_IS,
    drop_empty: bool = False,
    time_unit: TimeUnit | None = None,
    sensor: Sensor | None = None,
    *,
    same: bool = False,
) -> Table:
    """The columns of a scan or ideal scan as they are written in a format, by its name; see `convert`.

    `same`: the table was read from that format. `InputError` for what is wrong with it.
    """
    scan = _checked(table, placement, sensor)
    columns = table if scan else ideal_table(table, sensor) if is_semantic(table) else table
    if time_unit is not None:
        columns = _with_time(columns, time_unit)
    empty = no_returns(columns) if scan else None
    if empty is not None and drop_empty:
        columns, empty = replace(columns.take(np.flatnonzero(~empty)), origin=None, first_line=None), None
    if scan and placement.moves:
        columns = right_handed(_placed(right_handed(columns, sensor), placement, empty), sensor)
    if scan and form in _NEEDS_POSITION:
        columns = _with_positions(columns, form, empty, sensor, same=same)
    if not scan and form in STREAMED:
        what = "is an ideal scan, and the format holds points alone"
        raise InputError(what, file=table.path, fix="write it as text, CSV or Parquet")
    return _whole_numbers(columns)


def _checked(table: Table, placement: Placement, sensor: Sensor | None) -> bool:
    """Whether the columns are a scan, once they are known to be one or an ideal scan."""
    if not is_semantic(table) and not is_ideal(table):
        read_scan(table, placement, sensor=sensor)
        return True
    if placement.moves:
        what = "is an ideal scan, whose beams have no mirror, unit or pose to declare"
        raise InputError(what, file=table.path, fix="leave --mirror, --unit and --pose out")
    if is_ideal(table):
        ideal_from_table(table, sensor)
    return False


def _placed(table: Table, placement: Placement, empty: BoolArray | None) -> Table:
    """The table with its echoes placed as declared; a row without a return has no place."""
    if empty is None or not placement.moves:
        return placement.applied(table)
    echoes = np.flatnonzero(~empty)
    for name, moved in placement.applied(table.take(echoes)).columns.items():
        column = table.columns[name].astype(np.result_type(table.columns[name], moved))
        column[echoes] = moved
        table = table.with_column(name, column)
    return table


def _with_time(table: Table, unit: TimeUnit) -> Table:
    clock = clock_of(table.columns, unit)
    if clock is None:
        raise UsageError("the file has no time whose unit could be given", file=table.path)
    found = seconds(table.columns, clock)
    own = table.spelling("Time")
    if own is not None:  # names differ in more than case
        renamed = {_TIME_AS_WRITTEN if name == own else name: column for name, column in table.columns.items()}
        table = replace(table, columns=renamed, layout=None, edited=frozenset())
    return table.with_column("Time", found)


def _whole_numbers(table: Table) -> Table:
    """Whole numbers as such, which text may spell as 331.000000."""
    for name in _WHOLE:
        column = table.get(name)
        if column is not None and column.dtype.kind == "f" and np.isfinite(column).all():
            table = table.with_column(name, column.astype(np.int32))
    return table


def _with_positions(table: Table, form: str, empty: BoolArray | None, sensor: Sensor | None, *, same: bool) -> Table:
    """A position where a point must have one, and none, as the format says that, where there was no return."""
    lacking = bool(missing(table, ["X", "Y", "Z"]))
    if not lacking and (empty is None or same or form not in _NO_POSITION):
        return table
    nothing = _NO_POSITION.get(form, 0.0)
    if lacking:
        xyz = positions_of(table, empty, None if sensor is None else sensor.beams)
    else:
        xyz = tuple(table.columns[table.spelling(name) or name] for name in "XYZ")  # type: ignore[assignment]
    for name, column in zip("XYZ", xyz, strict=True):
        if empty is not None and (column.dtype.kind == "f" or not np.isnan(nothing)):
            column = np.where(empty, column.dtype.type(nothing), column)
        table = table.with_column(name, column)
    return right_handed(table, sensor) if lacking else table
