"""An ideal scan's columns in a file, and what stands in for those that it lacks."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.columns import (
    INT32_MAX,
    INT32_MIN,
    LENGTH_MAX_M,
    check_finite,
    extra_columns,
    found_columns,
    missing,
    real_column,
    whole_column,
    with_extra,
)
from lidarcheck.formats.table import Column, Table
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import LAYERS, POINTS

__all__ = ["IDEAL_COLUMNS", "ideal_from_table", "is_ideal", "table_from_ideal"]

IDEAL_COLUMNS = {
    "Layer": "layer",
    "Point": "point",
    "Distance": "distance_m",
    "MaterialID": "material_id",
    "IncidenceAngle": "incidence_deg",
    "ObjectID": "object_id",
    "Time": "time_s",
    "Share": "share",
}
"""A file's name of each field of an `IdealScan`, in the order that files are written in."""

_NEEDED = ("Layer", "Point", "Distance", "MaterialID")
_WHOLE = {
    "Layer": (0, LAYERS - 1),
    "Point": (0, POINTS - 1),
    "MaterialID": (0, INT32_MAX),  # model files name materials by whole numbers from 0
    "ObjectID": (INT32_MIN, INT32_MAX),
}
_REAL = {
    "Distance": (0.0, LENGTH_MAX_M, "m (0: nothing within range)"),
    "Time": (-np.inf, np.inf, "s"),
    "Share": (0.0, 1.0, "(part of the beam's light)"),
}
_log = logging.getLogger(__name__)


def is_ideal(table: Table) -> bool:
    """Whether the columns are those of an ideal scan: Layer, Point, Distance, and not echoes that also have these."""
    if missing(table, ["Layer", "Point", "Distance"]):
        return False
    return not missing(table, ["MaterialID"]) or bool(missing(table, ["X", "Y", "Z"]))


def ideal_from_table(table: Table) -> IdealScan:
    """What each beam meets, as a table's columns describe it.

    Needed are Layer, Point, Distance and MaterialID; a missing IncidenceAngle is logged and 0; unknown columns become
    `extra`. `InputError` when a column is missing or holds what it must not.
    """
    _check_needed(table)
    check_finite(table)
    columns = _checked(table)
    defaulted: tuple[str, ...] = ()
    if "incidence_deg" not in columns:
        defaulted = ("IncidenceAngle",)
        columns["incidence_deg"] = np.zeros(len(table))
        _log.warning("%s: missing columns were filled in: IncidenceAngle is 0", table.path)
    source = str(table.path or "")
    return IdealScan(**columns, extra=extra_columns(table, IDEAL_COLUMNS), defaulted=defaulted, file=source)


def table_from_ideal(ideal: IdealScan) -> Table:
    """The columns to write: those that are there and not defaulted, then the extra ones.

    `UsageError` when an extra column has a standard name, `InputError` when a value is not one that a file may hold.
    """
    columns: dict[str, Column] = {}
    for name, field in IDEAL_COLUMNS.items():
        column = getattr(ideal, field)
        if column is not None and name not in ideal.defaulted:
            columns[name] = column
    table = Table(with_extra(columns, ideal.extra, IDEAL_COLUMNS))
    check_finite(table)
    _checked(table)
    return table


def _checked(table: Table) -> dict[str, Any]:
    """The fields of an `IdealScan` that the table has columns for, within the limits of each."""
    fields: dict[str, Any] = {}
    for name, (low, high) in _WHOLE.items():
        if table.spelling(name):
            fields[IDEAL_COLUMNS[name]] = whole_column(table, name, low, high)
    for name, (least, most, unit) in _REAL.items():
        if table.spelling(name):
            fields[IDEAL_COLUMNS[name]] = real_column(table, name, least, most, unit)
    if table.spelling("IncidenceAngle"):
        # What a beam that meets nothing would meet at which angle means nothing; simulators write anything there.
        meets = fields["distance_m"] > 0.0 if "distance_m" in fields else None
        fields["incidence_deg"] = real_column(table, "IncidenceAngle", 0.0, 90.0, "degrees", where=meets)
    return fields


def _check_needed(table: Table) -> None:
    lacking = missing(table, _NEEDED)
    if not lacking:
        return
    what = f"no column {', '.join(lacking)}{found_columns(table)}"
    if "Distance" in lacking and not missing(table, ["X", "Y", "Z"]):
        what = f"this holds echoes, not an ideal scan: {what}"
    line = None if table.layout is None else 1
    fix = "an ideal scan needs Layer, Point, Distance, MaterialID"
    raise InputError(what, file=table.path, line=line, fix=fix)
