"""Objects of an ideal scan that move: which rows are theirs, and what they uncover."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.geometry.beam_grid import BeamGrid, cells_of, nearest_marked
from lidarcheck.rays import Velocity
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import LAYERS, POINTS

__all__ = ["MovingSurface", "hidden_behind"]


@dataclass(frozen=True)
class MovingSurface:
    """An object's rows within a block of the grid, which reaches as far beyond them as the object's way.

    `block`: first layer, first point, layers, points. `nearest`: for each cell of the block the row of the object that
    is nearest in angle. `range_m`: the object's smallest, median and largest distance.
    """

    object_id: int
    velocity_m_s: Velocity
    range_m: tuple[float, float, float]
    block: tuple[int, int, int, int]
    nearest: IndexArray

    @classmethod
    def of(
        cls, number: int, velocity: Velocity, ideal: IdealScan, grid: BeamGrid, rows: IndexArray, shift_m: float
    ) -> MovingSurface:
        """The object whose rows (n,), at least one, are given; it and the rays' origins part by at most `shift_m`."""
        distance = ideal.distance_m[rows]
        layer = np.clip(ideal.layer[rows], 0, LAYERS - 1).astype(np.int64)
        point = np.clip(ideal.point[rows], 0, POINTS - 1).astype(np.int64)
        margin_deg = np.rad2deg(elementary.arcsin(min(1.0, shift_m / float(distance.min())))) + 0.5
        up, aside = int(margin_deg / 0.05) + 1, int(margin_deg / 0.125) + 1
        low = max(int(layer.min()) - up, 0), max(int(point.min()) - aside, 0)
        high = min(int(layer.max()) + up, LAYERS - 1), min(int(point.max()) + aside, POINTS - 1)
        block = (*low, high[0] - low[0] + 1, high[1] - low[1] + 1)
        of_cell = np.full(block[2:], -1, dtype=np.int64)
        of_cell[layer[::-1] - low[0], point[::-1] - low[1]] = rows[::-1]
        nearest = of_cell.ravel()[nearest_marked(of_cell >= 0).ravel()]
        span = float(distance.min()), float(np.median(distance)), float(distance.max())
        return cls(number, velocity, span, block, nearest)

    def may_meet(self, origin: FloatArray, direction: FloatArray) -> BoolArray:
        """Which rays, seen from the object, pass its block of the grid at its distance, shape (n,)."""
        met = np.zeros(len(origin), dtype=bool)
        for reach in self.range_m:
            met |= self._inside(cells_of(origin + reach * direction))
        return met

    def pick(self, position: FloatArray, slot: npt.NDArray[np.int32]) -> IndexArray:
        """The object's row that is nearest to the direction in which a position lies; rank does not matter."""
        cell = cells_of(position)
        line = np.clip(cell // POINTS - self.block[0], 0, self.block[2] - 1)
        column = np.clip(cell % POINTS - self.block[1], 0, self.block[3] - 1)
        return np.asarray(self.nearest[line * self.block[3] + column])

    def _inside(self, cell: IndexArray) -> BoolArray:
        line, column = cell // POINTS - self.block[0], cell % POINTS - self.block[1]
        return np.asarray((line >= 0) & (line < self.block[2]) & (column >= 0) & (column < self.block[3]))


def hidden_behind(ideal: IdealScan, grid: BeamGrid, moving: Set[int]) -> IndexArray | None:
    """For each row what is seen there once the moving objects are gone, shape (n,); None where nothing moves.

    The row itself where it does not move; else, of the nearest rows to the left and to the right in its layer that do
    not move and are not in front, the nearer one in angle; -1 where there is none.
    """
    if not moving or ideal.object_id is None:
        return None
    moves = np.isin(ideal.object_id, list(moving)) & (ideal.distance_m > 0.0)
    at_rest = np.full(LAYERS * POINTS, -1, dtype=np.int64)
    nearest_m = np.full(LAYERS, np.inf)
    mine = grid.order[moves[grid.order]]
    np.minimum.at(nearest_m, ideal.layer[mine], ideal.distance_m[mine])
    in_front = (ideal.distance_m > 0.0) & (ideal.distance_m < nearest_m[np.clip(ideal.layer, 0, LAYERS - 1)])
    stays = grid.order[~(moves | in_front)[grid.order]][::-1]
    at_rest[ideal.layer[stays].astype(np.int64) * POINTS + ideal.point[stays]] = stays
    fired = (at_rest >= 0).reshape(LAYERS, POINTS)
    column = np.arange(POINTS)
    right = np.maximum.accumulate(np.where(fired, column, -1), axis=1)
    left = np.minimum.accumulate(np.where(fired, column, POINTS)[:, ::-1], axis=1)[:, ::-1]
    behind = np.arange(len(ideal))
    layer, point = ideal.layer[mine].astype(np.int64), ideal.point[mine].astype(np.int64)
    best, steps = np.full(len(mine), -1, dtype=np.int64), np.full(len(mine), POINTS)
    for side in (right[layer, point], left[layer, point]):
        there = (side >= 0) & (side < POINTS)
        row = at_rest[layer * POINTS + np.where(there, side, 0)]
        distance = np.where(ideal.distance_m[row] > 0.0, ideal.distance_m[row], np.inf)
        better = there & (distance >= ideal.distance_m[mine]) & (np.abs(side - point) < steps)
        best[better], steps[better] = row[better], np.abs(side - point)[better]
    behind[mine] = best
    behind[moves & (behind == np.arange(len(ideal)))] = -1
    return behind
