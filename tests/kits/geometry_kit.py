"""Scans whose X, Y, Z lie where their beams point, for tests that then make them wrong."""

from __future__ import annotations

import numpy as np

from lidarcheck.formats.table import Table
from reference_grid import beam_directions


def right_table(rows: int = 3000, *, seed: int = 0, decimals: int = 4, near_m: float = 3.0, **columns: object) -> Table:
    """An echo each on beams spread over the sensor, at ranges of whole centimetres, rounded to so many decimals."""
    rng = np.random.default_rng(seed)
    layer, point = (a + 10 for a in np.divmod(rng.choice(500 * 940, rows, replace=False), 940))
    range_m = np.round(rng.uniform(near_m, 90.0, rows), 2)
    return table_of(layer, point, beam_directions(layer, point) * range_m[:, None], decimals=decimals, **columns)


def table_of(layer: object, point: object, xyz: np.ndarray, *, decimals: int = 4, **columns: object) -> Table:
    """A table of echoes at those positions."""
    x, y, z = np.round(xyz, decimals).T
    n = len(x)
    given = {"X": x, "Y": y, "Z": z, "Layer": np.asarray(layer), "Point": np.asarray(point)}
    rest = {"EchoNumber": np.ones(n, dtype=int), "WIDTH": np.full(n, 10.0), "AREA": np.full(n, 90.0)}
    return Table({**given, **rest, "PEAK": np.full(n, 20.0), **{name: np.asarray(c) for name, c in columns.items()}})


def positions(table: Table) -> np.ndarray:
    """X, Y, Z, shape (n, 3)."""
    return np.stack([table.columns[name] for name in "XYZ"], axis=-1)


def moved(table: Table, xyz: np.ndarray, *, decimals: int = 4) -> Table:
    """The same echoes at other positions."""
    for name, column in zip("XYZ", np.round(xyz, decimals).T, strict=True):
        table = table.with_column(name, np.ascontiguousarray(column))
    return table
