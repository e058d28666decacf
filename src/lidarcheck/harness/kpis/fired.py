"""The beams of a scenario, what they meet, and how far echoes lie from that."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.kpi.direction import surface_points
from lidarcheck.kpi.pairing import beam_keys, nearest_on_line
from lidarcheck.scan import IdealScan

__all__ = ["FiredBeams"]

_AROUND = [(layer, point) for layer in (-1, 0, 1) for point in (-1, 0, 1)]


@dataclass(frozen=True)
class FiredBeams:
    """The beams of a scenario in ascending (layer, point), and what they meet.

    `layer`, `point`: of the beams, shape (n_beams,); of the ideal scan's rows, shape (n_rows,): `beam_of_row`,
    `distance_m` (0: meets nothing), `incidence_deg`; `surface_m` (n_rows, 3): the surface points.
    """

    layer: npt.NDArray[np.int32]
    point: npt.NDArray[np.int32]
    beam_of_row: IndexArray
    distance_m: FloatArray
    incidence_deg: FloatArray
    surface_m: FloatArray

    @classmethod
    def of(cls, ideal: IdealScan) -> FiredBeams:
        """The beams of an ideal scan, whose rows may be sub-beams in any order."""
        keys = beam_keys(ideal.layer, ideal.point)
        _, first, beam_of_row = np.unique(keys, return_index=True, return_inverse=True)
        of_rows = (ideal.distance_m, ideal.incidence_deg, surface_points(ideal))
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
        """For each beam itself and its neighbours in layer and point, as beams, -1 for none; shape (n_beams, 9)."""
        keys = beam_keys(self.layer, self.point)
        found = np.full((len(keys), len(_AROUND)), -1, dtype=np.int64)
        for column, (layer, point) in enumerate(_AROUND):
            wanted = beam_keys(self.layer + np.int32(layer), self.point + np.int32(point))
            index = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            found[:, column] = np.where(keys[index] == wanted, index, -1)
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

    def off_surfaces_around_m(self, beam: IndexArray, range_m: FloatArray) -> FloatArray:
        """How far echoes lie from the nearest surface of their beam and its neighbours, shape (n,); inf for none."""
        rows, least = self.surfaces(), np.full(len(beam), np.inf)
        for column in range(self.around.shape[1]):
            least = np.minimum(least, np.abs(self._off(rows, 1.0, self.around[beam, column], range_m)))
        return least

    def off_doubled_m(self, rows: BoolArray, beam: IndexArray, range_m: FloatArray) -> FloatArray:
        """How far behind twice the range of the nearest of those rows' surfaces echoes lie, (n,); inf for none."""
        return self._off(self.surfaces(rows), 2.0, beam, range_m)

    def _off(self, rows: IndexArray, times: float, beam: IndexArray, range_m: FloatArray) -> FloatArray:
        place = times * self.distance_m[rows]
        near = nearest_on_line(self.beam_of_row[rows], place, beam, range_m)
        return np.where(near >= 0, range_m - place[near], np.inf) if len(rows) else np.full(len(beam), np.inf)
