"""The beams of a scenario, what they meet, and how far echoes lie from that."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.kpi.direction import surface_points
from lidarcheck.kpi.lattice import lattice_of
from lidarcheck.kpi.pairing import beam_keys, nearest_on_line
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Beams

__all__ = ["FiredBeams"]

_ITSELF = 4
_AROUND = [(layer, point) for layer in (-1, 0, 1) for point in (-1, 0, 1)]


@dataclass(frozen=True)
class FiredBeams:
    """The beams of a scenario in ascending (layer, point), and what they meet.

    `layer`, `point`: of the beams, shape (n_beams,); of the ideal scan's rows, shape (n_rows,): `beam_of_row`,
    `distance_m` (0: meets nothing), `incidence_deg`; `surface_m` (n_rows, 3): the surface points. `beams`: those
    that have these numbers.
    """

    layer: npt.NDArray[np.int32]
    point: npt.NDArray[np.int32]
    beam_of_row: IndexArray
    distance_m: FloatArray
    incidence_deg: FloatArray
    surface_m: FloatArray
    beams: Beams

    @classmethod
    def of(cls, ideal: IdealScan) -> FiredBeams:
        """The beams of an ideal scan, whose rows may be sub-beams in any order."""
        keys = beam_keys(ideal.layer, ideal.point)
        _, first, beam_of_row = np.unique(keys, return_index=True, return_inverse=True)
        of_rows = (ideal.distance_m, ideal.incidence_deg, surface_points(ideal), ideal.beams)
        return cls(ideal.layer[first], ideal.point[first], beam_of_row, *of_rows)

    def __len__(self) -> int:
        return len(self.layer)

    def surfaces(self, rows: BoolArray | None = None) -> IndexArray:
        """The rows that meet a surface (those of `rows`), in ascending (beam, distance)."""
        meeting = self.distance_m > 0.0
        some = np.flatnonzero(meeting if rows is None else meeting & rows)
        return some[np.lexsort((self.distance_m[some], self.beam_of_row[some]))]

    @functools.cached_property
    def around(self) -> IndexArray:
        """For each beam itself and its neighbours, as beams, -1 for none; shape (n_beams, 9).

        Neighbours are those of an image of the beams: from the layer below to that above, and in it from the column
        before to the next. Beams without a lattice have none.
        """
        n, lattice = len(self), lattice_of(self.beams)
        found = np.full((n, len(_AROUND)), -1, dtype=np.int64)
        if lattice is None:
            found[:, _ITSELF] = np.arange(n)
            return found
        row, column = lattice.row(self.layer), lattice.column(self.layer, self.point)
        keys = beam_keys(row, column)
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        for k, (up, aside) in enumerate(_AROUND):
            beside = column + np.int32(aside)
            wanted = beam_keys(row + np.int32(up), beside % self.beams.points if lattice.around else beside)
            index = np.minimum(np.searchsorted(keys, wanted), n - 1)
            found[:, k] = np.where(keys[index] == wanted, order[index], -1)
        return found

    @functools.cached_property
    def depth_m(self) -> tuple[FloatArray, FloatArray]:
        """Nearest and farthest surface of each beam and its neighbours, shape (n_beams,); inf and 0 for none."""
        nearest, farthest = np.full(len(self) + 1, np.inf), np.zeros(len(self) + 1)
        rows = self.surfaces()
        np.minimum.at(nearest, self.beam_of_row[rows], self.distance_m[rows])
        np.maximum.at(farthest, self.beam_of_row[rows], self.distance_m[rows])
        # The last entry stands for the neighbour that is not there.
        return nearest[self.around].min(axis=1), farthest[self.around].max(axis=1)

    def at_edge(self, window_m: float) -> BoolArray:
        """The beams around which surfaces lie so far apart that an echo fits between their windows, (n_beams,)."""
        nearest, farthest = self.depth_m
        return farthest - nearest > 2.0 * window_m

    def off_surfaces_around_m(self, beam: IndexArray, path_m: FloatArray) -> FloatArray:
        """How far echoes lie from the nearest surface of their beam and its neighbours, shape (n,); inf for none."""
        rows, least = self.surfaces(), np.full(len(beam), np.inf)
        for column in range(self.around.shape[1]):
            least = np.minimum(least, np.abs(self._off(rows, 1.0, self.around[beam, column], path_m)))
        return least

    def off_doubled_m(self, rows: BoolArray, beam: IndexArray, path_m: FloatArray) -> FloatArray:
        """How far behind twice the range of the nearest of those rows' surfaces echoes lie, (n,); inf for none."""
        return self._off(self.surfaces(rows), 2.0, beam, path_m)

    def _off(self, rows: IndexArray, times: float, beam: IndexArray, path_m: FloatArray) -> FloatArray:
        place = times * self.distance_m[rows]
        near = nearest_on_line(self.beam_of_row[rows], place, beam, path_m)
        return np.where(near >= 0, path_m - place[near], np.inf) if len(rows) else np.full(len(beam), np.inf)
