"""Which rows of an ideal scan lie in which direction, for beams that are no even grid: a search tree of directions."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.geometry.beam_grid import borders
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Beams
from lidarcheck.sensor.channels import ChannelBeams

__all__ = ["BeamTree", "Frame"]

_NEIGHBOURS = 8
_BESIDE, _AROUND = 1.8, 8.0
"""What lies farther away than so many steps from a beam to the next is not beside it: on lines, and off them."""
_LOOKED_AT = 32
"""Among so many nearest ones are those beside a beam that stands in no line, one for each eighth of the circle."""
_MARGIN_DEG = 1.0
_ALONG = 1e-9


@dataclass(frozen=True)
class Frame:
    """Directions as places whose distances count in steps from a beam to the next: what a search tree is made of.

    Of a turning head: columns around a cylinder, and channels up, evenly however far apart they are. Of other beams:
    unit vectors over the median distance between neighbours. `angles_deg` (m,): the channels' elevations, rising.
    """

    step_deg: float
    angles_deg: FloatArray | None = None

    @classmethod
    def of(cls, beams: Beams, cell: IndexArray) -> Frame:
        """The frame for the beams of these numbers, those that were fired."""
        layer, point = np.divmod(cell, beams.points)
        if isinstance(beams, ChannelBeams):
            fired = np.unique(beams.angles_deg(np.unique(layer), 0)[0])
            columns = np.unique(point)
            stride = int(np.gcd.reduce(np.diff(columns))) if len(columns) > 1 else 1
            return cls(abs(beams.step_deg) * stride, fired)
        some = np.linspace(0, len(cell) - 1, min(len(cell), 20_000)).astype(np.int64)
        spacing = beams.spacing_deg(layer[some], point[some])[0] if len(cell) else np.full(1, np.nan)
        known = spacing[np.isfinite(spacing) & (spacing > 0.0)]
        return cls(float(np.median(known)) if len(known) else 1.0)

    def places(self, position: FloatArray) -> FloatArray:
        """The places of the directions in which positions (n, 3) lie, shape (n, 3)."""
        step = np.deg2rad(self.step_deg)
        x, y, z = position.T
        if self.angles_deg is None:
            return np.asarray(position / (step * np.maximum(np.sqrt(x * x + y * y + z * z), 1e-300)[:, None]))
        flat = np.maximum(np.sqrt(x * x + y * y), 1e-300)
        line = _line(np.rad2deg(elementary.arctan2(z, flat)), self.angles_deg)
        return np.stack([x / (step * flat), y / (step * flat), line], axis=1)


def _line(angle_deg: FloatArray, lines_deg: FloatArray) -> FloatArray:
    """The place of angles among lines, with fractions; beyond the last line steps go on as wide as there."""
    if len(lines_deg) < 2:
        return np.zeros(len(angle_deg))
    below = np.clip(np.searchsorted(lines_deg, angle_deg) - 1, 0, len(lines_deg) - 2)
    return np.asarray(below + (angle_deg - lines_deg[below]) / (lines_deg[below + 1] - lines_deg[below]))


@dataclass(frozen=True)
class BeamTree:
    """The rows of each cell: cell c has `order[first[c]]` ... `order[first[c] + count[c] - 1]`, in order of rank.

    A cell is a beam that was fired, cells in order of (layer, point), seen from the sensor's middle in the direction
    `direction` (cells, 3) in which its first row lies: beams need not begin there. `cell_of` (n,): each row's cell, -1
    for beams that the sensor does not have. `slot` (n,): each row's rank within its beam. `axis`, `origin_m`
    (cells, 3): the rays of the cells' first rows.
    """

    beams: Beams
    first: IndexArray
    count: IndexArray
    order: IndexArray
    slot: npt.NDArray[np.int32]
    cell_of: IndexArray
    direction: FloatArray
    axis: FloatArray
    origin_m: FloatArray
    frame: Frame

    @classmethod
    def of(cls, ideal: IdealScan, slot: npt.NDArray[np.int32], direction: FloatArray, origin_m: FloatArray) -> BeamTree:
        """The tree of a scan's rows and their ranks; `direction`, `origin_m` (n, 3): of the rows' rays."""
        beams = ideal.beams
        rows = np.flatnonzero(beams.has(ideal.layer, ideal.point))
        number = beams.index(ideal.layer[rows], ideal.point[rows])
        rows = rows[np.lexsort((slot[rows], number))]
        fired, count = np.unique(number, return_counts=True)
        first = np.cumsum(count) - count
        cell_of = np.full(len(ideal), -1, dtype=np.int64)
        cell_of[rows] = np.repeat(np.arange(len(fired)), count)
        lead = rows[first] if len(rows) else rows
        axis, origin = direction[lead], origin_m[lead]
        met = np.where(ideal.distance_m[lead] > 0.0, ideal.distance_m[lead], 0.0)[:, None]
        seen = np.where(met > 0.0, origin + met * axis, axis)
        seen /= np.maximum(np.sqrt(np.square(seen).sum(axis=1, keepdims=True)), 1e-300)
        return cls(beams, first, count, rows, slot, cell_of, seen, axis, origin, Frame.of(beams, fired))

    @functools.cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.frame.places(self.direction))

    @functools.cached_property
    def _axes(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.axis)

    def own_cell(self, direction: FloatArray, origin_m: FloatArray) -> IndexArray:
        """The cell whose ray each ray is, shape (n,); -1 for rays that are none's."""
        apart, cell = self._axes.query(direction, distance_upper_bound=_ALONG)
        cell = np.where(np.isfinite(apart), cell, 0).astype(np.int64)
        same = np.isfinite(apart) & (np.abs(self.origin_m[cell] - origin_m).max(axis=1, initial=0.0) < _ALONG)
        return np.where(same, cell, -1)

    def nearest_cell(self, position: FloatArray) -> IndexArray:
        """The cell in whose direction each position (n, 3) lies, or the nearest one to it."""
        if len(self.count) == 0:
            return np.zeros(len(position), dtype=np.int64)
        return np.asarray(self._tree.query(self.frame.places(position))[1], dtype=np.int64)

    def cells(self, position: FloatArray) -> IndexArray:
        """The cell whose surface reaches to the direction of each position (n, 3); a fired beam's own on its axis.

        Between the two nearest beams a surface may end anywhere, elsewhere for each pair; see `BeamGrid.cells`.
        """
        if len(self.count) < 2:
            return self.nearest_cell(position)
        apart, cell = self._tree.query(self.frame.places(position), k=2)
        low, high = np.minimum(cell[:, 0], cell[:, 1]), np.maximum(cell[:, 0], cell[:, 1])
        from_low = np.where(cell[:, 0] == low, apart[:, 0], apart[:, 1])
        whole = apart.sum(axis=1)
        border = np.mod(borders(len(self.count))[0][low] + borders(len(self.count))[1][high], 1.0)
        part = np.divide(from_low, whole, out=np.zeros(len(low)), where=whole > 0.0)
        return np.asarray(np.where(part > np.clip(border, 1e-7, 1.0 - 1e-7), high, low), dtype=np.int64)

    def rows(self, cell: IndexArray, slot: npt.NDArray[np.int32] | IndexArray) -> IndexArray:
        """The row of that rank in each cell, or the last there."""
        return self.order[self.first[cell] + np.minimum(slot, self.count[cell] - 1)]

    @functools.cached_property
    def beside(self) -> IndexArray:
        """The cells around each cell, -1 where there are fewer: shape (cells, 8)."""
        cells = len(self.count)
        lines = self.frame.angles_deg is not None
        found = np.full((cells, _NEIGHBOURS), -1, dtype=np.int64)
        if cells < 2:
            return found
        most = min((_NEIGHBOURS if lines else _LOOKED_AT) + 1, cells)
        apart, cell = self._tree.query(self._tree.data, k=most, distance_upper_bound=_BESIDE if lines else _AROUND)
        # A cell that shares its direction with another may not come first among its own neighbours.
        cell = np.where(np.isfinite(apart) & (cell != np.arange(cells)[:, None]), cell, -1)
        if lines:
            found[:, : most - 1] = np.take_along_axis(cell, np.argsort(cell < 0, axis=1, kind="stable"), 1)[:, :-1]
            return found
        side = np.where(cell >= 0, self._sides(cell), -1)
        for at in range(most - 1, -1, -1):  # nearer ones take the place of those farther away
            some = np.flatnonzero(side[:, at] >= 0)
            found[some, side[some, at]] = cell[some, at]
        return found

    def _sides(self, cell: IndexArray) -> IndexArray:
        """In which eighth of the circle around each cell those cells (cells, k) lie, from 0."""
        up = np.where(np.abs(self.direction[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
        left = np.cross(up, self.direction)
        over = np.cross(self.direction, left)
        off = self.direction[cell] - self.direction[:, None]
        turn = elementary.arctan2(np.einsum("ijk,ik->ij", off, over), np.einsum("ijk,ik->ij", off, left))
        return np.asarray(np.floor(turn * (_NEIGHBOURS / (2.0 * np.pi))).astype(np.int64) % _NEIGHBOURS)

    def neighbours(self, ideal: IdealScan) -> tuple[IndexArray, ...]:
        """For each row those of equal rank beside it, -1 for none: shape (n,) each."""
        return tuple(self._rows_beside(column) for column in self.beside.T)

    def _rows_beside(self, neighbour: IndexArray) -> IndexArray:
        """The row of equal rank in each row's neighbour, (n,), of one neighbour of each cell; -1: there is none."""
        cell = np.where(self.cell_of >= 0, neighbour[self.cell_of], -1) if len(self.count) else self.cell_of
        there = cell >= 0
        there[there] = self.slot[there] < self.count[cell[there]]
        found = np.full(len(cell), -1, dtype=np.int64)
        found[there] = self.order[self.first[cell[there]] + self.slot[there]]
        return found

    def spread(self, rows: BoolArray, reach_rad: tuple[float, float]) -> BoolArray:
        """The cells within that angle, either way, of one of the marked rows' cells, and those beside it; (cells,)."""
        from scipy.spatial import cKDTree

        marked = self.on_cells(rows)
        if not marked.any():
            return marked
        beside = self.beside
        marked |= (marked[beside] & (beside >= 0)).any(axis=1)
        apart = cKDTree(self.direction[marked]).query(self.direction)[0]
        return np.asarray(apart <= max(reach_rad))

    def on_cells(self, rows: BoolArray) -> BoolArray:
        """The cells that have one of the marked rows (n,); shape (cells,)."""
        return np.asarray(np.bincount(self.cell_of[rows & (self.cell_of >= 0)], minlength=len(self.count)) > 0)

    def fired(self, cell: IndexArray) -> IndexArray:
        """The same: all cells were fired."""
        return cell

    def seen(
        self, x: npt.NDArray[np.float32], y: npt.NDArray[np.float32], z: npt.NDArray[np.float32]
    ) -> tuple[IndexArray, BoolArray, BoolArray]:
        """Of positions (n,) the cell, whether they lie in the field of view, and whether far out of it; shape (n,)."""
        position = np.stack([x, y, z], axis=1).astype(np.float64)
        if len(self.count) == 0:
            nowhere = np.zeros(len(x), dtype=bool)
            return np.zeros(len(x), dtype=np.int64), nowhere, ~nowhere
        apart, cell = self._tree.query(self.frame.places(position))
        up = np.rad2deg(elementary.arctan2(position[:, 2], np.sqrt(position[:, 0] ** 2 + position[:, 1] ** 2)))
        low, high = self._elevations
        return cell.astype(np.int64), apart <= 1.0, (up < low - _MARGIN_DEG) | (up > high + _MARGIN_DEG)

    @functools.cached_property
    def _elevations(self) -> tuple[float, float]:
        """The lowest and the highest direction [deg]."""
        x, y, z = self.direction.T
        up = np.rad2deg(elementary.arctan2(z, np.sqrt(x * x + y * y)))
        return float(up.min()), float(up.max())
