"""Objects of an ideal scan that move: which rows are theirs, and what they uncover."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.geometry.beam_grid import BeamGrid, nearest_marked
from lidarcheck.effects.geometry.beam_tree import BeamTree
from lidarcheck.rays import Velocity
from lidarcheck.scan import IdealScan

__all__ = ["Mover", "hidden_behind", "mover_of"]

_MARGIN_DEG = 0.5


class Mover(Protocol):
    """An object that moves, of `MovingSurface` or `MovingRows`."""

    @property
    def object_id(self) -> int:
        """Its number."""

    @property
    def velocity_m_s(self) -> Velocity:
        """Its velocity."""

    @property
    def range_m(self) -> tuple[float, float, float]:
        """Its smallest, median and largest distance."""

    def may_meet(self, origin: FloatArray, direction: FloatArray) -> BoolArray:
        """Which rays, seen from the object, pass near it at its distance, shape (n,)."""

    def pick(self, position: FloatArray, slot: npt.NDArray[np.int32]) -> IndexArray:
        """The object's row that is nearest to the direction in which a position lies; rank does not matter."""


def mover_of(
    number: int,
    velocity: Velocity,
    ideal: IdealScan,
    grid: BeamGrid | BeamTree,
    rows: IndexArray,
    point_m: FloatArray,
    shift_m: float,
) -> Mover:
    """The object whose rows (n,), at least one, are given; it and the rays' origins part by at most `shift_m`.

    `point_m`: where rows of the scan meet something.
    """
    distance = ideal.distance_m[rows]
    margin_deg = float(np.rad2deg(elementary.arcsin(min(1.0, shift_m / float(distance.min()))))) + _MARGIN_DEG
    span = float(distance.min()), float(np.median(distance)), float(distance.max())
    if isinstance(grid, BeamTree):
        return MovingRows.of(number, velocity, span, rows, point_m[rows], margin_deg)
    return MovingSurface.of(number, velocity, span, ideal, grid, rows, margin_deg)


@dataclass(frozen=True)
class MovingRows:
    """An object's rows by direction: `tree` of unit vectors; rays within the chord `reach` of one may meet it."""

    object_id: int
    velocity_m_s: Velocity
    range_m: tuple[float, float, float]
    rows: IndexArray
    tree: Any
    reach: float

    @classmethod
    def of(
        cls,
        number: int,
        velocity: Velocity,
        span: tuple[float, float, float],
        rows: IndexArray,
        point_m: FloatArray,
        margin_deg: float,
    ) -> MovingRows:
        """The object whose rows meet it at `point_m` (n, 3)."""
        from scipy.spatial import cKDTree

        seen = _unit(point_m)
        tree = cKDTree(seen)
        # Rows of one object lie as far apart as beams do: what passes between them may meet it.
        apart = float(tree.query(seen, k=2)[0][:, 1].max()) if len(rows) > 1 else 0.0
        reach = 2.0 * float(elementary.sin(np.deg2rad(min(0.5 * margin_deg, 90.0))))
        return cls(number, velocity, span, rows, tree, reach + min(apart, 0.1))

    def may_meet(self, origin: FloatArray, direction: FloatArray) -> BoolArray:
        """Which rays, seen from the object, pass near it at its distance, shape (n,)."""
        met = np.zeros(len(origin), dtype=bool)
        for range_m in self.range_m:
            met |= self.tree.query(_unit(origin + range_m * direction))[0] <= self.reach
        return met

    def pick(self, position: FloatArray, slot: npt.NDArray[np.int32]) -> IndexArray:
        """The object's row that is nearest to the direction in which a position lies; rank does not matter."""
        return np.asarray(self.rows[self.tree.query(_unit(position))[1]])


def _unit(position: FloatArray) -> FloatArray:
    return np.asarray(position / np.maximum(np.sqrt(np.square(position).sum(axis=1, keepdims=True)), 1e-300))


@dataclass(frozen=True)
class MovingSurface:
    """An object's rows within a block of the grid, which reaches as far beyond them as the object's way.

    `block`: first layer, first point, layers, points. `nearest`: for each cell of the block the row of the object that
    is nearest in angle. `range_m`: the object's smallest, median and largest distance.
    """

    object_id: int
    velocity_m_s: Velocity
    range_m: tuple[float, float, float]
    grid: BeamGrid
    block: tuple[int, int, int, int]
    nearest: IndexArray

    @classmethod
    def of(
        cls,
        number: int,
        velocity: Velocity,
        span: tuple[float, float, float],
        ideal: IdealScan,
        grid: BeamGrid,
        rows: IndexArray,
        margin_deg: float,
    ) -> MovingSurface:
        """The object with these rows."""
        beams = grid.beams
        layer = np.clip(ideal.layer[rows], 0, beams.layers - 1).astype(np.int64)
        point = np.clip(ideal.point[rows], 0, beams.points - 1).astype(np.int64)
        pitch = abs(beams.elevation.step_deg), abs(beams.azimuth.step_deg)
        up, aside = int(margin_deg / pitch[0]) + 1, int(margin_deg / pitch[1]) + 1
        low = max(int(layer.min()) - up, 0), max(int(point.min()) - aside, 0)
        high = min(int(layer.max()) + up, beams.layers - 1), min(int(point.max()) + aside, beams.points - 1)
        if beams.azimuth.turns and (point.min() < aside or point.max() >= beams.points - aside):
            low, high = (low[0], 0), (high[0], beams.points - 1)
        block = (*low, high[0] - low[0] + 1, high[1] - low[1] + 1)
        of_cell = np.full(block[2:], -1, dtype=np.int64)
        of_cell[layer[::-1] - low[0], point[::-1] - low[1]] = rows[::-1]
        around = beams.azimuth.turns and block[3] == beams.points
        nearest = of_cell.ravel()[nearest_marked(of_cell >= 0, pitch, around=around).ravel()]
        return cls(number, velocity, span, grid, block, nearest)

    def may_meet(self, origin: FloatArray, direction: FloatArray) -> BoolArray:
        """Which rays, seen from the object, pass its block of the grid at its distance, shape (n,)."""
        met = np.zeros(len(origin), dtype=bool)
        for reach in self.range_m:
            met |= self._inside(self.grid.nearest_cell(origin + reach * direction))
        return met

    def pick(self, position: FloatArray, slot: npt.NDArray[np.int32]) -> IndexArray:
        """The object's row that is nearest to the direction in which a position lies; rank does not matter."""
        layer, point = np.divmod(self.grid.nearest_cell(position), self.grid.beams.points)
        line = np.clip(layer - self.block[0], 0, self.block[2] - 1)
        column = np.clip(point - self.block[1], 0, self.block[3] - 1)
        return np.asarray(self.nearest[line * self.block[3] + column])

    def _inside(self, cell: IndexArray) -> BoolArray:
        layer, point = np.divmod(cell, self.grid.beams.points)
        line, column = layer - self.block[0], point - self.block[1]
        return np.asarray((line >= 0) & (line < self.block[2]) & (column >= 0) & (column < self.block[3]))


def hidden_behind(ideal: IdealScan, grid: BeamGrid | BeamTree, moving: Set[int]) -> IndexArray | None:
    """For each row what is seen there once the moving objects are gone, shape (n,); None where nothing moves.

    The row itself where it does not move; else, of the nearest rows to the left and to the right in its layer that do
    not move and are not in front, the nearer one in angle; -1 where there is none. Of beams that stand in no lines,
    the nearest row in any direction.
    """
    if not moving or ideal.object_id is None:
        return None
    moves = np.isin(ideal.object_id, list(moving)) & (ideal.distance_m > 0.0)
    mine = grid.order[moves[grid.order]]
    layers = ideal.beams.layers
    nearest_m = np.full(layers, np.inf)
    np.minimum.at(nearest_m, ideal.layer[mine], ideal.distance_m[mine])
    if not ideal.beams.lattice:
        nearest_m[:] = nearest_m.min()
    in_front = (ideal.distance_m > 0.0) & (ideal.distance_m < nearest_m[np.clip(ideal.layer, 0, layers - 1)])
    stays = grid.order[~(moves | in_front)[grid.order]][::-1]
    behind = np.arange(len(ideal))
    behind[mine] = _in_layer(ideal, mine, stays) if ideal.beams.lattice else _in_any_direction(ideal, mine, stays)
    behind[moves & (behind == np.arange(len(ideal)))] = -1
    return behind


def _in_layer(ideal: IdealScan, mine: IndexArray, stays: IndexArray) -> IndexArray:
    """For each of the rows `mine` the nearest of the rows `stays` in its layer, not nearer than itself; -1: none."""
    layers, points = ideal.beams.layers, ideal.beams.points
    at_rest = np.full(layers * points, -1, dtype=np.int64)
    at_rest[ideal.layer[stays].astype(np.int64) * points + ideal.point[stays]] = stays
    fired = (at_rest >= 0).reshape(layers, points)
    column = np.arange(points)
    right = np.maximum.accumulate(np.where(fired, column, -1), axis=1)
    left = np.minimum.accumulate(np.where(fired, column, points)[:, ::-1], axis=1)[:, ::-1]
    layer, point = ideal.layer[mine].astype(np.int64), ideal.point[mine].astype(np.int64)
    best, steps = np.full(len(mine), -1, dtype=np.int64), np.full(len(mine), points)
    for side in (right[layer, point], left[layer, point]):
        there = (side >= 0) & (side < points)
        row = at_rest[layer * points + np.where(there, side, 0)]
        distance = np.where(ideal.distance_m[row] > 0.0, ideal.distance_m[row], np.inf)
        better = there & (distance >= ideal.distance_m[mine]) & (np.abs(side - point) < steps)
        best[better], steps[better] = row[better], np.abs(side - point)[better]
    return best


def _in_any_direction(ideal: IdealScan, mine: IndexArray, stays: IndexArray) -> IndexArray:
    """For each of the rows `mine` the nearest in angle of the rows `stays`, not nearer than itself; -1: none."""
    from scipy.spatial import cKDTree

    found = np.full(len(mine), -1, dtype=np.int64)
    if len(stays) == 0 or len(mine) == 0:
        return found
    direction = ideal.beams.directions(ideal.layer, ideal.point)
    row = stays[cKDTree(direction[stays]).query(direction[mine])[1]]
    distance = np.where(ideal.distance_m[row] > 0.0, ideal.distance_m[row], np.inf)
    return np.where(distance >= ideal.distance_m[mine], row, -1)
