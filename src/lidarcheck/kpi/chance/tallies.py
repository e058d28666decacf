"""What is kept of a frame's rows, unit by unit: sums and histograms, from which every exchange follows by a product.

`Blocks` name a row's unit. All tallies hold for each frame an array (2, units of the frame, ...): measured, simulated.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.kpi.distances import shared_edges
from lidarcheck.kpi.lattice import piece_of
from lidarcheck.sensor import Beams

__all__ = ["BLOCK_COLUMNS", "Histogram", "Sums", "block_of", "blocks_of"]

BLOCK_COLUMNS = 16
"""Point columns of a block: what one packet of a sensor holds, and more than a shake or a lost patch spans."""
_BINS = 1024
"""Bins of a histogram: by a thousandth of the rows each, finer than any KPI's chance. Few distinct values get one each.
"""
_BEYOND = 2.0 ** np.arange(-8.0, 4.0)
"""How far bins go beyond the first frame's values, in parts of their span: later frames may reach farther."""


def block_of(point: IntArray) -> IndexArray:
    """The block of beams by their point column, from 1; 0 for a beam that is not known; shape (n,)."""
    return np.where(point >= 0, point // BLOCK_COLUMNS + 1, 0).astype(np.int64)


def blocks_of(beams: Beams, *numbers: tuple[IntArray, IntArray]) -> list[IndexArray]:
    """The unit of each of several tables of beams' (layer, point), from 1, 0 for a beam that is not known: its block
    of columns, or, where beams have no neighbours by their numbers, which of 40 equal pieces of the frame it is in."""
    if beams.lattice:
        return [block_of(point) for _, point in numbers]
    points = 1 + max(int(point.max(initial=0)) for _, point in numbers)
    return [
        np.where(point >= 0, piece_of(beams, layer, point, points) + 1, 0).astype(np.int64) for layer, point in numbers
    ]


@dataclass
class Sums:
    """Numbers that add up, for each frame an array (2, units, ...) by the frame's number."""

    frames: dict[int, FloatArray] = field(default_factory=dict)

    def merge(self) -> None:
        """Make each frame one unit."""
        self.frames = {number: part.sum(axis=1, keepdims=True) for number, part in self.frames.items()}

    def all(self, units: list[int]) -> FloatArray:
        """The frames behind each other, shape (2, sum of `units`, ...); zeros where a frame has none."""
        shape = next(iter(self.frames.values())).shape[2:]
        zeros = (np.zeros((2, n, *shape)) for n in units)
        return np.concatenate([self.frames.get(i, zero) for i, zero in enumerate(zeros)], axis=1)


@dataclass
class Histogram(Sums):
    """Values of one feature: how many of each side and unit lie in which bin, and where the bins lie.

    Bins follow from the first frame that has values, and each is whole within a bin of `js`; a bin lies where the mean
    of all its values is.
    """

    edges: FloatArray | None = None
    js_edges: FloatArray = field(default_factory=lambda: np.zeros(0))
    total: FloatArray | None = None

    def add(
        self, frame: int, units: int, blocks: tuple[IndexArray, IndexArray], values: tuple[FloatArray, FloatArray]
    ) -> None:
        """Count a frame's values, measured and simulated, each with its block."""
        if not len(values[0]) and not len(values[1]):
            return
        if self.edges is None:
            self._lay_bins(*values)
        assert self.edges is not None
        assert self.total is not None
        size = len(self.edges) + 1
        counts = np.zeros((2, units, size))
        for side in (0, 1):
            at = np.searchsorted(self.edges, values[side], "right")
            counts[side] = np.bincount(blocks[side] * size + at, minlength=units * size).reshape(units, size)
            self.total += np.bincount(at, weights=values[side], minlength=size)
        self.frames[frame] = counts

    def _lay_bins(self, measured: FloatArray, simulated: FloatArray) -> None:
        m, s = np.sort(measured), np.sort(simulated)
        # Two ascending runs: the stable sort merges them in linear time.
        pooled = np.sort(np.concatenate([m, s]), kind="stable")
        value = pooled[np.append(True, pooled[1:] != pooled[:-1])]
        if len(value) > _BINS:
            value = np.unique(pooled[np.linspace(0, len(pooled) - 1, _BINS).astype(np.int64)])
        span = max(float(value[-1] - value[0]), 1.0)
        self.js_edges = shared_edges(m, s) if len(m) and len(s) else np.zeros(0)
        inside = np.concatenate([0.5 * (value[1:] + value[:-1]), self.js_edges])
        beyond = (value[0] - span * _BEYOND, value[-1] + span * _BEYOND)
        self.edges = np.unique(np.concatenate([inside, *beyond]))
        self.total = np.zeros(len(self.edges) + 1)

    def filled(self, units: list[int]) -> tuple[FloatArray, FloatArray]:
        """Where the bins lie that hold anything, ascending, (k,), and the counts in them, (2, units, k)."""
        counts = self.all(units)
        bins = counts.sum(axis=(0, 1))
        some = bins > 0.0
        assert self.total is not None
        return self.total[some] / bins[some], counts[:, :, some]
