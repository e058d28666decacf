"""A scan's columns in a file, and what stands in for those that it lacks."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.columns import (
    INT32_MAX,
    LENGTH_MAX_M,
    check_finite,
    extra_columns,
    found_columns,
    missing,
    real_column,
    whole_column,
    with_extra,
)
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.geometry.reader import checked_geometry
from lidarcheck.formats.table import Column, Table
from lidarcheck.scan import Scan, beams_of
from lidarcheck.sensor import LAYERS, POINTS, beam_directions

__all__ = ["SCAN_COLUMNS", "normalised_scan", "scan_from_table", "table_from_scan"]

SCAN_COLUMNS = {
    "X": "x_m",
    "Y": "y_m",
    "Z": "z_m",
    "PEAK": "peak",
    "AREA": "area",
    "WIDTH": "width_ns",
    "EchoNumber": "echo_number",
    "Layer": "layer",
    "Point": "point",
}
"""A file's name of each field of a `Scan`, in the order that files are written in."""

_ONLY_IDEAL = ("Distance", "MaterialID", "IncidenceAngle")
_FEATURES = ("WIDTH", "AREA", "PEAK")
_log = logging.getLogger(__name__)


def scan_from_table(table: Table, placement: Placement = AS_IT_IS) -> Scan:
    """The echoes that a table's columns describe, once X, Y, Z are placed as declared and agree with their beams.

    Needed are X, Y, Z, or Layer, Point, RANGE of the reference grid. Other missing columns are logged and defaulted:
    Layer and Point to the nearest beam (-1 outside the field of view), EchoNumber to 1, the features to 0. Numbers of
    echoes that begin at 0 are raised by 1. Unknown columns, and RANGE beside X, Y, Z, become `extra`. `InputError` when
    the columns do not suffice or hold what they must not.
    """
    _check_position(table)
    table, as_read = placement.applied(normalised_scan(table)), table
    x_m, y_m, z_m = _positions(table)
    layer, point = _beams(table, x_m, y_m, z_m)
    width_ns, area, peak = (_column_or(table, name, 0.0) for name in _FEATURES)
    known = [*SCAN_COLUMNS, "RANGE"] if missing(table, ["X", "Y", "Z"]) else SCAN_COLUMNS
    scan = Scan(
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        layer=layer,
        point=point,
        echo_number=_echo_numbers(table),
        width_ns=width_ns,
        area=area,
        peak=peak,
        extra=extra_columns(table, known),
        defaulted=_log_defaults(table, int(np.count_nonzero((layer < 0) | (point < 0)))),
    )
    return replace(scan, geometry=checked_geometry(scan, as_read, placement))


def normalised_scan(table: Table) -> Table:
    """The same columns with echoes numbered from 1; logs where they were numbered from 0."""
    check_finite(table)
    numbers = table.get("EchoNumber")
    if numbers is None or not len(numbers) or numbers.min() != 0:
        return table
    _log.warning("%s: EchoNumber starts at 0 and was raised by 1", table.path)
    return table.with_column("EchoNumber", whole_column(table, "EchoNumber", 0, INT32_MAX - 1) + np.int32(1))


def table_from_scan(scan: Scan) -> Table:
    """The columns to write: those that were not defaulted, then the extra ones.

    Beams outside the field of view are left for the reader to find again from X, Y, Z. `UsageError` when an extra
    column has a standard name, or a beam is unknown though its position would give it one; `InputError` when a value is
    not one that a file may hold.
    """
    left_out = set(scan.defaulted) - {"X", "Y", "Z"} | _beams_told_by_position(scan)
    columns: dict[str, Column] = {
        name: getattr(scan, field) for name, field in SCAN_COLUMNS.items() if name not in left_out
    }
    table = Table(with_extra(columns, scan.extra, SCAN_COLUMNS))
    check_finite(table)
    _positions(table)
    for name, low in (("Layer", 0), ("Point", 0), ("EchoNumber", 1)):
        if name in columns:
            whole_column(table, name, low, INT32_MAX)
    return table


def _beams_told_by_position(scan: Scan) -> set[str]:
    """Which of Layer and Point hold -1, which no file may, but a reader gives to the same positions."""
    unknown = {
        name
        for name, column in (("Layer", scan.layer), ("Point", scan.point))
        if name not in scan.defaulted and (column == -1).any()
    }
    if unknown:
        layer, point = beams_of(scan.x_m, scan.y_m, scan.z_m)
        differs = np.zeros(len(scan), dtype=np.bool_)
        for name, told, own in (("Layer", layer, scan.layer), ("Point", point, scan.point)):
            differs |= (told != own) & (name in unknown)
        if differs.any():
            row = int(np.flatnonzero(differs)[0])
            what = f"row {row + 1} has layer {scan.layer[row]}, point {scan.point[row]}, not the beam of its position"
            raise UsageError(what, fix="a file cannot hold unknown beams beside known ones; give every echo its beam")
    return unknown


def _check_position(table: Table) -> None:
    from_position, from_range = missing(table, ["X", "Y", "Z"]), missing(table, ["Layer", "Point", "RANGE"])
    if from_position and from_range:
        what = f"no column {', '.join(from_position)}, nor {', '.join(from_range)} in their place{found_columns(table)}"
        if not missing(table, ["Layer", "Point", "Distance"]):
            raise InputError(f"this is an ideal scan, not echoes: {what}", file=table.path, fix="simulate it first")
        line = None if table.layout is None else 1
        lacking = missing(table, ["Layer", "Point", "Distance", "MaterialID"])
        ideal = len(missing(table, _ONLY_IDEAL)) < len(_ONLY_IDEAL)
        if ideal and len(from_position) == 3:
            what = f"this looks like an ideal scan without {', '.join(lacking)}{found_columns(table)}"
            fix = "an ideal scan needs Layer, Point, Distance, MaterialID"
            raise InputError(what, file=table.path, line=line, fix=fix)
        raise InputError(what, file=table.path, line=line, fix="a scan needs X, Y, Z, or Layer, Point, RANGE")


def _positions(table: Table) -> tuple[Column, Column, Column]:
    if not missing(table, ["X", "Y", "Z"]):
        x_m, y_m, z_m = (real_column(table, name, -LENGTH_MAX_M, LENGTH_MAX_M, "m") for name in ("X", "Y", "Z"))
        return x_m, y_m, z_m
    layer = whole_column(table, "Layer", 0, LAYERS - 1)
    point = whole_column(table, "Point", 0, POINTS - 1)
    xyz = beam_directions(layer, point) * real_column(table, "RANGE", 0.0, LENGTH_MAX_M, "m")[:, None]
    return xyz[:, 0], xyz[:, 1], xyz[:, 2]


def _beams(table: Table, x_m: Column, y_m: Column, z_m: Column) -> tuple[Column, Column]:
    """Layer and Point, the missing ones from the positions."""
    given = [name for name in ("Layer", "Point") if table.spelling(name)]
    columns = {name: whole_column(table, name, 0, INT32_MAX) for name in given}
    if len(given) < 2:
        layer, point = beams_of(x_m, y_m, z_m)
        columns = {"Layer": layer, "Point": point, **columns}
    return columns["Layer"], columns["Point"]


def _echo_numbers(table: Table) -> Column:
    if missing(table, ["EchoNumber"]):
        return np.ones(len(table), dtype=np.int32)
    return whole_column(table, "EchoNumber", 1, INT32_MAX)


def _column_or(table: Table, name: str, value: float) -> Column:
    return np.full(len(table), value) if missing(table, [name]) else real_column(table, name)


def _log_defaults(table: Table, unseen: int) -> tuple[str, ...]:
    """The standard columns that are missing and not made from RANGE; one line of log says what stands in."""
    beams = missing(table, ["Layer", "Point"])
    echo = missing(table, ["EchoNumber"])
    features = missing(table, _FEATURES)
    said = []
    if missing(table, ["X", "Y", "Z"]):
        said.append("X, Y, Z from Layer, Point, RANGE")
    if beams:
        outside = f" ({unseen} of {len(table)} outside the field of view)" if unseen else ""
        said.append(f"{', '.join(beams)} from X, Y, Z{outside}")
    if echo:
        said.append("EchoNumber is 1")
    if features:
        said.append(f"{', '.join(features)} {'is' if len(features) == 1 else 'are'} 0")
    if said:
        _log.warning("%s: missing columns were filled in: %s", table.path, "; ".join(said))
    return (*beams, *echo, *features)
