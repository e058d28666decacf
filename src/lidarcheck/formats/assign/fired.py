"""The beams that were fired, where a driver drops those without an echo."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.beams import Fired
from lidarcheck.formats.geometry.head import Head

__all__ = ["fired_within"]


def fired_within(head: Head, layer: IntArray, point: IntArray, time_s: FloatArray | None = None) -> Fired | None:
    """The sensor's beams that were fired while the frame lasted, from its first echo to its last; None without echoes.

    `layer`, `point`: of the echoes, shape (n,), -1 for a row of no beam. `time_s`: of the echoes from the frame's
    start, else the times that their beams have. A flash fires all of its beams.
    """
    known = (layer >= 0) & (point >= 0)
    if not known.any():
        return None
    every = np.arange(head.layers, dtype=np.int32)
    columns = np.arange(head.points, dtype=np.int32)
    all_layers, all_points = (a.ravel() for a in np.meshgrid(every, columns, indexing="ij"))
    if not head.column_s:
        return Fired(all_layers, all_points, None, "sensor")
    fired_s = all_points * head.column_s + head.fire_s[all_layers]
    echo_s = point[known] * head.column_s + head.fire_s[layer[known]]
    if time_s is not None and np.isfinite(time_s[known]).any():
        seen = time_s[known]
        echo_s = np.r_[echo_s, seen[np.isfinite(seen)]]
    # Half a column: a clock that rounds leaves no beam at either end out.
    slack = 0.5 * head.column_s
    within = (fired_s >= echo_s.min() - slack) & (fired_s <= echo_s.max() + slack)
    return Fired(all_layers[within], all_points[within], None, "sensor")
