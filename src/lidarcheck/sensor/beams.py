"""A sensor's beams: where each looks from, where to, and when.

Sensor frame, metres: X forward, Y left, Z up; azimuth positive to the left, elevation upward. A beam is (layer, point).
Source of the geometry: docs/sensors.md, which states it for all three kinds.
"""

from __future__ import annotations

import abc
import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.sensor.sweep import Sweep

__all__ = ["Beams"]


@dataclass(frozen=True, eq=False)
class Beams(abc.ABC):
    """The beams of one sensor: `layers` lines of `points` beams, Layer 0 ... layers - 1, Point 0 ... points - 1.

    `repeats`: whether every frame fires the same directions. `grid`: whether elevation depends on the layer alone and
    azimuth on the point alone, in even steps. `lattice`: whether beams have neighbours by their numbers. `central`:
    whether all begin at 0 and a reported range is the way from there.
    """

    sweep: Sweep
    repeats = True
    grid = False
    lattice = True
    central = True

    @property
    @abc.abstractmethod
    def layers(self) -> int:
        """Number of layers."""

    @property
    @abc.abstractmethod
    def points(self) -> int:
        """Number of points in a layer."""

    @property
    @abc.abstractmethod
    def key(self) -> tuple[Any, ...]:
        """What tells these beams from others: all their numbers."""

    @abc.abstractmethod
    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Elevation and azimuth of beams [deg], shapes (n,); numbers beyond the sensor's go on in its steps."""

    @abc.abstractmethod
    def fire_time_s(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
        """When beams are fired [s from the frame's start], shape (n,)."""

    @abc.abstractmethod
    def spacing_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """How far the neighbouring beam is in elevation and in azimuth [deg], shapes (n,)."""

    @abc.abstractmethod
    def nearest(self, xyz: npt.ArrayLike) -> tuple[IntArray, IntArray]:
        """Layer and point of the beam that points to each position (n, 3); -1, -1 outside of the field of view."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Beams) and (self is other or self.key == other.key)

    def __hash__(self) -> int:
        return self._hash

    @functools.cached_property
    def _hash(self) -> int:
        return hash(self.key)

    def alike(self, other: Beams) -> bool:
        """Whether both are one sensor's, in whichever frame; a scan's own directions are never another's."""
        if not (self.lattice or other.lattice):
            return True
        return self is other or self.with_phase(0.0) == other.with_phase(0.0)

    @property
    def size(self) -> int:
        """Layers times points: one more than the largest `index`."""
        return self.layers * self.points

    def index(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> IndexArray:
        """One number a beam, in order of (layer, point)."""
        return np.asarray(np.asarray(layer, dtype=np.int64) * self.points + np.asarray(point))

    def has(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Which numbers are beams of this sensor."""
        layer, point = np.asarray(layer), np.asarray(point)
        return np.asarray((layer >= 0) & (layer < self.layers) & (point >= 0) & (point < self.points))

    def every(self) -> tuple[IntArray, IntArray]:
        """Layer and point of all beams, in their order."""
        layer = np.repeat(np.arange(self.layers, dtype=np.int32), self.points)
        return layer, np.tile(np.arange(self.points, dtype=np.int32), self.layers)

    def directions(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
        """Unit vectors of beams, shape (n, 3)."""
        elevation, azimuth = (np.deg2rad(angle) for angle in self.angles_deg(layer, point))
        level = elementary.cos(elevation)
        xyz = (elementary.cos(azimuth) * level, elementary.sin(azimuth) * level, elementary.sin(elevation))
        return np.moveaxis(np.array(np.broadcast_arrays(*xyz)), 0, -1)

    @functools.cached_property
    def _cells(self) -> tuple[FloatArray, FloatArray]:
        layer = np.repeat(np.arange(self.layers), self.points)
        point = np.tile(np.arange(self.points), self.layers)
        directions, origins = self.directions(layer, point), self.origins_m(layer, point)
        nothing = np.zeros((0, 3)) if origins is None else origins
        return np.ascontiguousarray(directions), np.ascontiguousarray(nothing)

    def cells(self) -> tuple[FloatArray, FloatArray]:
        """Directions and origins of all beams by their `index`, shape (size, 3) each; no origins where all are 0."""
        return self._cells

    def origins_m(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray | None:
        """Where beams begin [m], shape (n, 3); None where all begin at 0."""
        return None

    def range_offset_m(self, layer: npt.ArrayLike) -> FloatArray | float:
        """What a reported range is longer than the way from the beam's origin [m]: shape (n,), or one for all."""
        return 0.0

    def positions_m(self, layer: npt.ArrayLike, point: npt.ArrayLike, range_m: npt.ArrayLike) -> FloatArray:
        """Where echoes of reported ranges lie [m], shape (n, 3): origin + direction (range - range offset)."""
        path_m = np.asarray(range_m, dtype=np.float64) - self.range_offset_m(layer)
        xyz, origins = self.directions(layer, point) * path_m[:, None], self.origins_m(layer, point)
        return np.asarray(xyz if origins is None else xyz + origins)

    def ranges_m(self, layer: npt.ArrayLike, point: npt.ArrayLike, xyz: FloatArray) -> FloatArray:
        """The ranges that echoes at these positions (n, 3) report [m], shape (n,)."""
        origins = self.origins_m(layer, point)
        away = xyz if origins is None else xyz - origins
        length = np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2 + away[:, 2] ** 2)
        return np.asarray(length + self.range_offset_m(layer))

    def image_column(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> IntArray:
        """The column of an image in which what stands together lies together."""
        return np.asarray(point, dtype=np.int32)

    def phase_of(self, layer: npt.ArrayLike, point: npt.ArrayLike, xyz: FloatArray) -> float:
        """How far past the first azimuth Point 0 looks [deg], from echoes' positions (n, 3); 0 where columns repeat."""
        return 0.0

    def with_phase(self, phase_deg: float) -> Beams:
        """The beams of a frame whose Point 0 looks that much past the first azimuth; the same where columns repeat."""
        return replace(self, phase_deg=float(phase_deg)) if not self.repeats else self  # type: ignore[call-arg]

    @property
    def first_azimuth_deg(self) -> float:
        """Where the first column of the frame looks [deg, -180 to 180]."""
        raise NotImplementedError("only of beams whose columns do not repeat")

    def of_frame(self, frame: int) -> tuple[Beams, int]:
        """The beams as that frame of a run fires them, counted from 0, and how many points a layer then has."""
        return self, self.points
