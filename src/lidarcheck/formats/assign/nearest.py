"""The channel whose direction is nearest to a point, where nothing but the direction tells it."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.formats.geometry.head import Head, angles_of_deg

__all__ = ["nearest_channels"]

_BESIDE = (-1, 0, 1, 2)
"""Channels beside the first guess in order of elevation that are compared: a near point's origin moves it by one."""
_BEYOND = 0.5
"""A point farther outside than this part of the last spacing belongs to no channel."""


def nearest_channels(head: Head, position: FloatArray) -> IntArray:
    """The nearest channel of each point, shape (n,); -1 outside the channels' elevations.

    Channels of one elevation are told apart by how near the point lies to a column of theirs, where columns repeat.
    """
    order = np.argsort(head.elevation_deg, kind="stable")
    sorted_deg = head.elevation_deg[order]
    start = 0.0 if head.origin_m is None else float(np.median(head.origin_m[:, 2]))
    elevation, _ = angles_of_deg(position - np.array([0.0, 0.0, start]))
    guess = np.searchsorted(sorted_deg, elevation) - 1
    best = np.full(len(position), np.inf)
    layer = np.full(len(position), -1, dtype=np.int32)
    up = np.zeros(len(position))
    for beside in _BESIDE:
        candidate = order[np.clip(guess + beside, 0, head.layers - 1)].astype(np.int32)
        error, height = _errors(head, position, candidate)
        nearer = error < best
        best, layer = np.where(nearer, error, best), np.where(nearer, candidate, layer).astype(np.int32)
        up = np.where(nearer, height, up)
    gaps = np.diff(sorted_deg)
    below, above = (_BEYOND * gaps[[0, -1]]) if head.layers > 1 else (_BEYOND * abs(head.step_deg),) * 2
    low, high = sorted_deg[0] - below, sorted_deg[-1] + above
    reached = head.elevation_deg[layer] + up
    return np.where((reached >= low) & (reached <= high), layer, -1).astype(np.int32)


def _errors(head: Head, position: FloatArray, layer: IntArray) -> tuple[FloatArray, FloatArray]:
    """How far points lie off a column of a channel [deg squared], and their elevation over the channel's [deg]."""
    column = head.columns_of(position, layer)
    origin = head.origins_m(layer, column)
    elevation, _ = angles_of_deg(position if origin is None else position - origin)
    up = elevation - head.elevation_deg[layer]
    around = (column - np.rint(column)) * head.step_deg if head.repeats else 0.0
    return np.asarray(np.square(up) + np.square(around * np.cos(np.deg2rad(elevation)))), up
