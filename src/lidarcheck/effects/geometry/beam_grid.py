"""Which rows of an ideal scan lie in which direction: beams in even steps of elevation and azimuth as a grid.

`lidarcheck.effects.geometry.beam_tree` does the same for beams of any other kind; `lattice.lattice_of` chooses.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.scan import IdealScan
from lidarcheck.sensor.grid import Axis, GridBeams

if TYPE_CHECKING:
    from lidarcheck.effects.geometry.compiled import Lines, Rows

__all__ = ["BeamGrid", "nearest_marked"]

_MARGIN_DEG = 1.0
"""A straight way that has left the field of view by so much does not come back."""


def _uniforms(salt: int, cells: int) -> npt.NDArray[np.float32]:
    """A number between 0 and 1 for each cell, always the same, as if drawn at random; shape (cells,)."""
    word = np.arange(cells, dtype=np.uint64) + np.uint64(salt * cells)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        word = (word ^ (word >> np.uint64(shift))) * np.uint64(factor)
    word ^= word >> np.uint64(31)
    return np.asarray(((word >> np.uint64(41)).astype(np.float32) + 0.5) / 2.0**23, dtype=np.float32)


@functools.lru_cache(maxsize=4)
def borders(cells: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Where, between each cell's middle and that of the next one up and to the left, the border is taken to be."""
    return _uniforms(1, cells), _uniforms(2, cells)


def nearest_marked(mark: BoolArray, sampling: tuple[float, float], *, around: bool = False) -> IndexArray:
    """The marked cell nearest in angle to each cell of a block of the grid, as flat indices; the mark must have one.

    `sampling`: angle from a line to the next, either way. `around`: whether the last column lies beside the first.
    """
    from scipy.ndimage import distance_transform_edt

    columns = mark.shape[1]
    wide = np.tile(mark, (1, 3)) if around else mark
    indices: IndexArray = distance_transform_edt(~wide, sampling=sampling, return_distances=False, return_indices=True)
    line, column = indices[0].astype(np.int64), indices[1]
    if around:
        line, column = line[:, columns : 2 * columns], column[:, columns : 2 * columns] % columns
    return np.asarray(line * columns + column)


@dataclass(frozen=True)
class BeamGrid:
    """The rows of each cell: cell c has `order[first[c]]` ... `order[first[c] + count[c] - 1]`, in order of rank.

    A cell is a beam of the sensor: c = layer times `beams.points` + point. `first`, `count` (cells,), `order` (n,);
    `slot` (n,): each row's rank within its beam. `near` (cells,): the nearest cell that was fired, None where all were.
    `stride`: the layers, the points between neighbouring fired beams.
    """

    beams: GridBeams
    first: IndexArray
    count: IndexArray
    order: IndexArray
    slot: npt.NDArray[np.int32]
    near: IndexArray | None
    stride: tuple[int, int]
    offset: tuple[int, int]

    @classmethod
    def of(cls, ideal: IdealScan, beams: GridBeams, slot: npt.NDArray[np.int32]) -> BeamGrid:
        """The grid of a scan's rows and their ranks; rows of beams that the sensor does not have are left out."""
        layer, point = ideal.layer.astype(np.int64), ideal.point.astype(np.int64)
        rows = np.flatnonzero(beams.has(layer, point))
        cell = beams.index(layer[rows], point[rows])
        if len(cell) and not bool(np.all(cell[1:] > cell[:-1])):
            rows = rows[np.lexsort((slot[rows], cell))]
        count = np.bincount(cell, minlength=beams.size)
        first = np.cumsum(count) - count
        fired = count > 0
        near = None
        if len(rows) and not fired.all():
            mark = fired.reshape(beams.layers, beams.points)
            near = nearest_marked(mark, _pitch_deg(beams), around=beams.azimuth.turns).ravel()
        stride = _stride(layer[rows]), _stride(point[rows])
        offset = _first(layer[rows], stride[0]), _first(point[rows], stride[1])
        return cls(beams, first, count, rows, slot, near, stride, offset)

    @property
    def single(self) -> bool:
        """Whether every cell has exactly one row."""
        return len(self.order) == self.beams.size and self.near is None

    @property
    def steps_rad(self) -> tuple[float, float]:
        """Angle from a fired layer, and from a fired point, to the next one; below 0 where its angle falls."""
        elevation, azimuth = self.beams.elevation.step_deg, self.beams.azimuth.step_deg
        return float(np.deg2rad(elevation * self.stride[0])), float(np.deg2rad(azimuth * self.stride[1]))

    @property
    def goes_round(self) -> bool:
        """Whether the last fired points lie beside the first."""
        return self.beams.azimuth.turns and self.beams.points % self.stride[1] == 0

    def nearest_cell(self, position: FloatArray) -> IndexArray:
        """The cell in whose direction each position (n, 3) lies; the border's beyond it."""
        from lidarcheck.effects.geometry.compiled import nearest_cells

        found = np.empty(len(position), dtype=np.int64)
        nearest_cells(np.ascontiguousarray(position), self.lines, self.beams.azimuth.turns, found)
        return found

    def cells(self, position: FloatArray) -> IndexArray:
        """The cell whose surface reaches to the direction of each position (n, 3); a fired beam's own on its axis.

        Where between two beams a surface ends is not known. It is taken to end anywhere between them, elsewhere for
        each pair and always there for the same one: a view turned by a third of a beam spacing then moves a third of
        all edges by one beam, as it does on average in a scene, instead of none.
        """
        from lidarcheck.effects.geometry.compiled import shared_cells

        found = np.empty(len(position), dtype=np.int64)
        shared_cells(np.ascontiguousarray(position), self.lines, borders(self.beams.size), found)
        return found

    def rows(self, cell: IndexArray, slot: npt.NDArray[np.int32] | IndexArray) -> IndexArray:
        """The row of that rank in each cell, or the last there; in a cell that was not fired, the nearest one's."""
        if self.single:
            return self.order[cell]
        if self.near is not None:
            cell = self.near[cell]
        return self.order[self.first[cell] + np.minimum(slot, self.count[cell] - 1)]

    def beside(self, ideal: IdealScan, layers: int, points: int) -> IndexArray:
        """For each row the row of equal rank that many strides up and to the left, shape (n,); -1: there is none."""
        layer = ideal.layer.astype(np.int64) + layers * self.stride[0]
        point = ideal.point.astype(np.int64) + points * self.stride[1]
        if self.goes_round:
            point = point % self.beams.points
        inside = self.beams.has(layer, point)
        cell = np.where(inside, self.beams.index(layer, point), 0)
        if self.single:
            return np.where(inside, self.order[cell], -1)
        there = inside & (self.slot < self.count[cell])
        place = np.where(there, self.first[cell] + self.slot, 0)
        return np.where(there, self.order[place], -1)

    def cells_of(self, ideal: IdealScan) -> Rows:
        """Which cell each row lies in, and each cell's rows, as compiled code knows them."""
        from lidarcheck.effects.geometry.compiled import Rows

        return Rows(ideal.layer, ideal.point, self.slot, self.first, self.count, self.order)

    def neighbours(self, ideal: IdealScan) -> tuple[IndexArray, ...]:
        """For each row those beside it, -1 for none: shape (n,) each."""
        return tuple(self.beside(ideal, *step) for step in ((1, 0), (-1, 0), (0, 1), (0, -1)))

    def spread(self, rows: BoolArray, reach_rad: tuple[float, float]) -> BoolArray:
        """The cells from which one of the marked rows' cells lies within that angle up or down, and aside; (cells,)."""
        from scipy.ndimage import maximum_filter1d

        out = self.on_cells(rows).reshape(self.beams.layers, self.beams.points).astype(np.uint8)
        for axis, (reach, pitch, stride) in enumerate(zip(reach_rad, _pitch_deg(self.beams), self.stride, strict=True)):
            half = int(np.ceil(reach / np.deg2rad(pitch))) + stride - 1
            if half > 0:
                mode = "wrap" if axis == 1 and self.beams.azimuth.turns else "constant"
                out = maximum_filter1d(out, min(2 * half + 1, 2 * out.shape[axis] - 1), axis=axis, mode=mode)
        return np.asarray(out.ravel() > 0)

    def on_cells(self, rows: BoolArray) -> BoolArray:
        """The cells that have one of the marked rows (n,); shape (cells,)."""
        count = np.zeros(len(self.order) + 1, dtype=np.int64)
        np.cumsum(rows[self.order], out=count[1:])
        return np.asarray(count[self.first + self.count] > count[self.first])

    def fired(self, cell: IndexArray) -> IndexArray:
        """The nearest cell that was fired to each cell, shape (n,)."""
        return cell if self.near is None else self.near[cell]

    def seen(
        self, x: npt.NDArray[np.float32], y: npt.NDArray[np.float32], z: npt.NDArray[np.float32]
    ) -> tuple[IndexArray, BoolArray, BoolArray]:
        """Of positions (n,) the cell, whether they lie in the field of view, and whether far out of it; shape (n,)."""
        elevation, azimuth = self.beams.elevation, self.beams.azimuth
        flat = np.sqrt(x * x + y * y)
        layer = np.rint(_fraction32(elementary.arctan2(z, flat), elevation)).astype(np.int32)
        side = elementary.arctan2(y, x)
        if not (azimuth.turns or self._plain):
            side = self._unwrapped(side)
        point = np.rint(_fraction32(side, azimuth)).astype(np.int32)
        layers, points = self.beams.layers, self.beams.points
        far = int(np.ceil(_MARGIN_DEG / abs(elevation.step_deg))), int(np.ceil(_MARGIN_DEG / abs(azimuth.step_deg)))
        gone = (layer < -far[0]) | (layer >= layers + far[0])
        if azimuth.turns:
            point %= np.int32(points)
        else:
            gone |= (point < -far[1]) | (point >= points + far[1])
        inside = (layer >= 0) & (layer < layers) & (point >= 0) & (point < points)
        return np.where(inside, layer * np.int32(points) + point, 0), inside, gone

    @functools.cached_property
    def lines(self) -> Lines:
        """Layers and points as compiled code knows them."""
        from lidarcheck.effects.geometry.compiled import Lines

        up, aside = self.beams.elevation, self.beams.azimuth
        return Lines(
            (float(1.0 / np.deg2rad(up.step_deg)), float(1.0 / np.deg2rad(aside.step_deg))),
            (up.first_deg / up.step_deg, aside.first_deg / aside.step_deg),
            self._middle_rad,
            self._plain,
            (self.beams.layers, self.beams.points),
            self.stride,
            self.offset,
            self.goes_round,
        )

    @property
    def _plain(self) -> bool:
        """Whether no azimuth lies beyond half a turn."""
        azimuth = self.beams.azimuth
        return max(abs(azimuth.first_deg), abs(float(azimuth.angle_deg(azimuth.count - 1)))) < 180.0

    @property
    def _middle_rad(self) -> float:
        """The azimuth in the middle of the field of view."""
        axis = self.beams.azimuth
        return float(np.deg2rad(float(axis.angle_deg(0.5 * (axis.count - 1)))))

    def _unwrapped(self, azimuth_rad: FloatArray) -> FloatArray:
        """The same angles within half a turn of the middle of the field of view."""
        turns = np.rint((self._middle_rad - azimuth_rad) / (2.0 * np.pi))
        return np.asarray(azimuth_rad + (2.0 * np.pi * turns).astype(azimuth_rad.dtype))


def _pitch_deg(beams: GridBeams) -> tuple[float, float]:
    """Angle between neighbouring layers, and between neighbouring points."""
    return abs(beams.elevation.step_deg), abs(beams.azimuth.step_deg)


def _fraction32(angle_rad: npt.NDArray[np.float32], axis: Axis) -> npt.NDArray[np.float32]:
    per_rad = np.float32(np.rad2deg(1.0 / axis.step_deg))
    return np.asarray(angle_rad * per_rad + np.float32(-axis.first_deg / axis.step_deg))


def _first(index: IndexArray, stride: int) -> int:
    return int(index[0]) % stride if len(index) else 0


def _stride(index: IndexArray) -> int:
    """The greatest step that leads from each of these indices to all others; 1 for fewer than two."""
    distinct = np.flatnonzero(np.bincount(index, minlength=1)) if len(index) else index
    return int(np.gcd.reduce(np.diff(distinct))) if len(distinct) > 1 else 1
