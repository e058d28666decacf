"""A head that turns: where each channel looks and starts in column 0; every other column is that, turned about Z.

Read off the beams themselves, so that a grid and a list of channels are one thing to the geometry check and to whoever
finds the beam of a row. Columns may be real numbers here: a head stands wherever it stands when it fires.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.sensor.beams import Beams
from lidarcheck.sensor.channels import ChannelBeams
from lidarcheck.sensor.grid import GridBeams

__all__ = ["Head", "angles_of_deg", "directions_of"]

_ROUNDS = 3
"""Where a beam starts depends on its column, and the column on where it starts; each round gains a factor R/origin."""


@dataclass(frozen=True)
class Head:
    """Channels, each of shape (layers,): `elevation_deg`, `azimuth_deg` in column 0, `fire_s` after the column's start.

    `origin_m`, shape (layers, 3): where they start in column 0, None for all at 0. `step_deg`: from a column to the
    next, with its sign; `column_s`: how long that takes. `repeats`: whether column numbers name directions; else
    azimuths count from wherever the frame's first column looks. `fire_turns`: whether the azimuths have moved on by the
    fire time.
    """

    elevation_deg: FloatArray
    azimuth_deg: FloatArray
    fire_s: FloatArray
    origin_m: FloatArray | None
    step_deg: float
    column_s: float
    points: int
    repeats: bool = True
    fire_turns: bool = True

    @classmethod
    def of(cls, beams: Beams) -> Head | None:
        """The head whose beams these are; None where they are a table, which turns nowhere."""
        if not isinstance(beams, GridBeams | ChannelBeams):
            return None
        layer = np.arange(beams.layers, dtype=np.int32)
        first, second = np.zeros_like(layer), np.ones_like(layer)
        elevation, azimuth = beams.angles_deg(layer, first)
        fire = beams.fire_time_s(layer, first)
        step = float(_wrapped(beams.angles_deg(layer[:1], second[:1])[1] - azimuth[:1])[0])
        column_s = float((beams.fire_time_s(layer[:1], second[:1]) - fire[:1])[0])
        # One column alone has no turn of its own, and the difference of two azimuths lost its last bits.
        step = beams.step_deg if isinstance(beams, ChannelBeams) else step
        origin = beams.origins_m(layer, first)
        turns = beams.sweep.fire_time_in_azimuth and beams.sweep.order != "flash"
        return cls(elevation, azimuth, fire, origin, step, column_s, beams.points, beams.repeats, turns)

    @property
    def layers(self) -> int:
        """How many channels."""
        return len(self.elevation_deg)

    @property
    def turn_columns(self) -> float:
        """Columns in a whole turn; not a whole number where columns do not repeat."""
        return 360.0 / abs(self.step_deg)

    @property
    def closed(self) -> bool:
        """Whether a frame goes all around, so that its last column stands beside its first."""
        return abs(self.turn_columns - self.points) < 0.5

    @property
    def turn_deg_per_s(self) -> float:
        """How fast the head turns, with its sign; 0 for a flash."""
        return self.step_deg / self.column_s if self.column_s else 0.0

    def turned(self, degrees: float) -> Head:
        """The same head where column 0 looks so much farther to the left."""
        origin = None if self.origin_m is None else _turned(self.origin_m, np.full(self.layers, degrees))
        return replace(self, azimuth_deg=self.azimuth_deg + degrees, origin_m=origin)

    def reversed(self) -> Head:
        """The same head, turning the other way from the same column 0."""
        moved = -2.0 * self.turn_deg_per_s * self.fire_s if self.fire_turns else np.zeros(self.layers)
        origin = None if self.origin_m is None else _turned(self.origin_m, moved)
        return replace(self, azimuth_deg=self.azimuth_deg + moved, origin_m=origin, step_deg=-self.step_deg)

    def with_fire(self) -> Head:
        """The same head with the fire time in its azimuths where it is not, and without it where it is."""
        sign = -1.0 if self.fire_turns else 1.0
        moved = sign * self.turn_deg_per_s * self.fire_s
        origin = None if self.origin_m is None else _turned(self.origin_m, moved)
        return replace(self, azimuth_deg=self.azimuth_deg + moved, origin_m=origin, fire_turns=not self.fire_turns)

    def directions(self, layer: npt.ArrayLike, column: npt.ArrayLike) -> FloatArray:
        """Unit vectors of channels in columns, shape (n,) each; shape (n, 3)."""
        at = np.asarray(layer)
        azimuth = self.azimuth_deg[at] + np.asarray(column, dtype=np.float64) * self.step_deg
        return directions_of(self.elevation_deg[at], azimuth)

    def origins_m(self, layer: npt.ArrayLike, column: npt.ArrayLike) -> FloatArray | None:
        """Where those beams start, shape (n, 3); None for all at 0."""
        if self.origin_m is None:
            return None
        return _turned(self.origin_m[np.asarray(layer)], np.asarray(column, dtype=np.float64) * self.step_deg)

    def columns_of(self, position: FloatArray, layer: npt.NDArray[Any]) -> FloatArray:
        """The column that a channel's point lies in, a real number, shape (n,): of a turn around the frame's middle."""
        column = self._columns(position, layer)
        for _ in range(_ROUNDS):
            origin = self.origins_m(layer, column)
            if origin is not None:
                column = self._columns(position - origin, layer)
        return column

    def _columns(self, position: FloatArray, layer: npt.NDArray[Any]) -> FloatArray:
        azimuth = np.rad2deg(np.arctan2(position[:, 1], position[:, 0]))
        raw = (azimuth - self.azimuth_deg[layer]) / self.step_deg
        middle = 0.5 * (self.points - 1)
        return np.asarray(raw - self.turn_columns * np.rint((raw - middle) / self.turn_columns))


def angles_of_deg(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Elevation and azimuth [deg] of vectors, shape (n, 3)."""
    level = np.hypot(vector[:, 0], vector[:, 1])
    return np.rad2deg(np.arctan2(vector[:, 2], level)), np.rad2deg(np.arctan2(vector[:, 1], vector[:, 0]))


def directions_of(elevation_deg: FloatArray, azimuth_deg: FloatArray) -> FloatArray:
    """Unit vectors of angles, shape (n,) each; shape (n, 3)."""
    up, around = np.deg2rad(elevation_deg), np.deg2rad(azimuth_deg)
    level = np.cos(up)
    return np.stack([level * np.cos(around), level * np.sin(around), np.sin(up)], axis=-1)


def _turned(vector: FloatArray, degrees: FloatArray) -> FloatArray:
    """Vectors, shape (n, 3), turned about Z, each by its own angle."""
    cosine, sine = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    x, y, z = vector.T
    return np.stack([x * cosine - y * sine, x * sine + y * cosine, z], axis=-1)


def _wrapped(degrees: FloatArray) -> FloatArray:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)
