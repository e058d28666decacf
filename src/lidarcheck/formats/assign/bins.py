"""Rows of public data sets without names: four or five numbers each, as KITTI and nuScenes write them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.assign.rings import medians

__all__ = ["KITTI_RINGS", "bin_columns", "rings_by_wrap"]

KITTI_RINGS = 64
"""Channels of the sensor that KITTI used."""
_BACK_DEG = 180.0
"""An azimuth that falls back by more than so much has begun another turn."""


def bin_columns(rows: npt.NDArray[np.float32]) -> dict[str, npt.NDArray[Any]]:
    """Columns by name of rows of float32, shape (n, 4) or (n, 5).

    Four: x, y, z and a reflectance 0 ... 1, x forward. Five: x, y, z, intensity and ring, as nuScenes has them in its
    frame, x right and y forward; a ring of -1 everywhere is none. `UsageError` for another shape.
    """
    if rows.ndim != 2 or rows.shape[1] not in (4, 5):
        shape = "x".join(str(n) for n in rows.shape)
        raise UsageError(f"rows of shape {shape} are neither KITTI's nor nuScenes'", fix="give 4 or 5 numbers a row")
    columns = {"X": rows[:, 0], "Y": rows[:, 1], "Z": rows[:, 2], "INTENSITY": rows[:, 3]}
    if rows.shape[1] == 5 and bool((rows[:, 4] >= 0).any()):
        ring = rows[:, 4]
        if bool((ring != np.rint(ring)).any()) or float(ring.max()) > np.iinfo(np.int16).max:
            raise UsageError("the fifth number of the rows is no ring", fix="give it by name, in a PCD or PLY")
        columns["ring"] = ring.astype(np.int16)
    return columns


def rings_by_wrap(position: FloatArray, rings: int = KITTI_RINGS) -> IntArray | None:
    """The ring of each row, shape (n,), of a cloud that runs ring by ring: a new one where the azimuth wraps.

    None where not so many rings come out, or their elevations do not fall from ring to ring: then the order of the rows
    tells nothing.
    """
    if len(position) < 2:
        return None
    azimuth = np.rad2deg(np.arctan2(position[:, 1], position[:, 0])) % 360.0
    jump = np.diff(azimuth)
    back = jump < -_BACK_DEG if float(np.median(jump)) > 0.0 else jump > _BACK_DEG
    ring = np.concatenate([[0], np.cumsum(back)]).astype(np.int32)
    if ring[-1] + 1 != rings:
        return None
    elevation = np.rad2deg(np.arctan2(position[:, 2], np.hypot(position[:, 0], position[:, 1])))
    _, median = medians(elevation, ring)
    steps = np.diff(median)
    return ring if bool((steps < 0).all()) or bool((steps > 0).all()) else None
