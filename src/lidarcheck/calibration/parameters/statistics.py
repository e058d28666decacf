"""What frames show, as some hundred sums over beams: measured and simulated echoes go through the same sums.

A sum is of one feature (was the surface detected, its echo's range, AREA, PEAK, WIDTH, their squares, other echoes)
over the beams of a bin (of range, amplitude, material, incidence, layer, point, distance to a bright target). Each
beam counts by how far it is from what a reference model shows of it, in that beam's own standard deviations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.inference.observed.beam_table import BeamTable
from lidarcheck.inference.observed.expectation import Expected, expectation, pose_weights
from lidarcheck.inference.observed.extra_echoes import sides_of_surface
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.observed.strata import RANGE_EDGES_M, divisions, range_bin
from lidarcheck.inference.observed.summaries import compressed

__all__ = ["Statistics"]


_LINEAR = 5.0
"""Up to about so many standard deviations a beam counts as it is, beyond by the logarithm: one stray moves no mean."""
_MOST_SQUARE = 25.0
"""A squared residual counts at most five standard deviations."""
_FEWEST_BEAMS = 25
"""Fewer beams make no bin: their sum is far from normal."""
_MOST_CLUSTERS = 1024
"""Clusters that are kept apart: the scatter of so many is known well, and more only take memory."""
_MEANS = ("range", "area", "detected")
_SHAPES = ("peak", "width", "range spread", "area spread", "width spread")
_SHAPES_OVER = ("all", "range", "amplitude", "material")
_MEANS_OVER = (
    *_SHAPES_OVER, "incidence", "layer", "point", "edge", "layers to a bright target", "points to a bright target",
)  # fmt: skip
_TYPICAL_LOG_AREA = 4.5
"""About the mean of false echoes, so that their strength and their number are told apart."""


@dataclass(frozen=True)
class _Bins:
    """Beams by bins as sparse matrices of ones: `total` (bins, n), and `parts` (clusters x bins, n)."""

    total: Any
    parts: Any
    count: int


class Statistics:
    """The sums over the beams that are `used`, relative to what a reference model shows of them.

    `base`: what that model shows with some seeds. Beams are summed up in clusters too, the point columns of a frame:
    what shakes or moves in the sweep moves a column at once, and clusters are independent.
    """

    def __init__(self, beams: BeamTable, used: BoolArray, base: Sequence[Observations]) -> None:
        self.beams = beams
        self.expected: Expected = expectation(beams, base)
        self.cluster, self.clusters = _clusters(beams)
        found = [d for d in divisions(beams, self.expected.log_area, {}) if d.covariate in _MEANS_OVER]
        numbers = {d.covariate: np.where(used, d.bin, -1) for d in found}
        self._means = self._bins([numbers[name] for name in numbers])
        self._shapes = self._bins([numbers[name] for name in numbers if name in _SHAPES_OVER])
        self._used = used
        self._slopes = pose_weights(beams, self.expected)
        strips = numbers["point"]
        self._posed = self._bins([np.where(used, 0, -1), strips])
        self._of_range = len(RANGE_EDGES_M)

    def _bins(self, numbers: Sequence[IndexArray]) -> _Bins:
        """Only bins that have beams enough take part."""
        from scipy.sparse import csr_matrix

        rows: list[IndexArray] = []
        columns: list[IndexArray] = []
        count = 0
        for number in numbers:
            beams = np.bincount(number[number >= 0], minlength=1)
            enough = beams >= _FEWEST_BEAMS
            place = np.append(np.where(enough, np.cumsum(enough) - 1, -1), -1)[number]
            used = np.flatnonzero(place >= 0)
            rows.append(place[used] + count)
            columns.append(used)
            count += int(enough.sum())
        r, c = np.concatenate(rows), np.concatenate(columns)
        ones, n = np.ones(len(r)), len(self.beams)
        total = csr_matrix((ones, (r, c)), shape=(count, n))
        parts = csr_matrix((ones, (self.cluster[c] * count + r, c)), shape=(self.clusters * count, n))
        return _Bins(total, parts, count)

    def total(self, observations: Observations) -> FloatArray:
        """The sums, shape (n_statistics,)."""
        return np.concatenate([part.sum(axis=0) for part in self._parts(observations, clustered=False)])

    def by_cluster(self, observations: Observations) -> FloatArray:
        """The sums over each cluster, shape (n_clusters, n_statistics); they add up to the total."""
        return np.concatenate(list(self._parts(observations, clustered=True)), axis=1)

    def _parts(self, observations: Observations, *, clustered: bool) -> list[FloatArray]:
        valid = observations.detected & self.expected.known
        u = (observations.feature - self.expected.mean) / self.expected.spread
        u = np.where(valid[:, None], compressed(u, _LINEAR), 0.0)
        sure = ~self.expected.at_edge
        losses = np.where(sure, observations.detected - self.expected.probability, 0.0)
        means = np.column_stack([u[:, 0], u[:, 1], losses])
        squares = np.where(valid[:, None], np.minimum(u[:, [0, 1, 3]] ** 2, _MOST_SQUARE) - 1.0, 0.0)
        shapes = np.column_stack([u[:, 2], u[:, 3], squares])
        posed = u[:, :1] * self._slopes
        return [
            self._sum(self._means, means, clustered),
            self._sum(self._shapes, shapes, clustered),
            self._sum(self._posed, posed, clustered),
            self._others(observations, clustered),
        ]

    def _sum(self, bins: _Bins, value: FloatArray, clustered: bool) -> FloatArray:
        """Rows are clusters, or one for all; columns go through the bins of each feature in turn."""
        found = (bins.parts if clustered else bins.total) @ value
        return np.asarray(found.reshape(-1, bins.count * value.shape[1]))

    def _others(self, observations: Observations, clustered: bool) -> FloatArray:
        """Other echoes by kind and range, and by material of their beam's surface."""
        keep = self._used[observations.extra_beam]
        beam, range_m, area = observations.extra_beam[keep], observations.extra_m[keep], observations.extra_area[keep]
        kind, cell = sides_of_surface(self.beams, beam, range_m), range_bin(range_m)
        bins = self._of_range
        rows = self.clusters if clustered else 1
        row = self.cluster[beam] if clustered else np.zeros(len(beam), dtype=np.int64)
        counts = np.bincount((row * 3 + kind) * bins + cell, minlength=rows * 3 * bins).reshape(rows, 3 * bins)
        strength = np.bincount(row * bins + cell, area - _TYPICAL_LOG_AREA, rows * bins).reshape(rows, bins)
        return np.concatenate([counts.astype(np.float64), strength], axis=1)

    @property
    def counted(self) -> BoolArray:
        """Which of the statistics count rare echoes, whose spread is at least that of a few; shape (n_statistics,)."""
        n = 3 * self._means.count + 5 * self._shapes.count + 2 * self._posed.count
        return np.arange(n + 4 * self._of_range) >= n


def _clusters(beams: BeamTable) -> tuple[IndexArray, int]:
    """The cluster of each beam, and how many there are: a frame's columns, or some of them side by side."""
    joined = -(-(int(beams.column.max()) + 1) // _MOST_CLUSTERS)
    cluster = beams.column // joined
    return np.asarray(cluster, dtype=np.int64), int(cluster.max()) + 1
