"""The columns that a scan's rows lie in: the step of the azimuth, the sense of turning, what each ring looks beside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.assign.columns import circular_median

__all__ = ["Steps", "column_step", "offsets", "sense_of_rows", "turn_rate"]

_ONE_RAY = 0.02
"""Rows of one ring that lie nearer to each other than this part of a step are returns of one shot."""
_BIN = 0.05
"""Differences of the azimuth that differ by this part are one, for the search of the commonest."""
_COMMON = 0.25
"""The step is the smallest difference that is at least so common beside the commonest."""
_FAR = 20
"""Columns beyond which a gap's number of columns is not sure before the step is."""
_ROUNDS = 4
_NOISE, _OFF = 3.0, 0.25
"""A gap is so many columns where it lies off by no more than so many times what 90 % do, and this part of a step."""
_FEWEST = 100
_SURE = 0.8
"""Share of the rows that go the same way from each to the next, where their order tells the sense of turning."""
_WHOLE = 0.02
"""A turn has a whole number of columns within this, or what the step's error makes of it."""


@dataclass(frozen=True)
class Steps:
    """`step_deg` from a column to the next, its standard error, and whether a turn has a whole number of columns."""

    step_deg: float
    error_deg: float

    @property
    def columns(self) -> float:
        """Columns in a turn."""
        return 360.0 / self.step_deg

    @property
    def whole(self) -> bool:
        """Whether that may be a whole number."""
        error = 3.0 * self.columns * self.error_deg / self.step_deg
        return abs(self.columns - round(self.columns)) <= max(_WHOLE, min(error, 0.5))


def column_step(azimuth_deg: FloatArray, ring: npt.NDArray[Any]) -> Steps | None:
    """The step between columns, of azimuths within rings; None where none is common. Both inputs: shape (n,)."""
    order = np.lexsort((azimuth_deg, ring))
    azimuth, rings = azimuth_deg[order], ring[order]
    same = np.diff(rings) == 0
    gaps = np.diff(azimuth)
    rays = gaps[same & (gaps > 1e-6)]
    if len(rays) < _FEWEST:
        return None
    step = _commonest(rays)
    if step is None:
        return None
    error = 0.0
    for _ in range(_ROUNDS):
        columns = np.rint(gaps / step)
        # Whatever lies off the lattice of its neighbours, as where a frame's end meets its start, breaks the run.
        off = np.abs(gaps / step - columns)
        near = same & (columns >= 1) & (columns <= _FAR)
        near &= off <= np.clip(_NOISE * np.quantile(off[near], 0.9), _ONE_RAY, _OFF) if near.any() else False
        use = same & (near | (gaps <= _ONE_RAY * step))
        fitted = _fitted(azimuth, columns, use)
        if fitted is None:
            return None
        step, error = fitted
    return Steps(step, error)


def _commonest(rays: FloatArray) -> float | None:
    """The smallest of the common differences."""
    cell = np.rint(np.log(rays) / np.log1p(_BIN)).astype(np.int64)
    names, counts = np.unique(cell, return_counts=True)
    at = np.searchsorted(names, names + 1)
    joined = counts + np.where(np.isin(names + 1, names), counts[np.minimum(at, len(counts) - 1)], 0)
    common = names[joined >= _COMMON * joined.max()]
    near = rays[np.abs(np.log(rays) / np.log1p(_BIN) - (common[0] + 0.5)) <= 2.0]
    return float(np.median(near)) if joined.max() >= _COMMON * _FEWEST else None


def _fitted(azimuth: FloatArray, columns: FloatArray, use: npt.NDArray[np.bool_]) -> tuple[float, float] | None:
    """Slope of the azimuth over the column along runs of rows, and its standard error."""
    run = np.r_[0, np.cumsum(~use)]
    column = np.r_[0.0, np.cumsum(np.where(use, columns, 0.0))]
    count = np.bincount(run)
    enough = (count >= 3)[run]
    if np.count_nonzero(enough) < _FEWEST:
        return None
    mean_c, mean_a = (np.bincount(run, weights=values) / count for values in (column, azimuth))
    c, a = (column - mean_c[run])[enough], (azimuth - mean_a[run])[enough]
    square = float(np.sum(c * c))
    slope = float(np.sum(c * a)) / square
    off = a - slope * c
    return slope, float(np.sqrt(np.mean(off * off) / square))


def sense_of_rows(azimuth_deg: FloatArray, ring: npt.NDArray[Any]) -> int:
    """1 where the rows of a ring turn to the left in the order of the file, -1 to the right, 0 where neither."""
    order = np.argsort(ring, kind="stable")
    turned = _wrapped(np.diff(azimuth_deg[order]))[np.diff(ring[order]) == 0]
    turned = turned[np.abs(turned) > 1e-6]
    if len(turned) < _FEWEST:
        return 0
    left = float(np.mean(turned > 0.0))
    return 1 if left >= _SURE else -1 if left <= 1.0 - _SURE else 0


def turn_rate(azimuth_deg: FloatArray, time_s: FloatArray, ring: npt.NDArray[Any]) -> float | None:
    """How fast the head turns [deg/s], with its sign, of azimuths and times of shape (n,); None if they do not say."""
    order = np.lexsort((time_s, ring))
    same = np.diff(ring[order]) == 0
    turned = _wrapped(np.diff(azimuth_deg[order]))
    passed = np.diff(time_s[order])
    use = same & (passed > 0.0) & (np.abs(turned) > 1e-6) & (np.abs(turned) < 90.0)
    if np.count_nonzero(use) < _FEWEST:
        return None
    rate = float(np.median(turned[use] / passed[use]))
    for _ in range(3):
        # Along each ring: where the head stands beyond what that rate makes of the time.
        beyond = _wrapped(azimuth_deg - rate * time_s)
        middle = {one: circular_median(beyond[ring == one], 360.0) for one in np.unique(ring)}
        off = _wrapped(beyond - np.array([middle[one] for one in ring.tolist()]))
        near = np.abs(off) <= 10.0 * max(float(np.median(np.abs(off))), 1e-6)
        since = time_s - time_s.mean()
        rate += float(np.sum(since[near] * off[near]) / np.sum(since[near] ** 2))
    return rate


def offsets(values: FloatArray, ring: npt.NDArray[Any], numbers: npt.NDArray[Any], period: float) -> FloatArray:
    """Each ring's circular median of values that count modulo a period, shape (rings,)."""
    return np.array([circular_median(values[ring == number], period) for number in numbers])


def _wrapped(degrees: FloatArray) -> FloatArray:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)
