"""Where echoes lie: from ranges along any sensor's beams to X, Y, Z."""

from __future__ import annotations

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.jit import kernel
from lidarcheck.sensor import Beams

__all__ = ["placed"]


def placed(
    beams: Beams, layer: IntArray, point: IntArray, range_m: FloatArray, *, more_m: float = 0.0, step_m: float = 0.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """X, Y, Z of echoes [m], shape (n,) each; `range_m`: the ways from the beams' origins.

    A range is reported longer by the channel's offset and by `more_m`, none below 0, rounded to `step_m` (0: not).
    """
    directions, origins = beams.cells()
    offsets = np.zeros(beams.layers) + beams.range_offset_m(np.arange(beams.layers))
    x_m, y_m, z_m = np.empty((3, len(layer)))
    _place(layer, point, range_m, beams.points, directions, origins, offsets, more_m, step_m, x_m, y_m, z_m)
    return x_m, y_m, z_m


@kernel
def _place(
    layer: IntArray,
    point: IntArray,
    range_m: FloatArray,
    points: int,
    directions: FloatArray,
    origins: FloatArray,
    offsets: FloatArray,
    more_m: float,
    step_m: float,
    x_m: FloatArray,
    y_m: FloatArray,
    z_m: FloatArray,
) -> None:
    """Write each echo's place; `origins` is empty where all beams begin at 0."""
    for row in range(len(layer)):
        i: Any = np.uint64(row)
        line = np.uint64(layer[i])
        cell = line * np.uint64(points) + np.uint64(point[i])
        reported = max(range_m[i] + offsets[line] + more_m, 0.0)
        if step_m > 0.0:
            reported = np.rint(reported / step_m) * step_m
        way = reported - offsets[line]
        x, y, z = directions[cell, 0] * way, directions[cell, 1] * way, directions[cell, 2] * way
        if len(origins) > 0:
            x, y, z = x + origins[cell, 0], y + origins[cell, 1], z + origins[cell, 2]
        x_m[i], y_m[i], z_m[i] = x, y, z
