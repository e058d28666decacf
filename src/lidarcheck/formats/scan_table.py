"""The columns that a scan is written as."""

from __future__ import annotations

import numpy as np

from lidarcheck.beams import Fired
from lidarcheck.errors import UsageError
from lidarcheck.formats.columns import INT32_MAX, real_column, whole_column, with_extra
from lidarcheck.formats.returns import no_returns
from lidarcheck.formats.scans import FEATURES, SCAN_COLUMNS, positions_of
from lidarcheck.formats.sensor_columns import histogram_columns, right_handed
from lidarcheck.formats.table import Column, Table
from lidarcheck.formats.times import frame_of
from lidarcheck.scan import Scan, beams_of
from lidarcheck.sensor import Sensor

__all__ = ["table_from_scan"]


def table_from_scan(scan: Scan, sensor: Sensor | None = None) -> Table:
    """The columns to write: those that were not defaulted, then the extra ones; beams without echo follow, X Y Z 0.

    Beams outside the field of view are left for the reader to find again from X, Y, Z. `UsageError` when an extra
    column has a standard name, or a beam is unknown though its position would give it one; `InputError` when a value is
    not one that a file may hold.
    """
    left_out = set(scan.defaulted) - {"X", "Y", "Z"} | _beams_told_by_position(scan)
    columns: dict[str, Column] = {
        name: getattr(scan, field) for name, field in SCAN_COLUMNS.items() if name not in left_out
    }
    if not scan.beams.central and not left_out & {"Layer", "Point"} and "RANGE" not in scan.extra:
        columns["RANGE"] = scan.range_m
    table = Table(with_extra({**columns, **scan.features}, scan.extra, [*SCAN_COLUMNS, *scan.features]))
    empty = no_returns(table)
    if empty is not None:
        what = "X, Y, Z are 0 or not finite, or RANGE is 0: so a file says that a beam had no echo"
        raise table.fault(what, row=int(np.argmax(empty)), fix="take the row out")
    positions_of(table, beams=scan.beams)
    for name in FEATURES:
        if name in columns:
            real_column(table, name)
    for name, low in (("Layer", 0), ("Point", 0), ("EchoNumber", 1)):
        if name in columns:
            whole_column(table, name, low, INT32_MAX)
    if scan.fired is not None and not left_out & {"Layer", "Point"}:
        table = _with_empty_rows(table, scan, scan.fired)
    return _as_the_sensor_writes(table, scan, sensor)


def _as_the_sensor_writes(table: Table, scan: Scan, sensor: Sensor | None) -> Table:
    """The table with each beam's histogram, the copies of single echoes, and Y in the hand of the sensor's files."""
    if sensor is not None and sensor.duplicate_return == "repeat":
        table = _with_copies(table)
    if scan.histograms is not None:
        layer, point = table.columns["Layer"], table.columns["Point"]
        table = Table({**table.columns, **histogram_columns(scan.histograms, layer, point)})
    return right_handed(table, sensor)


def _with_copies(table: Table) -> Table:
    """A second row, with the number 2, behind the only echo of a beam."""
    key = table.columns["Layer"].astype(np.int64) << 32 | table.columns["Point"].astype(np.int64)
    _, beam, rows = np.unique(key, return_inverse=True, return_counts=True)
    empty = no_returns(table)
    alone = rows[beam] == 1
    if empty is not None:
        alone &= ~empty
    twice = np.repeat(np.arange(len(key)), 1 + alone)
    copy = np.concatenate([[False], twice[1:] == twice[:-1]])
    columns = {name: column[twice] for name, column in table.columns.items()}
    columns["EchoNumber"] = np.where(copy, 2, columns["EchoNumber"]).astype(columns["EchoNumber"].dtype)
    return Table(columns)


def _with_empty_rows(table: Table, scan: Scan, fired: Fired) -> Table:
    """The table and a row for each fired beam without an echo: X, Y, Z 0, EchoNumber 1, no other value."""
    frame = frame_of(scan.extra)
    keys = [rows.layer.astype(np.int64) << 32 | rows.point for rows in (fired, scan)]
    frames = [np.zeros(len(key)) for key in keys] if frame is None or fired.frame is None else [fired.frame, frame]
    both = np.stack([np.concatenate(frames).astype(np.int64), np.concatenate(keys)])
    row = np.unique(both, axis=1, return_inverse=True)[1]
    silent = np.flatnonzero(~np.isin(row[: len(fired)], row[len(fired) :]))
    told: dict[str, Column] = {"Layer": fired.layer, "Point": fired.point, "EchoNumber": np.ones(len(fired))}
    columns = {}
    for name, column in table.columns.items():
        nothing = np.nan if column.dtype.kind == "f" and name not in SCAN_COLUMNS else 0
        added: Column = told.get(name, np.full(len(fired), nothing))
        if column is frame and fired.frame is not None:
            added = fired.frame
        columns[name] = np.concatenate([column, added[silent].astype(column.dtype)])
    return Table(columns)


def _beams_told_by_position(scan: Scan) -> set[str]:
    """Which of Layer and Point hold -1, which no file may, but a reader gives to the same positions."""
    unknown = {
        name
        for name, column in (("Layer", scan.layer), ("Point", scan.point))
        if name not in scan.defaulted and (column == -1).any()
    }
    if unknown:
        layer, point = beams_of(scan.x_m, scan.y_m, scan.z_m, scan.beams)
        differs = np.zeros(len(scan), dtype=np.bool_)
        for name, told, own in (("Layer", layer, scan.layer), ("Point", point, scan.point)):
            differs |= (told != own) & (name in unknown)
        if differs.any():
            row = int(np.flatnonzero(differs)[0])
            what = f"row {row + 1} has layer {scan.layer[row]}, point {scan.point[row]}, not the beam of its position"
            raise UsageError(what, fix="a file cannot hold unknown beams beside known ones; give every echo its beam")
    return unknown
