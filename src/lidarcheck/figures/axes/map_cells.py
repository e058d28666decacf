"""A map of values, made as coarse as what it is drawn on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.figures.data import Grid

__all__ = ["cell_edges", "reach_of", "resampled"]


def cell_edges(middles: npt.ArrayLike) -> tuple[float, float]:
    """What cells around these middles span: half a cell beyond the outermost."""
    at = np.sort(np.asarray(middles, dtype=np.float64))
    if at[0] == at[-1]:
        return float(at[0]) - 0.5, float(at[0]) + 0.5
    return float(at[0] - 0.5 * (at[1] - at[0])), float(at[-1] + 0.5 * (at[-1] - at[-2]))


def reach_of(grid: Grid) -> tuple[float, float]:
    """(low, high) of the map's scale: what the values span; where they diverge, as far below zero as above.

    (0, 1) for a map without values.
    """
    values = np.asarray(grid.values, dtype=np.float64)
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if grid.diverging:
        reach = max(abs(low), abs(high)) or 1.0
        return -reach, reach
    return (low, high) if high > low else (low, low + (abs(low) or 1.0))


def resampled(grid: Grid, rows: int, columns: int) -> FloatArray:
    """The map on `rows` x `columns` even cells, highest y first, lowest x first.

    A cell is the mean of the values in it; where it holds none, since values are sparser than cells, the nearest one.
    """
    values, x, y = (np.asarray(one, dtype=np.float64) for one in (grid.values, grid.x, grid.y))
    (left, right), (bottom, top) = cell_edges(x), cell_edges(y)
    column = np.clip(((x - left) / (right - left) * columns).astype(np.int64), 0, columns - 1)
    row = np.clip(((top - y) / (top - bottom) * rows).astype(np.int64), 0, rows - 1)
    where = (row[:, None] * columns + column[None, :]).ravel()
    seen = np.isfinite(values.ravel())
    total = np.bincount(where[seen], values.ravel()[seen], rows * columns)
    number = np.bincount(where[seen], minlength=rows * columns)
    mean = np.divide(total, number, out=np.full(total.shape, np.nan), where=number > 0)
    middle_x = left + (np.arange(columns) + 0.5) * (right - left) / columns
    middle_y = top - (np.arange(rows) + 0.5) * (top - bottom) / rows
    near_x = np.abs(middle_x[:, None] - x[None, :]).argmin(axis=1)
    near_y = np.abs(middle_y[:, None] - y[None, :]).argmin(axis=1)
    held = np.bincount(where, minlength=rows * columns) > 0
    cells = np.where(held, mean, values[near_y][:, near_x].ravel())
    return np.asarray(cells.reshape(rows, columns), dtype=np.float64)
