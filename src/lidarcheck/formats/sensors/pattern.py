"""A table of beams that a user gives, as `beams.file` of a sensor file holds it: CSV or Parquet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.sensors.values import MOST_LISTED

__all__ = ["read_pattern"]

_NEEDED = ("Layer", "Point", "elevation_deg", "azimuth_deg")
_MORE = ("time_s", "origin_x_m", "origin_y_m", "origin_z_m")


def read_pattern(path: Path) -> dict[str, Sequence[float]]:
    """Its columns; `InputError` where one is missing, or a beam stands twice."""
    columns = read_table(path).columns
    missing = [name for name in _NEEDED if name not in columns]
    if missing:
        fix = f"a table of beams has {', '.join(_NEEDED)}, and may have {', '.join(_MORE)}"
        raise InputError(f"the column {missing[0]} is missing", file=path, fix=fix)
    found = {name: np.asarray(columns[name], np.float64) for name in (*_NEEDED, *_MORE) if name in columns}
    count = len(found["Layer"])
    if not 0 < count <= MOST_LISTED:
        raise InputError(f"the table has {count} beams", file=path, fix=f"1 to {MOST_LISTED} are read")
    for name, column in found.items():
        if not np.isfinite(column).all():
            raise InputError(f"a number of {name} is not finite", file=path, fix="write all of them")
    beams = np.stack([found["Layer"], found["Point"]], axis=-1)
    if (beams < 0).any() or (beams != np.floor(beams)).any() or (beams > MOST_LISTED).any():
        raise InputError("Layer and Point are whole numbers from 0", file=path, fix="number the beams")
    if len(np.unique(beams, axis=0)) < count:
        raise InputError("a beam (Layer, Point) stands twice", file=path, fix="remove one")
    if (np.abs(found["elevation_deg"]) > 90).any():
        raise InputError("an elevation is beyond 90 deg", file=path, fix="use degrees")
    return {name: [int(v) for v in column] if name in ("Layer", "Point") else column.tolist()
            for name, column in found.items()}  # fmt: skip
