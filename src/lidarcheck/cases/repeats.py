"""Frames whose ideal scans come from repeats of a still scene: what only all of them together say of each ray."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import IndexArray
from lidarcheck.cases.frame import Frame
from lidarcheck.cases.origin import SEEN_BY_NONE
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import IdealScan, Scan

__all__ = ["of_repeats"]

_FEWEST_IN_COLUMN = 4
"""A column that has so many echoes in another frame, and none in this one, was not fired: one lost echo is a loss."""


def of_repeats(frames: Sequence[Frame]) -> list[Frame]:
    """The frames, of which rays that no other repeat saw meet nothing, and columns that were not fired are unknown.

    Verify frames say nothing of the others.
    """
    seen = [beam_keys(frame.measured.layer, frame.measured.point) for frame in frames]
    found = []
    for i, frame in enumerate(frames):
        others = [one for j, one in enumerate(seen) if j != i and frames[j].part != "verify"]
        ideal = frame.ideal
        if others and frame.origin.repeats >= SEEN_BY_NONE:
            ideal = _meeting_nothing(ideal, np.unique(np.concatenate(others)))
        ideal = _without_columns(ideal, _not_fired(frame.measured, [f.measured for f in frames if f is not frame]))
        found.append(replace(frame, ideal=ideal))
    return found


def _meeting_nothing(ideal: IdealScan, seen: IndexArray) -> IdealScan:
    """The ideal scan, in which rays of which nobody knows what they meet meet nothing unless they are among `seen`."""
    never = np.isnan(ideal.distance_m) & ~np.isin(beam_keys(ideal.layer, ideal.point), seen)
    return replace(ideal, distance_m=np.where(never, 0.0, ideal.distance_m)) if never.any() else ideal


def _not_fired(scan: Scan, others: Sequence[Scan]) -> IndexArray:
    """The point columns without any echo in a scan that has some in another, (n,)."""
    if scan.beams.sweep.order != "columns" or not scan.beams.lattice or not others:
        return np.zeros(0, dtype=np.int64)
    columns = scan.beams.points
    counts = [np.bincount(one.point[one.point >= 0], minlength=columns) for one in (scan, *others)]
    most = np.max(counts[1:], axis=0)
    return np.flatnonzero((counts[0] == 0) & (most >= _FEWEST_IN_COLUMN))


def _without_columns(ideal: IdealScan, columns: IndexArray) -> IdealScan:
    """The ideal scan, in which nobody knows what the beams of these columns meet."""
    rows = np.isin(ideal.point, columns)
    return replace(ideal, distance_m=np.where(rows, np.nan, ideal.distance_m)) if rows.any() else ideal
