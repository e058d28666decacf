"""Beams that a table lists one by one."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.sensor.beam_table_checks import ORIGIN, TABLE_COLUMNS, checked_numbers
from lidarcheck.sensor.beams import Beams
from lidarcheck.sensor.sweep import Sweep

__all__ = ["TABLE_COLUMNS", "TableBeams"]


@dataclass(frozen=True, eq=False)
class TableBeams(Beams):
    """Beams with any directions. `angles` (layers, points, 2): elevation and azimuth [deg], NaN where there is no beam.

    `times_s` (layers, points) from the frame's start; `origins` (layers, points, 3) [m], None where all begin at 0.
    `from_scan`: the table is that of one scan's own directions, so that neighbours by number need not lie together.
    """

    angles: FloatArray
    times_s: FloatArray
    origins: FloatArray | None = None
    from_scan: bool = False

    @property
    def lattice(self) -> bool:  # type: ignore[override]
        """Whether beams have neighbours by their numbers."""
        return not self.from_scan

    @property
    def central(self) -> bool:  # type: ignore[override]
        """Whether all begin at 0."""
        return self.origins is None

    @classmethod
    def of_columns(
        cls, sweep: Sweep, columns: Mapping[str, npt.NDArray[Any]], *, from_scan: bool = False
    ) -> TableBeams:
        """The beams of a table's columns, a row each, in any order; `RowFault` names the row that is wrong.

        Every line from 0 on must have its points from 0 on, each once.
        """
        layer, point = checked_numbers(columns)
        shape = (int(layer.max()) + 1, int(point.max()) + 1)
        angles = np.full((*shape, 2), np.nan)
        for k, name in enumerate(TABLE_COLUMNS[2:]):
            angles[layer, point, k] = columns[name]
        times_s, origins = np.zeros(shape), None
        if "time_s" in columns:
            times_s[layer, point] = columns["time_s"]
        if any(name in columns for name in ORIGIN):
            origins = np.zeros((*shape, 3))
            for k, name in enumerate(ORIGIN):
                origins[layer, point, k] = columns.get(name, 0.0)
        return cls(sweep, angles, times_s, origins, from_scan)

    @classmethod
    def of_echoes(
        cls, sweep: Sweep, layer: IntArray, point: IntArray, xyz: FloatArray, time_s: FloatArray | None = None
    ) -> TableBeams:
        """The beams of one scan whose echoes bring their directions: each looks at the farthest echo of its number.

        `layer`, `point`, `time_s` (n,), `xyz` (n, 3), not 0. Numbers may leave gaps.
        """
        shape = (int(layer.max(initial=0)) + 1, int(point.max(initial=0)) + 1)
        angles, times_s = np.full((*shape, 2), np.nan), np.zeros(shape)
        x, y, z = xyz.T
        level = elementary.hypot(x, y)
        # Of several echoes of a beam the last one written counts.
        order = np.argsort(x * x + y * y + z * z, kind="stable")
        at = (layer[order], point[order])
        angles[(*at, 0)] = np.rad2deg(elementary.arctan2(z, level))[order]
        angles[(*at, 1)] = np.rad2deg(elementary.arctan2(y, x))[order]
        if time_s is not None:
            times_s[at] = time_s[order]
        return cls(sweep, angles, times_s, None, from_scan=True)

    @property
    def layers(self) -> int:
        """Number of lines."""
        return int(self.angles.shape[0])

    @property
    def points(self) -> int:
        """Number of points of the longest line."""
        return int(self.angles.shape[1])

    @functools.cached_property
    def key(self) -> tuple[Any, ...]:
        """A hash of all numbers."""
        parts = [self.angles, self.times_s, *([] if self.origins is None else [self.origins])]
        digest = hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()
        return ("table", self.angles.shape, digest, self.sweep, self.from_scan)

    def every(self) -> tuple[IntArray, IntArray]:
        """Layer and point of all beams, in their order."""
        layer, point = np.nonzero(np.isfinite(self.angles[..., 0]))
        return layer.astype(np.int32), point.astype(np.int32)

    def has(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Which numbers are beams of this sensor."""
        layer, point = np.asarray(layer), np.asarray(point)
        inside = super().has(layer, point)
        there = np.isfinite(self.angles[..., 0])
        return np.asarray(inside & there[np.where(inside, layer, 0), np.where(inside, point, 0)])

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Elevation and azimuth of beams [deg], shapes (n,)."""
        found = self.angles[np.asarray(layer), np.asarray(point)]
        return found[..., 0], found[..., 1]

    @functools.cached_property
    def _directions(self) -> FloatArray:
        elevation, azimuth = (
            np.deg2rad(np.nan_to_num(self.angles[..., 0])),
            np.deg2rad(np.nan_to_num(self.angles[..., 1])),
        )
        level = elementary.cos(elevation)
        xyz = (elementary.cos(azimuth) * level, elementary.sin(azimuth) * level, elementary.sin(elevation))
        return np.stack(xyz, axis=-1)

    def directions(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
        """Unit vectors of beams, shape (n, 3)."""
        return np.asarray(self._directions[np.asarray(layer), np.asarray(point)])

    def origins_m(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray | None:
        """Where beams begin [m], shape (n, 3); None where all begin at 0."""
        return None if self.origins is None else self.origins[np.asarray(layer), np.asarray(point)]

    def fire_time_s(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
        """When beams are fired [s from the frame's start], shape (n,)."""
        if self.sweep.order == "flash":
            return np.zeros(np.broadcast_shapes(np.shape(layer), np.shape(point)))
        return np.asarray(self.times_s[np.asarray(layer), np.asarray(point)])

    @functools.cached_property
    def _tree(self) -> tuple[Any, IndexArray]:
        """The beams' directions as a search tree, and their cells."""
        from scipy.spatial import cKDTree

        layer, point = self.every()
        return cKDTree(self._directions[layer, point]), layer.astype(np.int64) * self.points + point

    @functools.cached_property
    def _spacing(self) -> FloatArray:
        """Angle from each beam to the nearest other one [deg], (layers, points)."""
        tree, cell = self._tree
        found = np.full(self.size, np.nan)
        if len(cell) > 1:
            chord = tree.query(tree.data, k=2)[0][:, 1]
            found[cell] = np.rad2deg(2.0 * elementary.arcsin(np.minimum(0.5 * chord, 1.0)))
        return found.reshape(self.layers, self.points)

    def spacing_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """How far the nearest other beam is [deg], in elevation as in azimuth; shapes (n,)."""
        found = self._spacing[np.asarray(layer), np.asarray(point)]
        return found, found

    def nearest(self, xyz: npt.ArrayLike) -> tuple[IntArray, IntArray]:
        """Layer and point of the beam that points to each position (n, 3); -1, -1 farther off than a spacing."""
        xyz = np.asarray(xyz, dtype=np.float64)
        if not len(self._tree[1]):
            return np.full(len(xyz), -1, dtype=np.int32), np.full(len(xyz), -1, dtype=np.int32)
        length = np.maximum(np.sqrt((xyz**2).sum(axis=1)), 1e-300)
        tree, cell = self._tree
        chord, at = tree.query(xyz / length[:, None])
        layer, point = np.divmod(cell[at], self.points)
        off_deg = np.rad2deg(2.0 * elementary.arcsin(np.minimum(0.5 * chord, 1.0)))
        outside = ~(off_deg <= np.nan_to_num(self._spacing[layer, point], nan=180.0))
        return np.where(outside, -1, layer).astype(np.int32), np.where(outside, -1, point).astype(np.int32)
