"""Rays of repeats that seem to meet nothing, since what they meet is too weak to be seen often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.cases.frame import Frame
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Scan

__all__ = ["without_weak_rays"]

_BESIDE = 2.5
"""An echo of a beam no more than two lines away, in another repeat, may be of the same surface."""
_SAME_M, _SAME = 0.1, 0.01
"""And is, where it lies so near in range: another sensor's light, and drops, lie anywhere."""


def without_weak_rays(frames: Sequence[Frame]) -> list[Frame]:
    """The frames of repeats without the rays, and those beside them, that meet nothing by their estimate and show an
    echo where another repeat shows one on a ray beside: nobody knows what they meet.

    Frames that verify say nothing of the others.
    """
    known = [frame for frame in frames if frame.part != "verify"]
    places = [_places(frame.measured) for frame in known]
    weak = [_recurring(frame, known, places) for frame in frames]
    of_known = [rows for frame, rows in zip(frames, weak, strict=True) if frame.part != "verify"]
    everywhere = np.concatenate([np.zeros(0, np.int64), *of_known])
    return [_without(frame, np.unique(np.append(everywhere, own))) for frame, own in zip(frames, weak, strict=True)]


def _places(scan: Scan) -> FloatArray:
    """Layer, point and range of each echo, so scaled that what may be of one surface differs by no more than 1."""
    scale = np.log1p(scan.range_m * _SAME / _SAME_M) / _SAME  # its steps are _SAME_M + _SAME * range
    return np.column_stack([scan.layer / _BESIDE, scan.point / _BESIDE, scale])


def _recurring(frame: Frame, others: Sequence[Frame], places: Sequence[FloatArray]) -> IndexArray:
    """The keys of a frame's rays that meet nothing and show an echo that another frame shows beside."""
    from scipy.spatial import cKDTree

    ideal, scan = frame.ideal, frame.measured
    free = beam_keys(ideal.layer, ideal.point)[ideal.distance_m == 0.0]
    keys = beam_keys(scan.layer, scan.point)
    rows = np.flatnonzero(np.isin(keys, free))
    elsewhere = [place for other, place in zip(others, places, strict=True) if other is not frame and len(place)]
    if not len(rows) or not elsewhere:
        return np.zeros(0, dtype=np.int64)
    near = cKDTree(np.concatenate(elsewhere)).query(_places(scan)[rows], p=np.inf, distance_upper_bound=1.0)[0]
    return np.unique(keys[rows[np.isfinite(near)]])


def _without(frame: Frame, weak: IndexArray) -> Frame:
    """The frame without the rays that meet nothing beside weak ones, and without these."""
    if not len(weak):
        return frame
    ideal, scan = frame.ideal, frame.measured
    beside = np.unique([weak + (up << 32) + aside for up in (-1, 0, 1) for aside in (-1, 0, 1)])
    left_out: BoolArray = (ideal.distance_m == 0.0) & np.isin(beam_keys(ideal.layer, ideal.point), beside)
    lost = np.isin(beam_keys(scan.layer, scan.point), beam_keys(ideal.layer, ideal.point)[left_out])
    return replace(frame, ideal=ideal.take(~left_out), measured=scan.take(~lost))
