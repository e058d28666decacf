"""Signs: compact clusters of bright returns, their beams, and the range that is a sign's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.ghosts.returns import Returns

__all__ = ["ByLayer", "Patch", "clusters_of", "patch_of", "typical"]


LINK_LAYERS, LINK_POINTS, LINK_M = 3.0, 1.5, 1.0
"""Echoes of one sign are linked where they are at most so many layers, points and metres of range apart."""
FEWEST_RETURNS = 3
LOCATED_WITHIN_M = 0.06
"""How closely the ranges of one flat target lie together, to start with."""
ROUNDS = 12
FRAME = 2
FEWEST_CORE = 4
_NEIGHBOURS = (
    np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=np.bool_),
    np.array([[0, 1, 0], [0, 1, 0], [0, 1, 0]], dtype=np.bool_),
    np.array([[0, 0, 0], [1, 1, 1], [0, 0, 0]], dtype=np.bool_),
)
"""The neighbours that a beam of the core has on the target: all four, or where it is too small those of one axis."""


@dataclass(frozen=True)
class Patch:
    """The beams of a target: a mask over the grid of beams around it, and its plane.

    `mask` (rows, columns): beams that see the target, gaps within it filled; `core`: those with all neighbours of the
    target; row i is layer `first[0] + i * step[0]`, column j point `first[1] + j * step[1]`. The target's own range on
    a beam is `plane` at (1, row, column) - middle. `range_m`: that of its middle.
    """

    mask: BoolArray
    core: BoolArray
    first: tuple[int, int]
    step: tuple[int, int]
    middle: tuple[float, float]
    plane: FloatArray
    range_m: float

    def place(self, layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32]) -> tuple[IndexArray, IndexArray]:
        """Row and column of beams, each (n,); both -1 for those that are not in the mask's frame."""
        rows, columns = self.mask.shape
        i, i_off = np.divmod(layer.astype(np.int64) - self.first[0], self.step[0])
        j, j_off = np.divmod(point.astype(np.int64) - self.first[1], self.step[1])
        inside = (i >= 0) & (i < rows) & (j >= 0) & (j < columns) & (i_off == 0) & (j_off == 0)
        return np.where(inside, i, -1), np.where(inside, j, -1)

    def own_range_m(self, row: IndexArray, column: IndexArray) -> FloatArray:
        """The target's range on beams, shape (n,)."""
        return np.asarray(
            self.plane[0] + self.plane[1] * (row - self.middle[0]) + self.plane[2] * (column - self.middle[1])
        )


@dataclass(frozen=True)
class ByLayer:
    """Rows of a table sorted by layer, to find those around a target without a look at all: `start[k]` of layer k."""

    order: IndexArray
    start: IndexArray
    point: npt.NDArray[np.int32]

    @classmethod
    def of(cls, layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32]) -> ByLayer:
        """Of a table's columns, shapes (n,); rows of unknown layers are never found."""
        order = np.argsort(layer, kind="stable")
        start = np.searchsorted(layer[order], np.arange(int(layer.max(initial=0)) + 2))
        return cls(order, start, point)

    def around(self, patch: Patch) -> IndexArray:
        """Rows in the frame of a patch, ascending."""
        last = len(self.start) - 1
        ends = np.array([patch.first[0], patch.first[0] + patch.mask.shape[0] * patch.step[0]])
        rows = self.order[slice(*self.start[np.clip(ends, 0, last)])]
        inside = self.point[rows] - patch.first[1]
        return np.sort(rows[(inside >= 0) & (inside < patch.mask.shape[1] * patch.step[1])])


def clusters_of(returns: Returns, rows: IndexArray, step: tuple[int, int]) -> list[IndexArray]:
    """The returns in `rows` (m,) that hang together, a list of rows each, the largest first (DBSCAN).

    The metric is that of the beams: neighbours are neighbours at any range.
    """
    if len(rows) < FEWEST_RETURNS:
        return []
    from sklearn.cluster import DBSCAN

    place = np.column_stack([
        returns.layer[rows] / (LINK_LAYERS * step[0]),
        returns.point[rows] / (LINK_POINTS * step[1]),
        returns.range_m[rows] / LINK_M,
    ])  # fmt: skip
    label = DBSCAN(eps=1.0, min_samples=FEWEST_RETURNS, metric="chebyshev", algorithm="kd_tree").fit(place).labels_
    order = np.argsort(label, kind="stable")
    parts = np.split(rows[order], np.flatnonzero(np.diff(label[order])) + 1)
    kept = parts[1:] if label.min() < 0 else parts
    return sorted(kept, key=len, reverse=True)


def typical(values: FloatArray) -> float:
    """The half-sample mode: where values (n,) lie most densely. What trails off to one side does not pull it."""
    ordered = np.sort(values)
    while len(ordered) > 3:
        half = (len(ordered) + 1) // 2
        width = ordered[half - 1 :] - ordered[: len(ordered) - half + 1]
        # Of equally dense halves, as ranges in steps of 1 cm give, the middle one.
        best = np.flatnonzero(width == width.min())
        start = int(best[len(best) // 2])
        ordered = ordered[start : start + half]
    return float(np.median(ordered))


def patch_of(returns: Returns, rows: IndexArray, step: tuple[int, int]) -> Patch:
    """The beams and the plane of the target whose returns are `rows`."""
    from scipy.ndimage import binary_closing, binary_erosion, binary_fill_holes

    # A frame of beams around it, so that what stands beside the target has a place, too.
    first = (int(returns.layer[rows].min()) - FRAME * step[0], int(returns.point[rows].min()) - FRAME * step[1])
    i = (returns.layer[rows].astype(np.int64) - first[0]) // step[0]
    j = (returns.point[rows].astype(np.int64) - first[1]) // step[1]
    seen = np.zeros((i.max() + 1 + FRAME, j.max() + 1 + FRAME), dtype=np.bool_)
    seen[i, j] = True
    mask = seen | binary_fill_holes(binary_closing(seen))
    cores = (binary_erosion(mask, shape) for shape in _NEIGHBOURS)
    core = next((found for found in cores if np.count_nonzero(found) >= FEWEST_CORE), mask)
    middle = (float(i.mean()), float(j.mean()))
    plane = _plane(i.astype(np.float64) - middle[0], j.astype(np.float64) - middle[1], returns.range_m[rows])
    return Patch(mask, core, first, step, middle, plane, float(plane[0]))


def _plane(row: FloatArray, column: FloatArray, range_m: FloatArray) -> FloatArray:
    """Range over (1, row, column), each (n,): a flat target's own, whatever trails off behind or in front of it.

    Least squares with Cauchy weights around the most frequent range, so that echoes that noise drew away count little.
    """
    design = np.column_stack([np.ones(len(row)), row, column])
    free = [0, *(k for k in (1, 2) if np.ptp(design[:, k]) > 0.0 and len(row) >= 6)]
    plane = np.zeros(3)
    plane[0] = typical(range_m)
    for _ in range(ROUNDS):
        residual = range_m - design @ plane
        near = np.abs(residual) < 3.0 * LOCATED_WITHIN_M
        width = 1.48 * float(np.median(np.abs(residual[near]))) if near.any() else LOCATED_WITHIN_M
        weight = 1.0 / (1.0 + (residual / np.clip(2.0 * width, 0.01, LOCATED_WITHIN_M)) ** 2) ** 2
        root = np.sqrt(weight)[:, None]
        plane[free] = np.linalg.lstsq(root * design[:, free], root[:, 0] * range_m, rcond=None)[0]
    return plane
