"""The semantic LiDAR of a driving simulator: a PLY of hit points, converted into an ideal scan.

Its columns are `x y z CosAngle ObjIdx ObjTag`, a point each, left-handed: X forward, Y right, Z up, so Y is negated.
Every point goes to the nearest beam of the sensor; several points in one beam remain as its sub-beams:

    Distance = |xyz|    IncidenceAngle = acos(CosAngle)    MaterialID = ObjTag    ObjectID = ObjIdx

Points outside the field of view, or beyond the range within which an ideal scan says that a beam meets something, are
dropped, and the log says how many.

A beam that met nothing leaves no point. Which layers and point columns the simulator fired can be known only from those
that hit something somewhere: every beam of such a layer and such a column that has no point is added with Distance 0.
Layers and columns without any point are not added, so a simulated sensor coarser than this one gains no false misses.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.errors import InputError
from lidarcheck.formats.ply import read_ply
from lidarcheck.formats.table import Column, Table
from lidarcheck.scan import beams_of
from lidarcheck.sensor import Beams, Sensor, reference_beams

__all__ = ["COLUMNS", "MAX_RANGE_M", "ideal_table", "is_semantic", "read_semantic_ply"]

logger = logging.getLogger(__name__)

COLUMNS = ("x", "y", "z", "CosAngle", "ObjIdx", "ObjTag")
MAX_RANGE_M = 300.0
COSINE_SLACK = 1e-3  # text with four decimals rounds a cosine by half of 1e-4, float32 by less
Rows = npt.NDArray[np.bool_]


def read_semantic_ply(path: str | Path, sensor: Sensor | None = None) -> Table:
    """The ideal scan in a semantic-LiDAR PLY: Layer, Point, Distance, MaterialID, IncidenceAngle, ObjectID.

    Rows in the order of layer and point, sub-beams in the file's order. `sensor`: whose beams are looked for, a
    built-in one's where None. `InputError` when the file is no such PLY, when a column is missing, a cosine beyond
    -1 ... 1 or an id beyond 32 bits (with its row), or no point is left.
    """
    return ideal_table(read_ply(path), sensor)


def is_semantic(table: Table) -> bool:
    """Whether the columns are those of the driving simulator's semantic LiDAR."""
    return all(table.spelling(name) for name in COLUMNS)


def ideal_table(table: Table, sensor: Sensor | None = None) -> Table:
    """The same conversion of points that have been read; other columns are dropped and logged."""
    lacking = [name for name in COLUMNS if table.spelling(name) is None]
    if lacking:
        fix = f"a semantic LiDAR file has {' '.join(COLUMNS)}"
        raise table.fault(f"no column {', '.join(lacking)}", fix=fix)
    others = [name for name in table.names if name.casefold() not in {known.casefold() for known in COLUMNS}]
    if others:
        logger.warning("%s: columns without a place in an ideal scan were dropped: %s", table.path, ", ".join(others))
    table = _finite(table)
    x, y, z, cosine, object_index, tag = (_column(table, name) for name in COLUMNS)
    _check(table, "CosAngle", np.abs(cosine) <= 1 + COSINE_SLACK, "must lie in -1 ... 1")
    for name, ids in (("ObjIdx", object_index), ("ObjTag", tag)):
        whole = (ids == np.rint(ids)) & (ids >= 0) & (ids <= np.iinfo(np.int32).max)
        _check(table, name, whole, "must be a whole number from 0 to 2147483647")
    distance = np.sqrt(x**2 + y**2 + z**2)
    beams = reference_beams() if sensor is None else sensor.beams
    layer, point = beams_of(x, -y, z, beams)
    most_m = MAX_RANGE_M if sensor is None else sensor.max_range_m
    kept = _kept(table, beams.has(layer, point), distance, most_m)
    columns: dict[str, FloatArray | npt.NDArray[np.int32]] = {
        "Layer": layer,
        "Point": point,
        "Distance": distance,
        "MaterialID": tag.astype(np.int32),
        "IncidenceAngle": _incidence_deg(table, cosine),
        "ObjectID": object_index.astype(np.int32),
    }
    hits = {name: column[kept] for name, column in columns.items()}
    return _completed(hits, table, beams)


def _finite(table: Table) -> Table:
    """The rows that have a position, and a log of how many have none: no return."""
    there = np.isfinite(np.stack([_column(table, name) for name in ("x", "y", "z")])).all(axis=0)
    if there.all():
        return table
    logger.warning("%s: dropped %d of %d rows without a position", table.path, int((~there).sum()), len(table))
    return table.take(np.flatnonzero(there))


def _column(table: Table, name: str) -> FloatArray:
    column = table.get(name)
    assert column is not None, "missing columns were refused before"
    return column.astype(np.float64)


def _check(table: Table, name: str, good: Rows, demand: str) -> None:
    if not good.all():
        row = int(np.argmin(good))
        raise table.fault(f"{name} is {_column(table, name)[row]:g}", row=row, fix=f"it {demand}")


def _incidence_deg(table: Table, cosine: FloatArray) -> FloatArray:
    """The angle of incidence; a surface hit from behind its normal counts as grazed, at 90 degrees."""
    behind = int((cosine < -COSINE_SLACK).sum())
    if behind:
        logger.warning("%s: %d points with a negative CosAngle are taken as grazing, 90 degrees", table.path, behind)
    return np.asarray(np.rad2deg(elementary.arccos(np.clip(cosine, 0.0, 1.0))))


def _kept(table: Table, seen: Rows, distance: FloatArray, most_m: float) -> Rows:
    """Which points, of those `seen` by a beam, are in range; the log counts the others."""
    near = (distance > 0) & (distance <= most_m)
    outside, far = int((~seen).sum()), int((seen & ~near).sum())
    if outside:
        logger.warning("%s: dropped %d of %d points outside the field of view", table.path, outside, len(table))
    if far:
        logger.warning("%s: dropped %d of %d points at 0 m or beyond %g m", table.path, far, len(table), most_m)
    kept: Rows = seen & near
    if not kept.any():
        what = f"none of the {len(table)} points lies on a beam within {most_m:g} m"
        fix = "is it the sensor that was simulated? Built-in ones look along +X, 120 by 26 degrees"
        raise InputError(what, file=table.path, fix=fix)
    return kept


def _completed(hits: dict[str, Column], table: Table, beams: Beams) -> Table:
    """The hits and, with Distance 0, the other beams of their layers and columns; ordered by layer and point."""
    layers, points = np.unique(hits["Layer"]), np.unique(hits["Point"])
    grid = np.add.outer(layers.astype(np.int64) * beams.points, points).ravel()
    missed = np.setdiff1d(grid, beams.index(hits["Layer"], hits["Point"]), assume_unique=False)
    added = {"Layer": missed // beams.points, "Point": missed % beams.points}
    columns = {
        name: np.concatenate([column, added.get(name, np.zeros(len(missed))).astype(column.dtype)])
        for name, column in hits.items()
    }
    order = np.lexsort((columns["Point"], columns["Layer"]))
    logger.info("%s: %d points, and %d beams that met nothing", table.path, len(hits["Layer"]), len(missed))
    return Table({name: column[order] for name, column in columns.items()}, table.path)
