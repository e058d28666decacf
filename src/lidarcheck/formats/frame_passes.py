"""Frames of rows without echo numbers: whole passes through the columns, in the order of rows."""

from __future__ import annotations

import logging

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.formats.frame_cuts import Repeats, cuts_of, repeats_of
from lidarcheck.formats.table import Table, counted

__all__ = ["passes_of", "unnumbered_repeats"]

WHOLE_COLUMNS = 0.9
"""A pass is whole if it visits that share of the columns of the file; echoes are missing here and there."""
WHOLE_ROWS = 0.5
"""... and has that share of the rows of the longest pass: second echoes alone, listed behind the first, are fewer."""
MOST_RETURNS = 15
"""LAS, made for airborne lidars, counts to 15 returns of a pulse; nothing on the ground tells more apart."""
ONE_PULSE_M = 0.15
"""Two echoes of one pulse are more than 1 ns, 0.15 m, apart, else they would be one; two frames' are often closer."""
MOST_CLOSE = 0.5
"""Share of repeated beams whose rows are closer than that from which on they are no echoes of one pulse."""

_log = logging.getLogger(__name__)


def passes_of(layer: IndexArray, point: IndexArray) -> IndexArray | None:
    """The rows at which another whole pass begins; None where there are not several. Shapes (n,).

    A file runs through points, with all layers of each, or through layers: whichever it changes less often.
    """
    slow = min((point, layer), key=lambda column: int(np.count_nonzero(np.diff(column))))
    starts = np.flatnonzero(np.concatenate([[True], slow[1:] != slow[:-1]]))
    visits = slow[starts]
    repeats = repeats_of(visits)
    if repeats.most < 2:
        return None
    cuts = cuts_of(repeats, [visits])
    if cuts is None:
        return None
    parts = np.split(visits, cuts)
    places = starts[cuts]
    rows = np.diff(np.concatenate([[0], places, [len(slow)]]))
    whole = min(len(np.unique(part)) for part in parts) >= WHOLE_COLUMNS * len(np.unique(visits))
    return places if whole and rows.min() >= WHOLE_ROWS * rows.max() else None


def unnumbered_repeats(table: Table, key: IndexArray) -> Repeats | None:
    """The repeats of beams that cannot be several echoes of one pulse; None where all may be. One line of log says so.

    `key` (n,): the beam of each row.
    """
    repeats = repeats_of(key)
    if repeats.most > MOST_RETURNS:
        return repeats
    again = np.flatnonzero(repeats.previous >= 0)
    apart_m = np.abs(_ranges(table)[again] - _ranges(table)[repeats.previous[again]])
    close = np.count_nonzero((apart_m > 0.0) & (apart_m < ONE_PULSE_M))
    if close > MOST_CLOSE * len(again):
        return repeats
    _log.info(
        "%s: no EchoNumber; %s of a beam seen before, taken as its further echoes",
        table.path,
        counted(len(again), "row"),
    )
    return None


def _ranges(table: Table) -> FloatArray:
    x, y, z, given = (table.get(name) for name in ("X", "Y", "Z", "RANGE"))
    if x is None or y is None or z is None:
        return np.zeros(len(table)) if given is None else given.astype(np.float64)
    range_m: FloatArray = np.sqrt(sum(np.square(column, dtype=np.float64) for column in (x, y, z)))
    return range_m
