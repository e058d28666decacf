"""Which beams were fired: where nobody knows, a missing echo says nothing, and there is no KPI of detection."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import BoolArray, IndexArray
from lidarcheck.beams import Fired
from lidarcheck.scan import IdealScan, Scan

__all__ = ["at_marked_edges", "fired_beams", "judged_beams", "judged_rows"]

_EDGE = "EDGE"
"""A column of ideal scans: 1 where a beam meets two surfaces, or may."""


def fired_beams(scan: Scan, ideal: IdealScan | None = None) -> Fired | None:
    """The beams that were fired, or None where nobody knows; of a scan of several frames, in any of them.

    The first that knows: the scan, where its source has a row for each beam whether it had an echo or not; the ideal
    scan, which has every fired beam; the sensor's beams within the layers and points of the scan's echoes, where the
    source itself names their beams and these are the same in every frame. Never what echoes are there alone.
    """
    if scan.fired is not None and (ideal is None or _has_whole_columns(scan.fired, ideal)):
        return scan.fired
    if ideal is not None:
        keys = np.unique(_keys(ideal))
        return Fired(keys >> 32, keys & 0xFFFFFFFF, None, "ideal")
    beams = scan.beams
    if {"Layer", "Point"} & set(scan.defaulted) or not len(scan) or not beams.lattice:
        return None
    low, high = ((int(f(scan.layer)), int(f(scan.point))) for f in (np.min, np.max))
    if min(low) < 0 or high[0] >= beams.layers or high[1] >= beams.points:
        return None
    layer, point = (a.ravel() for a in np.mgrid[low[0] : high[0] + 1, low[1] : high[1] + 1])
    there = beams.has(layer, point)
    return Fired(layer[there], point[there], None, "sensor")


def judged_rows(ideal: IdealScan, scan: Scan) -> BoolArray:
    """The rows of the ideal scan of whose beams a missing echo, or one too many, says something, shape (n,).

    Not those of beams that were not fired, nor of beams of which nobody knows all that they meet.
    """
    keys = _keys(ideal)
    unknown = np.isnan(ideal.distance_m)
    judged = ~np.isin(keys, keys[unknown]) if unknown.any() else ~unknown
    fired = None if scan.fired is None else fired_beams(scan, ideal)
    if fired is not None and fired.source == "scan":
        judged &= fired.has(ideal.layer, ideal.point)
    return judged


def at_marked_edges(ideal: IdealScan) -> BoolArray | None:
    """The rows of beams that the ideal scan marks as beams that may meet two surfaces, (n,); None where none is."""
    marked = next((column for name, column in ideal.extra.items() if name.upper() == _EDGE), None)
    if marked is None or not (at_edge := np.nan_to_num(np.asarray(marked, dtype=np.float64)) == 1.0).any():
        return None
    keys = _keys(ideal)
    return np.isin(keys, keys[at_edge])


def judged_beams(ideal: IdealScan, scan: Scan) -> tuple[IdealScan, Scan]:
    """Both with the beams of `judged_rows` alone."""
    judged = judged_rows(ideal, scan)
    if judged.all():
        return ideal, scan
    left_out = np.isin(_keys(scan), _keys(ideal)[~judged])
    return ideal.take(judged), scan.take(~left_out)


def _has_whole_columns(fired: Fired, ideal: IdealScan) -> bool:
    """Whether each column of the fired beams has all its beams, the first and the last of them apart.

    A sensor fires columns, and packets lose columns: where a column lacks a beam, or a layer all its beams, the file
    leaves out what had no echo, and rows without a return that it has besides tell nothing of these.
    """
    if not len(fired):
        return False
    columns = np.unique(fired.point)
    within = np.isin(ideal.point, columns[1:-1] if len(columns) > 2 else columns)
    return bool(fired.has(ideal.layer[within], ideal.point[within]).all())


def _keys(rows: IdealScan | Scan) -> IndexArray:
    """One number a beam, ascending in (layer, point), shape (n,)."""
    return rows.layer.astype(np.int64) * 2**32 + rows.point
