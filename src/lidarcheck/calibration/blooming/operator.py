"""Blooming as a linear operator: the light of cells from the rows of a table, just as the model's effect sums it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.blooming.cells import Cells
from lidarcheck.formats.lut import Axis, LutTable

__all__ = ["Nodes", "light_of_table", "nodes_of", "spread"]

LEAST_Y = 1e-7
"""The smallest Y that a file with 7 decimals can hold."""


@dataclass(frozen=True)
class Nodes:
    """The distinct X of a table and its Y there, shape (k,); `row` (rows,): the node of each row of the table.

    `mirrored`: the table has no negative X and holds for both sides.
    """

    x: FloatArray
    y: FloatArray
    row: IndexArray
    mirrored: bool

    def __len__(self) -> int:
        return len(self.x)

    @property
    def reach(self) -> tuple[float, float]:
        """The offsets that the table covers."""
        return (-float(self.x[-1]) if self.mirrored else float(self.x[0])), float(self.x[-1])


def nodes_of(table: LutTable, axis: Axis) -> Nodes:
    """The nodes of a table; of rows with one X the last holds, as in the model."""
    x, row = np.unique(table.x, return_inverse=True)
    last = np.searchsorted(table.x, x, side="right") - 1
    return Nodes(x, table.y[last], row.astype(np.int64), axis == "horizontal" and bool(x[0] >= 0.0))


def spread(cells: Cells, nodes: Nodes) -> FloatArray:
    """S that a cell gets per unit of Y of each node, shape (cells, k): sum over the bright beams of its line.

    A bright beam itself gains nothing; between the nodes Y is linear, outside of them 0.
    """
    matrix = np.zeros((len(cells), len(nodes)))
    for number, source in enumerate(cells.sources):
        rows = np.flatnonzero(cells.line == number)
        x = cells.offset[rows][:, None] - source.offset
        weight = np.where(np.abs(x) < 1e-6, 0.0, source.signal)
        x = np.abs(x) if nodes.mirrored else x
        for k in range(len(nodes)):
            hat = np.interp(x, nodes.x, np.eye(len(nodes))[k], left=0.0, right=0.0)
            matrix[rows, k] = (hat * weight).sum(axis=1)
    return matrix


def light_of_table(cells: Cells, nodes: Nodes) -> FloatArray:
    """S of each cell with the table's bloom, shape (cells,)."""
    return np.asarray(cells.target + cells.other + spread(cells, nodes) @ nodes.y)
