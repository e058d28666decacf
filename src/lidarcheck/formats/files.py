"""Whole files: `load_*` recognise by content, `save_*` go by suffix."""

from __future__ import annotations

from os import PathLike

from lidarcheck.formats.frames import one_frame
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.ideals import ideal_from_table, table_from_ideal
from lidarcheck.formats.recognise import read_table, write_table
from lidarcheck.formats.scan_table import table_from_scan
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["load_ideal", "load_scan", "save_ideal", "save_scan"]


def load_scan(path: str | PathLike[str], placement: Placement = AS_IT_IS, sensor: Sensor | None = None) -> Scan:
    """The echoes of a file in any known format, which holds one frame, placed as declared.

    `sensor`: what measured, a built-in one where None.
    Missing columns are logged and defaulted as `lidarcheck.formats.scans` says. `InputError` names file and line (or
    row) of whatever is wrong, the change that would help where X, Y, Z do not lie where the beams point, and of a file
    of several frames the command that splits it.
    """
    return scan_from_table(one_frame(read_table(path)), placement, sensor)


def save_scan(scan: Scan, path: str | PathLike[str], sensor: Sensor | None = None) -> None:
    """Write echoes in the format of the suffix; reading them gives the same values. Whole or not at all.

    Defaulted columns are left out. `sensor`: whose files it is written as, a built-in one's where None.

    `UsageError` for an unknown suffix, `InputError` for what the format cannot hold.
    """
    write_table(table_from_scan(scan, sensor), path)


def load_ideal(path: str | PathLike[str], sensor: Sensor | None = None) -> IdealScan:
    """The ideal scan of a file in any known format, or made of a driving simulator's semantic LiDAR, of one frame.

    `sensor`: whose beams they are, a built-in one's where None.
    `InputError` names file and line (or row) of whatever is wrong, and of a file of several frames the command that
    splits it.
    """
    table = one_frame(read_table(path))
    return ideal_from_table(ideal_table(table, sensor) if is_semantic(table) else table, sensor)


def save_ideal(ideal: IdealScan, path: str | PathLike[str]) -> None:
    """Write an ideal scan in the format of the suffix; reading it gives the same values. Whole or not at all.

    `UsageError` for an unknown suffix, `InputError` for what the format cannot hold.
    """
    write_table(table_from_ideal(ideal), path)
