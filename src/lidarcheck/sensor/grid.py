"""Beams in even steps of elevation and azimuth."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.sensor.beams import Beams

__all__ = ["Axis", "GridBeams"]


@dataclass(frozen=True, slots=True)
class Axis:
    """`count` angles in even steps [deg]: the first, and from each to the next, which may be negative."""

    count: int
    first_deg: float
    step_deg: float

    def angle_deg(self, index: npt.ArrayLike) -> FloatArray:
        """The angle of each index [deg]; beyond the last one, steps go on."""
        return (np.asarray(index, dtype=np.float64) + self.first_deg / self.step_deg) * self.step_deg

    def nearest(self, angle_deg: npt.ArrayLike) -> IntArray:
        """The index nearest to each angle; may lie outside 0 ... count - 1."""
        at = np.asarray(angle_deg, dtype=np.float64) / self.step_deg - self.first_deg / self.step_deg
        return np.rint(at).astype(np.int32)

    @property
    def turns(self) -> bool:
        """Whether its angles go once around."""
        return abs(self.count * self.step_deg) > 360.0 - 0.5 * abs(self.step_deg)

    def cos_sin(self, index: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of the indices' angles; those of the sensor's own beams are read off a table."""
        at = np.asarray(index)
        cosine, sine = _table(self)
        if at.size and at.dtype.kind in "iu" and at.min() >= 0 and at.max() < len(cosine):
            return cosine[at], sine[at]
        angle = np.deg2rad(self.angle_deg(at))
        return elementary.cos(angle), elementary.sin(angle)


_HISTORIC = Axis(520, -12.975, 0.05)
_ONE_BIT_LESS, _ONE_BIT_MORE = (49, 112, 407, 470), (20, 499)
"""Layers of the built-in sensors whose sine has always been one bit beside the nearest number. It stays so, since a
golden compares bits."""


@functools.lru_cache(maxsize=16)
def _table(axis: Axis) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine of every angle of an axis."""
    cosine, sine = elementary.rounded_cos_sin(np.deg2rad(axis.angle_deg(np.arange(axis.count))))
    if axis == _HISTORIC:
        for layers, toward in ((_ONE_BIT_LESS, 0.0), (_ONE_BIT_MORE, 2.0)):
            sine[[*layers]] = np.nextafter(sine[[*layers]], toward * np.sign(sine[[*layers]]))
    return cosine, sine


@dataclass(frozen=True, eq=False)
class GridBeams(Beams):
    """Layers in even steps of elevation, points in even steps of azimuth, all beams from one origin at 0."""

    elevation: Axis
    azimuth: Axis
    grid = True

    @property
    def layers(self) -> int:
        """Number of layers."""
        return self.elevation.count

    @property
    def points(self) -> int:
        """Number of points in a layer."""
        return self.azimuth.count

    @property
    def key(self) -> tuple[Any, ...]:
        """All numbers."""
        return ("grid", self.elevation, self.azimuth, self.sweep)

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Elevation and azimuth of beams [deg], shapes (n,)."""
        return self.elevation.angle_deg(layer), self.azimuth.angle_deg(point)

    def directions(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
        """Unit vectors of beams, shape (n, 3)."""
        cos_phi, sin_phi = self.elevation.cos_sin(layer)
        cos_theta, sin_theta = self.azimuth.cos_sin(point)
        directions = np.empty((3, *np.shape(layer)))
        np.multiply(cos_theta, cos_phi, out=directions[0, ...])
        np.multiply(sin_theta, cos_phi, out=directions[1, ...])
        directions[2, ...] = sin_phi
        # Each coordinate lies in one piece: tables want columns.
        return np.moveaxis(directions, 0, -1)

    def fire_time_s(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
        """When beams are fired [s from the frame's start], shape (n,)."""
        layer, point = np.broadcast_arrays(layer, point)
        if self.sweep.order == "flash":
            return np.zeros(layer.shape)
        at, last = (layer, self.layers - 1) if self.sweep.order == "layers" else (point, self.points - 1)
        return np.asarray(at, dtype=np.float64) * (self.sweep.duration_s / max(last, 1))

    def spacing_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """How far the neighbouring beam is in elevation and in azimuth [deg], shapes (n,)."""
        shape = np.broadcast_shapes(np.shape(layer), np.shape(point))
        return np.full(shape, abs(self.elevation.step_deg)), np.full(shape, abs(self.azimuth.step_deg))

    def nearest(self, xyz: npt.ArrayLike) -> tuple[IntArray, IntArray]:
        """Layer and point of the beam that points to each position (n, 3); -1, -1 outside of the field of view."""
        x, y, z = np.asarray(xyz, dtype=np.float64).T
        azimuth = np.rad2deg(elementary.arctan2(y, x))
        if self.azimuth.turns:
            way = 1.0 if self.azimuth.step_deg > 0.0 else -1.0
            azimuth = self.azimuth.first_deg + way * np.mod(way * (azimuth - self.azimuth.first_deg), 360.0)
        point = self.azimuth.nearest(azimuth)
        if self.azimuth.turns:
            point = np.mod(point, self.points).astype(np.int32)
        layer = self.elevation.nearest(np.rad2deg(elementary.arctan2(z, elementary.hypot(x, y))))
        outside = ~self.has(layer, point)
        return np.where(outside, -1, layer).astype(np.int32), np.where(outside, -1, point).astype(np.int32)
