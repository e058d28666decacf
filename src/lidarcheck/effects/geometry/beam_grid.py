"""Which rows of an ideal scan lie in which direction: the sensor's beams as a grid."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import LAYERS, POINTS

__all__ = ["BeamGrid", "cells_of", "nearest_marked"]

_CELLS = LAYERS * POINTS
_LAYER_RAD, _POINT_RAD = np.deg2rad(0.05), np.deg2rad(0.125)


def cells_of(position: FloatArray) -> IndexArray:
    """The grid cell (layer times 960 + point) in whose direction each position (n, 3) lies; the border's beyond it."""
    layer, point = (np.rint(line).astype(np.int64) for line in _lines(position))
    return np.asarray(np.clip(layer, 0, LAYERS - 1) * POINTS + np.clip(point, 0, POINTS - 1))


def _lines(position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Layer and point in whose direction each position (n, 3) lies, with fractions."""
    x, y, z = position[:, 0], position[:, 1], position[:, 2]
    layer = elementary.arctan2(z, np.sqrt(x * x + y * y)) * (1.0 / _LAYER_RAD) + 259.5
    return layer, elementary.arctan2(y, x) * (1.0 / _POINT_RAD) + 479.5


def _uniforms(salt: int) -> npt.NDArray[np.float32]:
    """A number between 0 and 1 for each cell, always the same, as if drawn at random; shape (cells,)."""
    word = np.arange(_CELLS, dtype=np.uint64) + np.uint64(salt * _CELLS)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        word = (word ^ (word >> np.uint64(shift))) * np.uint64(factor)
    word ^= word >> np.uint64(31)
    return np.asarray(((word >> np.uint64(41)).astype(np.float32) + 0.5) / 2.0**23, dtype=np.float32)


@functools.cache
def _borders() -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Where, between each cell's middle and that of the next one up and to the left, the border is taken to be."""
    return _uniforms(1), _uniforms(2)


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
    offset: tuple[int, int]

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
            stride=(stride := (_stride(layer[rows]), _stride(point[rows]))),
            offset=(_first(layer[rows], stride[0]), _first(point[rows], stride[1])),
        )

    @property
    def single(self) -> bool:
        """Whether every cell has exactly one row."""
        return len(self.order) == _CELLS and self.near is None

    def cells(self, position: FloatArray) -> IndexArray:
        """The cell whose surface reaches to the direction of each position (n, 3); a fired beam's own on its axis.

        Where between two beams a surface ends is not known. It is taken to end anywhere between them, elsewhere for
        each pair and always there for the same one: a view turned by a third of a beam spacing then moves a third of
        all edges by one beam, as it does on average in a scene, instead of none.
        """
        layer, point = _lines(position)
        up, aside = _borders()
        (s, t), (a, b) = self.stride, self.offset
        i, over = _split((layer - a) / s, (LAYERS - 1 - a) // s)
        j, beyond = _split((point - b) / t, (POINTS - 1 - b) // t)
        cell = (i * s + a) * POINTS + j * t + b
        return np.asarray(cell + (over > up[cell]) * (s * POINTS) + (beyond > aside[cell]) * t)

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


def _split(line: FloatArray, last: int) -> tuple[IndexArray, FloatArray]:
    """The line at or below each number and how far beyond it that is, 0 ... 1; within 0 ... last."""
    line = np.clip(line + 1e-7, 0.0, last)
    below = np.minimum(line.astype(np.int64), last)
    return below, line - below


def _first(index: IndexArray, stride: int) -> int:
    return int(index[0]) % stride if len(index) else 0


def _stride(index: IndexArray) -> int:
    """The greatest step that leads from each of these indices to all others; 1 for fewer than two."""
    distinct = np.flatnonzero(np.bincount(index, minlength=1)) if len(index) else index
    return int(np.gcd.reduce(np.diff(distinct))) if len(distinct) > 1 else 1
