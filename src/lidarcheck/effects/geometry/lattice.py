"""The structure in which rows of an ideal scan are found by direction: a grid where beams are one, else a tree."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.geometry.beam_grid import BeamGrid
from lidarcheck.effects.geometry.beam_tree import BeamTree
from lidarcheck.rays import Rays
from lidarcheck.scan import IdealScan
from lidarcheck.sensor.grid import GridBeams

__all__ = ["Lattice", "lattice_of"]


class Lattice(Protocol):
    """What `BeamGrid` and `BeamTree` have in common; cells are numbers from 0 on, (cells,) in all."""

    @property
    def first(self) -> IndexArray:
        """Where each cell's rows begin in `order`, (cells,)."""

    @property
    def count(self) -> IndexArray:
        """How many rows each cell has, (cells,)."""

    @property
    def order(self) -> IndexArray:
        """The rows, cell by cell and by rank."""

    @property
    def slot(self) -> npt.NDArray[np.int32]:
        """Each row's rank within its beam, (n,)."""

    def nearest_cell(self, position: FloatArray) -> IndexArray:
        """The cell in whose direction each position (n, 3) lies, or the nearest one to it."""

    def cells(self, position: FloatArray) -> IndexArray:
        """The cell whose surface reaches to the direction of each position (n, 3); a fired beam's own on its axis."""

    def rows(self, cell: IndexArray, slot: npt.NDArray[np.int32] | IndexArray) -> IndexArray:
        """The row of that rank in each cell, or the last there; there must be one in some cell."""

    def neighbours(self, ideal: IdealScan) -> tuple[IndexArray, ...]:
        """For each row those of equal rank beside it, -1 for none: shape (n,) each."""

    def spread(self, rows: BoolArray, reach_rad: tuple[float, float]) -> BoolArray:
        """The cells near which one of the marked rows lies: within that angle up or down, and aside."""

    def on_cells(self, rows: BoolArray) -> BoolArray:
        """The cells that have one of the marked rows (n,)."""

    def fired(self, cell: IndexArray) -> IndexArray:
        """The nearest cell that was fired to each cell."""

    def seen(
        self, x: npt.NDArray[np.float32], y: npt.NDArray[np.float32], z: npt.NDArray[np.float32]
    ) -> tuple[IndexArray, BoolArray, BoolArray]:
        """Of positions (n,) the cell, whether they lie in the field of view, and whether far out of it."""


def lattice_of(ideal: IdealScan, rays: Rays) -> BeamGrid | BeamTree:
    """The structure for a scan's rows, whose rays are given."""
    if isinstance(ideal.beams, GridBeams):
        return BeamGrid.of(ideal, ideal.beams, rays.slot)
    return BeamTree.of(ideal, rays.slot, rays.direction, rays.origin_m)
