"""Scans whose echoes bring their own directions: `Layer` is the line, `Point` the rank by time within it."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.columns import whole_column
from lidarcheck.formats.returns import Beams
from lidarcheck.formats.table import Table
from lidarcheck.formats.times import clock_of, frame_of, seconds
from lidarcheck.sensor import Beams as SensorBeams
from lidarcheck.sensor.beam_table import TableBeams

__all__ = ["beams_of_echoes"]

_LINES = ("Layer", "line", "ring", "channel")
_MOST_LINES = 65_535


def beams_of_echoes(table: Table, xyz: FloatArray, own: SensorBeams) -> tuple[TableBeams, Beams]:
    """The beams of a scan from its rows' positions (n, 3), and the beam of each row.

    Rows of one line and one moment are echoes of one beam; without a time every row is a beam, in the order of rows.
    A scan that has Layer and Point keeps them.
    """
    name = next((name for name in _LINES if table.spelling(name)), None)
    line = np.zeros(len(table), np.int32) if name is None else whole_column(table, name, 0, _MOST_LINES)
    time_s = _times(table)
    if table.spelling("Layer") and table.spelling("Point"):
        point = whole_column(table, "Point", 0, 9_999_999)
    else:
        point = _ranks(line, np.arange(len(table), dtype=np.float64) if time_s is None else time_s)
    beams = TableBeams.of_echoes(own.sweep, line, point, xyz, time_s)
    return beams, Beams(line, point, frame_of(table.columns), told=True)


def _times(table: Table) -> FloatArray | None:
    try:
        clock = clock_of(table.columns)
    except UsageError:
        return None
    if clock is None:
        return None
    time_s = seconds(table.columns, clock)
    return time_s if np.isfinite(time_s).all() else None


def _ranks(line: IntArray, moment: FloatArray) -> IntArray:
    """The rank of each row's moment among those of its line, from 0; equal moments have one rank."""
    order = np.lexsort((moment, line))
    begins = np.ones(len(order), dtype=np.bool_)
    other_line = np.diff(line[order]) != 0
    begins[1:] = other_line | (np.diff(moment[order]) != 0)
    beam = np.cumsum(begins) - 1
    first = np.zeros(len(order), dtype=np.int64)
    first[1:] = np.where(other_line, beam[1:], 0)
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = beam - np.maximum.accumulate(first)
    return rank
