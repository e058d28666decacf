"""Beams of a turning head: channels at fixed elevations, fired column by column."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.sensor.beams import Beams

__all__ = ["ChannelBeams", "Channels"]


@dataclass(frozen=True, slots=True)
class Channels:
    """What is fixed in the head, a value each channel, in order of `Layer`; units in the names.

    `azimuth_offset_deg` is added to the column's azimuth; `origin_m` forward along the column's azimuth, `side_m` left
    of it, `height_m` up: where the beam begins; a reported range is the way from there plus `range_offset_m`;
    `fire_time_us` after the column's start; `ring`: a file's number of the channel; `column_shift`: the column of the
    image less the column that is fired.
    """

    elevation_deg: tuple[float, ...]
    azimuth_offset_deg: tuple[float, ...]
    origin_m: tuple[float, ...]
    side_m: tuple[float, ...]
    height_m: tuple[float, ...]
    range_offset_m: tuple[float, ...]
    fire_time_us: tuple[float, ...]
    ring: tuple[int, ...]
    column_shift: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class ChannelBeams(Beams):
    """Channels fired column by column: `span_deg` from column 0 to one past the last, in steps of `step_deg`.

    A step is negative where the head turns to the right. Where the columns of a turn are no whole number
    (`repeats_columns` False) every frame begins elsewhere: Point counts firings from the frame's start, and Point 0
    looks at `first_deg` + `phase_deg`.
    """

    channels: Channels
    first_deg: float
    span_deg: float
    step_deg: float
    repeats_columns: bool = True
    phase_deg: float = 0.0

    @property
    def repeats(self) -> bool:  # type: ignore[override]
        """Whether every frame fires the same directions."""
        return self.repeats_columns

    @property
    def layers(self) -> int:
        """Number of channels."""
        return len(self.channels.elevation_deg)

    @functools.cached_property
    def central(self) -> bool:  # type: ignore[override]
        """Whether all begin at 0 and a reported range is the way from there."""
        own = self._of_channel
        return not any(own[name].any() for name in ("origin_m", "side_m", "height_m", "range_offset_m"))

    @functools.cached_property
    def columns(self) -> float:
        """Columns of a frame: a whole number where they repeat."""
        columns = self.span_deg / self.step_deg
        return float(round(columns)) if self.repeats_columns else columns

    @property
    def points(self) -> int:
        """Number of columns that a frame may have."""
        return math.ceil(self.columns - 1e-9)

    @functools.cached_property
    def key(self) -> tuple[Any, ...]:
        """All numbers."""
        angles = (self.first_deg, self.span_deg, self.step_deg, self.repeats_columns, self.phase_deg)
        return ("channels", self.channels, *angles, self.sweep)

    @functools.cached_property
    def column_s(self) -> float:
        """Time from a column to the next [s]."""
        return self.sweep.duration_s / self.columns

    @functools.cached_property
    def _of_channel(self) -> dict[str, FloatArray]:
        own = self.channels
        names = (
            "elevation_deg",
            "azimuth_offset_deg",
            "origin_m",
            "side_m",
            "height_m",
            "range_offset_m",
            "fire_time_us",
        )
        return {name: np.asarray(getattr(own, name), dtype=np.float64) for name in names}

    @functools.cached_property
    def _turned_deg(self) -> FloatArray:
        """How far the head has turned when each channel fires after its column's start."""
        if not self.sweep.fire_time_in_azimuth or self.sweep.order == "flash":
            return np.zeros(self.layers)
        return np.asarray(self.step_deg / self.column_s * self._of_channel["fire_time_us"] * 1e-6)

    @functools.cached_property
    def neighbour_deg(self) -> FloatArray:
        """The distance of each channel's elevation to the nearest other one [deg], NaN where there is none."""
        elevation = self._of_channel["elevation_deg"]
        if self.layers == 1:
            return np.full(1, np.nan)
        order = np.argsort(elevation, kind="stable")
        gaps = np.diff(elevation[order])
        nearest = np.minimum(np.append(gaps, np.inf), np.insert(gaps, 0, np.inf))
        found = np.empty(self.layers)
        found[order] = nearest
        return found

    def column_azimuth_deg(self, point: npt.ArrayLike) -> FloatArray:
        """Where the head looks at each column's start [deg]."""
        return np.asarray(self.first_deg + self.phase_deg + np.asarray(point, dtype=np.float64) * self.step_deg)

    @property
    def first_azimuth_deg(self) -> float:
        """Where Point 0 of the frame looks at its column's start [deg, -180 to 180]."""
        return 180.0 - (180.0 - self.first_deg - self.phase_deg) % 360.0

    def of_frame(self, frame: int) -> tuple[Beams, int]:
        """The beams as that frame of a run fires them, counted from 0, and how many columns it has.

        The head goes on turning: a frame begins with the first column that is fired in it.
        """
        if self.repeats:
            return self, self.points
        begun, ended = frame * self.columns, (frame + 1) * self.columns
        first = math.ceil(begun - 1e-6)
        return self.with_phase((first - begun) * self.step_deg), math.ceil(ended - 1e-6) - first

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Elevation and azimuth of beams [deg], shapes (n,); the azimuth from -180 to 180."""
        layer = np.asarray(layer)
        azimuth = self.column_azimuth_deg(point) + (self._of_channel["azimuth_offset_deg"] + self._turned_deg)[layer]
        return self._of_channel["elevation_deg"][layer], 180.0 - np.mod(180.0 - azimuth, 360.0)

    @functools.cached_property
    def _level(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of each channel's elevation."""
        angle = np.deg2rad(self._of_channel["elevation_deg"])
        return elementary.cos(angle), elementary.sin(angle)

    @functools.cached_property
    def _turns(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of each column's azimuth, of the columns that a frame has."""
        angle = np.deg2rad(self.column_azimuth_deg(np.arange(self.points)))
        return elementary.cos(angle), elementary.sin(angle)

    def _heading(self, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        at = np.asarray(point)
        if at.size and at.dtype.kind in "iu" and at.min() >= 0 and at.max() < self.points:
            cosine, sine = self._turns
            return cosine[at], sine[at]
        angle = np.deg2rad(self.column_azimuth_deg(at))
        return elementary.cos(angle), elementary.sin(angle)

    @functools.cached_property
    def _aside(self) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of each channel's azimuth against its column's."""
        angle = np.deg2rad(self._of_channel["azimuth_offset_deg"] + self._turned_deg)
        return elementary.cos(angle), elementary.sin(angle)

    def directions(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
        """Unit vectors of beams, shape (n, 3)."""
        layer = np.asarray(layer)
        (level, up), (along, aside), (cosine, sine) = self._level, self._aside, self._heading(point)
        found = np.empty((3, *np.broadcast_shapes(layer.shape, cosine.shape)))
        a, b = (along * level)[layer], (aside * level)[layer]
        found[0], found[1] = cosine * a - sine * b, sine * a + cosine * b
        found[2] = up[layer]
        return np.moveaxis(found, 0, -1)

    def origins_m(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray | None:
        """Where beams begin [m], shape (n, 3): they turn with the head; None where all begin at 0."""
        own = self._of_channel
        if not (own["origin_m"].any() or own["side_m"].any() or own["height_m"].any()):
            return None
        layer = np.asarray(layer)
        cosine, sine = self._heading(point)
        if self._turned_deg.any():
            turned = np.deg2rad(self._turned_deg)
            c, s = elementary.cos(turned)[layer], elementary.sin(turned)[layer]
            cosine, sine = cosine * c - sine * s, sine * c + cosine * s
        ahead, left = own["origin_m"][layer], own["side_m"][layer]
        found = np.empty((3, *np.broadcast_shapes(layer.shape, cosine.shape)))
        found[0], found[1] = ahead * cosine - left * sine, ahead * sine + left * cosine
        found[2] = own["height_m"][layer]
        return np.moveaxis(found, 0, -1)

    def range_offset_m(self, layer: npt.ArrayLike) -> FloatArray | float:
        """What a reported range is longer than the way from the beam's origin [m], shape (n,)."""
        offset = self._of_channel["range_offset_m"]
        return np.asarray(offset[np.asarray(layer)]) if offset.any() else 0.0

    def fire_time_s(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
        """When beams are fired [s from the frame's start], shape (n,)."""
        layer, point = np.broadcast_arrays(layer, point)
        if self.sweep.order == "flash":
            return np.zeros(layer.shape)
        after_s = 1e-6 * self._of_channel["fire_time_us"][layer]
        return np.asarray(np.asarray(point, dtype=np.float64) * self.column_s + after_s)

    def phase_of(self, layer: npt.ArrayLike, point: npt.ArrayLike, xyz: FloatArray) -> float:
        """How far past the first azimuth Point 0 looks [deg]: the median over echoes of what is left of a turn.

        Beams begin beside the axis, which the phase itself turns: of the error each step leaves as large a part as that
        is of the range.
        """
        layer, point = np.asarray(layer), np.asarray(point)
        if self.repeats_columns or not len(xyz):
            return 0.0
        turned = replace(self, phase_deg=0.0)
        for _ in range(1 if self.central else 6):
            origins = turned.origins_m(layer, point)
            x, y, _z = (xyz if origins is None else xyz - origins).T
            off = np.rad2deg(elementary.arctan2(y, x)) - turned.angles_deg(layer, point)[1]
            usual = _circular_mean_deg(off)
            left = float(np.median(np.mod(off - usual + 180.0, 360.0) - 180.0))
            turned = replace(turned, phase_deg=turned.phase_deg + usual + left)
        return float(np.mod(turned.phase_deg + 180.0, 360.0) - 180.0)

    def spacing_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """How far the neighbouring beam is in elevation and in azimuth [deg]; one channel alone takes the azimuth's."""
        layer, _ = np.broadcast_arrays(layer, point)
        aside = np.full(layer.shape, abs(self.step_deg))
        up = self.neighbour_deg[layer]
        return np.where(np.isnan(up), aside, up), aside

    def nearest(self, xyz: npt.ArrayLike) -> tuple[IntArray, IntArray]:
        """Layer and point of the beam that points to each position (n, 3); -1, -1 outside of the field of view.

        Of positions near the head, the elevation is taken from the beams' own origin; their azimuth is found by one
        further step from the origin of the beam that was found first.
        """
        xyz = np.asarray(xyz, dtype=np.float64)
        layer, point = self._along(xyz)
        origins = self.origins_m(np.maximum(layer, 0), np.maximum(point, 0)) if len(xyz) else None
        return (layer, point) if origins is None else self._along(xyz - origins)

    def _along(self, direction: FloatArray) -> tuple[IntArray, IntArray]:
        x, y, z = direction.T
        up = np.rad2deg(elementary.arctan2(z, elementary.hypot(x, y)))
        elevation = self._of_channel["elevation_deg"]
        order = np.argsort(elevation, kind="stable")
        between = 0.5 * (elevation[order][1:] + elevation[order][:-1])
        layer = order[np.searchsorted(between, up)].astype(np.int32)
        azimuth = (
            np.rad2deg(elementary.arctan2(y, x)) - (self._of_channel["azimuth_offset_deg"] + self._turned_deg)[layer]
        )
        way = 1.0 if self.step_deg > 0.0 else -1.0
        past = np.mod(way * (azimuth - self.first_deg - self.phase_deg) + 0.5 * abs(self.step_deg), 360.0)
        point = np.floor(past / abs(self.step_deg)).astype(np.int32)
        if abs(self.span_deg) > 360.0 - 0.5 * abs(self.step_deg) and self.repeats_columns:
            point = np.mod(point, self.points).astype(np.int32)
        reach = 0.5 * np.where(np.isnan(self.neighbour_deg), np.inf, self.neighbour_deg)[layer]
        outside = (point >= self.points) | (
            np.abs(up - elevation[layer]) > np.maximum(reach, self._half_gap(layer, up))
        )
        return np.where(outside, -1, layer).astype(np.int32), np.where(outside, -1, point).astype(np.int32)

    def _half_gap(self, layer: IntArray, up: FloatArray) -> FloatArray:
        """Half the distance to the next channel on the side of the position: 0 beyond the outermost ones."""
        elevation = np.sort(self._of_channel["elevation_deg"])
        own = self._of_channel["elevation_deg"][layer]
        at = np.searchsorted(elevation, own)
        above, below = np.append(np.diff(elevation), 0.0)[at], np.insert(np.diff(elevation), 0, 0.0)[at]
        return np.asarray(0.5 * np.where(up > own, above, below), dtype=np.float64)

    def image_column(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> IntArray:
        """The column of an image in which what stands together lies together."""
        shift = np.asarray(self.channels.column_shift, dtype=np.int64)[np.asarray(layer)]
        return np.asarray(np.mod(np.asarray(point) + shift, self.points), dtype=np.int32)


def _circular_mean_deg(angle_deg: FloatArray) -> float:
    angle = np.deg2rad(angle_deg)
    return float(np.rad2deg(elementary.arctan2(elementary.sin(angle).sum(), elementary.cos(angle).sum())))
