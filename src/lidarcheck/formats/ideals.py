"""An ideal scan's columns in a file, and what stands in for those that it lacks."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IntArray
from lidarcheck.errors import InputError
from lidarcheck.formats.columns import (
    INT32_MAX,
    INT32_MIN,
    LENGTH_MAX_M,
    extra_columns,
    found_columns,
    missing,
    real_column,
    whole_column,
    with_extra,
)
from lidarcheck.formats.table import Column, Table
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import RETRO_GAIN_MAX, Beams, Sensor, reference_beams
from lidarcheck.sensor.beam_table import TableBeams

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
    "Layer": (0, INT32_MAX),
    "Point": (0, INT32_MAX),
    "MaterialID": (0, INT32_MAX),  # model files name materials by whole numbers from 0
    "ObjectID": (INT32_MIN, INT32_MAX),
}
_REAL = {
    "Time": (-np.inf, np.inf, "s"),
    "Share": (0.0, np.inf, "(part of the beam's light)"),
}
_OPTIONAL = {
    "Reflectance": (0.0, RETRO_GAIN_MAX, ""),
    "ReflectanceError": (0.0, np.inf, ""),
    "DistanceError": (0.0, np.inf, "m"),
    "X": (-LENGTH_MAX_M, LENGTH_MAX_M, "m"),
    "Y": (-LENGTH_MAX_M, LENGTH_MAX_M, "m"),
    "Z": (-LENGTH_MAX_M, LENGTH_MAX_M, "m"),
    "Azimuth0": (-360.0, 360.0, "degrees"),
}
"""Least, most and unit of columns of real numbers; the optional ones may have rows without a value."""
_log = logging.getLogger(__name__)


def is_ideal(table: Table) -> bool:
    """Whether the columns are those of an ideal scan: Layer, Point, Distance, and not echoes that also have these."""
    if missing(table, ["Layer", "Point", "Distance"]):
        return False
    return not missing(table, ["MaterialID"]) or bool(missing(table, ["X", "Y", "Z"]))


_BEAM, _MOST = ("Layer", "Point"), 9_999_999
"""Numbers of beams, and the largest of those that a scan itself brings."""


def ideal_from_table(table: Table, sensor: Sensor | None = None) -> IdealScan:
    """What each beam meets, as a table's columns describe it. `sensor`: whose beams they are, a built-in one's where
    None; where its columns do not repeat, `Azimuth0` or X, Y, Z say where Point 0 looks.

    Needed are Layer, Point, Distance and MaterialID; a missing IncidenceAngle is logged and 0; unknown columns become
    `extra`. `InputError` when a column is missing or holds what it must not.
    """
    _check_needed(table)
    beams = reference_beams() if sensor is None else sensor.beams
    columns = _checked(table, beams)
    defaulted: tuple[str, ...] = ()
    if "incidence_deg" not in columns:
        defaulted = ("IncidenceAngle",)
        columns["incidence_deg"] = np.zeros(len(table))
        _log.warning("%s: missing columns were filled in: IncidenceAngle is 0", table.path)
    source = str(table.path or "")
    extra = extra_columns(table, IDEAL_COLUMNS)
    return IdealScan(**columns, extra=extra, defaulted=defaulted, file=source, beams=_of_frame(beams, columns, table))


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
    _checked(table, ideal.beams)
    return table


def _checked(table: Table, beams: Beams) -> dict[str, Any]:
    """The fields of an `IdealScan` that the table has columns for, within the limits of each.

    What a beam meets at which angle means nothing where it meets nothing or nobody knows; simulators write anything.
    """
    limits = 0.0, LENGTH_MAX_M, "m (0: nothing within range, nan: not known)"
    distance = real_column(table, "Distance", *limits, missing_ok=True)
    fields: dict[str, Any] = {"distance_m": distance}
    met = None if distance.size and distance.min() > 0.0 else distance > 0.0
    for name, (low, high) in _WHOLE.items():
        if table.spelling(name):
            own = (
                {"Layer": beams.layers - 1, "Point": beams.points - 1} if beams.lattice else dict.fromkeys(_BEAM, _MOST)
            )
            last = own.get(name)
            where = None if last is not None else _there(table, name, met)
            fields[IDEAL_COLUMNS[name]] = whole_column(table, name, low, high if last is None else last, where=where)
    for name, (least, most, unit) in _REAL.items():
        if table.spelling(name):
            column = real_column(table, name, least, most, unit, where=_there(table, name, met))
            fields[IDEAL_COLUMNS[name]] = np.nan_to_num(column, copy=False) if met is not None else column
    for name, (least, most, unit) in _OPTIONAL.items():
        if table.spelling(name):
            real_column(table, name, least, most, unit, missing_ok=True)
    if table.spelling("Edge"):
        whole_column(table, "Edge", 0, 1, where=_there(table, "Edge", met))
    if table.spelling("IncidenceAngle"):
        angle = real_column(table, "IncidenceAngle", 0.0, 90.0, "degrees", where=met)
        fields["incidence_deg"] = np.nan_to_num(angle, copy=False) if met is not None else angle
    return fields


def _of_frame(beams: Beams, columns: dict[str, Any], table: Table) -> Beams:
    """The beams as this frame fires them."""
    layer, point = columns["layer"], columns["point"]
    if not beams.lattice:
        return _of_rays(beams, layer, point, table)
    if beams.repeats:
        return beams
    azimuth = table.get("Azimuth0")
    if azimuth is not None and np.isfinite(azimuth).any():
        first = float(azimuth[np.isfinite(azimuth)][0])
        return beams.with_phase(first - beams.with_phase(0.0).first_azimuth_deg)
    xyz = _places(table)
    if xyz is None:
        return beams
    there = np.isfinite(xyz).all(axis=1) & (columns["distance_m"] > 0.0)
    return beams.with_phase(beams.phase_of(layer[there], point[there], xyz[there]))


def _places(table: Table) -> FloatArray | None:
    """X, Y, Z of each row, (n, 3), None where a column is missing."""
    axes = [table.get(name) for name in ("X", "Y", "Z")]
    return None if any(axis is None for axis in axes) else np.column_stack([np.asarray(a, np.float64) for a in axes])


def _of_rays(beams: Beams, layer: IntArray, point: IntArray, table: Table) -> Beams:
    """The beams of a sensor whose scans bring them: each row's X, Y, Z lie on its ray, whether it meets something."""
    xyz = _places(table)
    if xyz is None:
        what, fix = "the sensor has no beams of its own, and X, Y, Z are missing", "cast it along a scan's rays"
        raise InputError(what, file=table.path, line=table.line_of(0), fix=fix)
    lost = np.flatnonzero(~(np.isfinite(xyz).all(axis=1) & xyz.any(axis=1)))
    if len(lost):
        raise table.fault("X, Y, Z name no direction", row=int(lost[0]), fix="let them lie on the row's ray")
    return TableBeams.of_echoes(beams.sweep, layer, point, xyz)


def _there(table: Table, name: str, met: BoolArray | None) -> BoolArray | None:
    """Where the column must have a value: where the beam meets something, and where it has one; None: everywhere."""
    column = table.get(name)
    if met is None or column is None or column.dtype.kind != "f":
        return None
    return np.asarray(met | ~np.isnan(column))


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
