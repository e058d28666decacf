"""What a table of beams must hold."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import IndexArray
from lidarcheck.sensor.faults import RowFault

__all__ = ["ORIGIN", "TABLE_COLUMNS", "checked_numbers", "like_radians"]

TABLE_COLUMNS = ("Layer", "Point", "elevation_deg", "azimuth_deg")
"""What a beam table must have."""
ORIGIN = ("origin_x_m", "origin_y_m", "origin_z_m")
_FURTHER = ("time_s", *ORIGIN)
_MOST_EMPTY = 4
"""Cells of (layer, point) that a table may leave empty, times its rows: lines may have different lengths."""


def checked_numbers(columns: Mapping[str, npt.NDArray[Any]]) -> tuple[IndexArray, IndexArray]:
    """Layer and point of each row of a beam table; `RowFault` with the first row that is wrong."""
    for name in TABLE_COLUMNS:
        if name not in columns:
            raise RowFault(f"the beam table has no column {name}", fix=f"it needs {', '.join(TABLE_COLUMNS)}")
    for name in columns:
        if name not in (*TABLE_COLUMNS, *_FURTHER):
            near = difflib.get_close_matches(name, (*TABLE_COLUMNS, *_FURTHER), n=1)
            fix = f"did you mean {near[0]}?" if near else f"it may have {', '.join(_FURTHER)}"
            raise RowFault(f"a beam table has no column {name!r}", fix=fix)
    if not len(columns["Layer"]):
        raise RowFault("the beam table is empty", fix="write a row for each beam")
    values = {name: np.asarray(column, dtype=np.float64) for name, column in columns.items()}
    for name, column in values.items():
        _refuse(~np.isfinite(column), f"{name} is no number", "correct or remove the row")
    for name in TABLE_COLUMNS[:2]:
        wrong = (values[name] < 0.0) | (values[name] != np.rint(values[name])) | (values[name] > 1e9)
        _refuse(wrong, f"{name} is no whole number from 0", "number lines and points from 0")
    steep = np.abs(values["elevation_deg"]) > 90.0
    _refuse(steep, "elevation_deg lies beyond -90 to 90 degrees", "correct it; angles are in degrees")
    layer, point = (values[name].astype(np.int64) for name in TABLE_COLUMNS[:2])
    _check_cells(layer, point)
    elevation, azimuth = values["elevation_deg"], values["azimuth_deg"]
    if len(layer) > 1 and not elevation.any() and not azimuth.any():
        raise RowFault("all angles of the beam table are 0", fix="give each beam's direction")
    spans = (float(np.ptp(elevation)), float(np.ptp(azimuth)))
    if like_radians(len(layer), *spans):
        what = f"azimuth_deg spans {spans[1]:.3g} and elevation_deg {spans[0]:.3g}: these look like radians"
        raise RowFault(what, fix="write degrees")
    return layer, point


def like_radians(beams: int, elevation_span: float, azimuth_span: float) -> bool:
    """Whether the angles of so many beams look as if written in radians: about a turn of 2 pi, or half of it."""
    return beams >= 1000 and 3.0 < azimuth_span < 6.3 and elevation_span < 3.2


def _refuse(wrong: npt.NDArray[np.bool_], what: str, fix: str) -> None:
    rows = np.flatnonzero(wrong)
    if len(rows):
        raise RowFault(what, fix=fix, row=int(rows[0]))


def _check_cells(layer: IndexArray, point: IndexArray) -> None:
    """Each beam once; lines from 0 on, and in each its points from 0 on."""
    if (int(layer.max()) + 1) * (int(point.max()) + 1) > max(_MOST_EMPTY * len(layer), 1000):
        row = int(np.argmax(layer * (int(point.max()) + 1) + point))
        raise RowFault("the beam table has more holes than beams", fix="number lines and points without gaps", row=row)
    cell = layer * (int(point.max()) + 1) + point
    order = np.argsort(cell, kind="stable")
    same = np.flatnonzero(np.diff(cell[order]) == 0)
    if len(same):
        first, second = sorted(order[[same[0], same[0] + 1]].tolist())
        what = f"Layer {layer[first]}, Point {point[first]} is there a second time, after row {first + 1}"
        raise RowFault(what, fix="keep one row a beam", row=second)
    beams = np.bincount(layer)
    if not beams.all():
        missing = int(np.flatnonzero(beams == 0)[0])
        row = int(np.flatnonzero(layer > missing)[0])
        raise RowFault(f"there is no Layer {missing} before it", fix="number lines from 0 without gaps", row=row)
    last = np.zeros(len(beams), dtype=np.int64)
    np.maximum.at(last, layer, point)
    short = np.flatnonzero(last + 1 != beams)
    if len(short):
        line = int(short[0])
        there = np.zeros(last[line] + 1, dtype=np.bool_)
        there[point[layer == line]] = True
        hole = int(np.flatnonzero(~there)[0])
        row = int(np.flatnonzero((layer == line) & (point == last[line]))[0])
        what = f"Layer {line} has a Point {last[line]}, but no Point {hole}"
        raise RowFault(what, fix="add the row, or number the line's points from 0 without gaps", row=row)
