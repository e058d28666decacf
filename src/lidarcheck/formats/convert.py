"""A scan or ideal scan from one file format into another."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.columns import missing
from lidarcheck.formats.describe import FileDescription, describe
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.ideals import ideal_from_table, is_ideal
from lidarcheck.formats.recognise import Format, read_table, recognise, target_format
from lidarcheck.formats.scans import SCAN_COLUMNS, normalised_scan, scan_from_table
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic
from lidarcheck.formats.table import Table
from lidarcheck.scan import Scan

__all__ = ["FileDescription", "convert", "describe"]

_WHOLE = ("Layer", "Point", "EchoNumber", "MaterialID", "ObjectID")
_NEEDS_POSITION = ("las", "ply", "pcd")


def convert(source: str | os.PathLike[str], target: str | os.PathLike[str], placement: Placement = AS_IT_IS) -> None:
    """Write the file `source` as `target`, in the format of the target's suffix.

    All columns are kept with their names and order; only echoes numbered from 0 are renumbered from 1, hits of a
    semantic LiDAR become an ideal scan, and X, Y, Z of a scan are placed as declared. From text to text (or CSV to CSV)
    every other byte stays as it was.
    `UsageError` for a suffix that cannot be written, or when `target` is `source` and would change; `InputError` for
    what is wrong with the file. Nothing is written then.
    """
    form = target_format(target)
    table = read_table(source)
    columns, scan = _checked(table, placement)
    if Path(target).exists() and Path(target).samefile(source):
        if recognise(source) != form.name or columns.edited or columns.names != table.names:
            raise UsageError(f"{target} would be overwritten by its own conversion", fix="name another file to write")
        return
    form.write(_for_format(columns, scan, form), target)


def _checked(table: Table, placement: Placement) -> tuple[Table, Scan | None]:
    """The columns, once they are known to be a scan or an ideal scan, echoes numbered from 1; and the scan."""
    if is_semantic(table):
        _only_scans(table, placement)
        return ideal_table(table), None
    if is_ideal(table):
        _only_scans(table, placement)
        ideal_from_table(table)
        return table, None
    table = normalised_scan(table)
    scan = scan_from_table(table, placement)
    return placement.applied(table), scan


def _only_scans(table: Table, placement: Placement) -> None:
    if placement.moves:
        what = "is an ideal scan, whose beams have no mirror, unit or pose to declare"
        raise InputError(what, file=table.path, fix="leave --mirror, --unit and --pose out")


def _for_format(table: Table, scan: Scan | None, form: Format) -> Table:
    """Whole numbers as such, which text may spell as 331.000000; and positions where a point must have one."""
    for name in _WHOLE:
        column = table.get(name)
        if column is not None and column.dtype.kind == "f":
            table = table.with_column(name, column.astype(np.int32))
    if scan is not None and form.name in _NEEDS_POSITION and missing(table, ["X", "Y", "Z"]):
        for name in ("X", "Y", "Z"):
            table = table.with_column(name, getattr(scan, SCAN_COLUMNS[name]))
    return table
