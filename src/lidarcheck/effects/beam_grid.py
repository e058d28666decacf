"""Which rows of an ideal scan lie in which direction: the sensor's beams as a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.scan import IdealScan
from lidarcheck.sensor import LAYERS, POINTS

__all__ = ["BeamGrid", "cells_of", "nearest_marked"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_CELLS = LAYERS * POINTS
_LAYER_RAD, _POINT_RAD = np.deg2rad(0.05), np.deg2rad(0.125)


def cells_of(position: FloatArray) -> IndexArray:
    """The grid cell (layer times 960 + point) in whose direction each position (n, 3) lies; the border's beyond it."""
    x, y, z = position[:, 0], position[:, 1], position[:, 2]
    layer = np.rint(np.arctan2(z, np.sqrt(x * x + y * y)) * (1.0 / _LAYER_RAD) + 259.5).astype(np.int64)
    point = np.rint(np.arctan2(y, x) * (1.0 / _POINT_RAD) + 479.5).astype(np.int64)
    return np.asarray(np.clip(layer, 0, LAYERS - 1) * POINTS + np.clip(point, 0, POINTS - 1))


def nearest_marked(mark: BoolArray) -> IndexArray:
    """The marked cell nearest in angle to each cell of a block of the grid, as flat indices; the mark must have one."""
    from scipy.ndimage import distance_transform_edt

    indices: IndexArray = distance_transform_edt(
        ~mark, sampling=(0.05, 0.125), return_distances=False, return_indices=True
    )
    return np.asarray(indices[0].astype(np.int64) * mark.shape[1] + indices[1])


@dataclass(frozen=True)
class BeamGrid:
    """The rows of each cell: cell c has `order[first[c]]` ... `order[first[c] + count[c] - 1]`, in order of rank.

    `first`, `count` (cells,), `order` (n,); `slot` (n,): each row's rank within its beam. `near` (cells,): the nearest
    cell that was fired, None where all were. `stride`: the layers, the points between neighbouring fired beams.
    """

    first: IndexArray
    count: IndexArray
    order: IndexArray
    slot: npt.NDArray[np.int32]
    near: IndexArray | None
    stride: tuple[int, int]

    @classmethod
    def of(cls, ideal: IdealScan, slot: npt.NDArray[np.int32]) -> BeamGrid:
        """The grid of a scan's rows and their ranks; rows of beams that the sensor does not have are left out."""
        layer, point = ideal.layer.astype(np.int64), ideal.point.astype(np.int64)
        inside = (layer >= 0) & (layer < LAYERS) & (point >= 0) & (point < POINTS)
        rows = np.flatnonzero(inside)
        cell = layer[rows] * POINTS + point[rows]
        if len(cell) and not bool(np.all(cell[1:] > cell[:-1])):
            rows = rows[np.lexsort((slot[rows], cell))]
        count = np.bincount(cell, minlength=_CELLS)
        first = np.cumsum(count) - count
        fired = count > 0
        near = None
        if len(rows) and not fired.all():
            near = nearest_marked(fired.reshape(LAYERS, POINTS)).ravel()
        return cls(
            first=first,
            count=count,
            order=rows,
            slot=slot,
            near=near,
            stride=(_stride(layer[rows]), _stride(point[rows])),
        )

    @property
    def single(self) -> bool:
        """Whether every cell has exactly one row."""
        return len(self.order) == _CELLS and self.near is None

    def rows(self, cell: IndexArray, slot: npt.NDArray[np.int32] | IndexArray) -> IndexArray:
        """The row of that rank in each cell, or the last there; in a cell that was not fired, the nearest one's.

        -1 throughout when there are no rows at all.
        """
        if len(self.order) == 0:
            return np.full(len(cell), -1, dtype=np.int64)
        if self.single:
            return self.order[cell]
        if self.near is not None:
            cell = self.near[cell]
        return self.order[self.first[cell] + np.minimum(slot, self.count[cell] - 1)]

    def beside(self, ideal: IdealScan, layers: int, points: int) -> IndexArray:
        """For each row the row of equal rank that many strides up and to the left, shape (n,); -1: there is none."""
        layer = ideal.layer.astype(np.int64) + layers * self.stride[0]
        point = ideal.point.astype(np.int64) + points * self.stride[1]
        inside = (layer >= 0) & (layer < LAYERS) & (point >= 0) & (point < POINTS)
        cell = np.where(inside, layer * POINTS + point, 0)
        if self.single:
            return np.where(inside, self.order[cell], -1)
        there = inside & (self.slot < self.count[cell])
        place = np.where(there, self.first[cell] + self.slot, 0)
        return np.where(there, self.order[place], -1) if len(self.order) else np.full(len(layer), -1)


def _stride(index: IndexArray) -> int:
    """The greatest step that leads from each of these indices to all others; 1 for fewer than two."""
    distinct = np.flatnonzero(np.bincount(index, minlength=1)) if len(index) else index
    return int(np.gcd.reduce(np.diff(distinct))) if len(distinct) > 1 else 1
