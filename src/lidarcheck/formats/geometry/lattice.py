"""What a sensor's beams are for the geometry check: a direction for each (layer, point), and how far apart they lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.sensor import reference_beams

__all__ = ["REFERENCE", "Beams", "Lattice", "ReferenceGrid"]


@dataclass(frozen=True, slots=True)
class Beams:
    """Where beams point: unit vectors, shape (n, 3), and half the distance to a beam's neighbours in each angle [deg].

    `half_azimuth_deg`, `half_elevation_deg`: a number, or shape (n,). The azimuth's counts around the vertical axis,
    and is held times the cosine of the elevation. `origin_m`, shape (n, 3): where they start, None for all at 0. A
    beam that the sensor does not have points nowhere: its direction is 0.
    """

    direction: FloatArray
    half_azimuth_deg: float | FloatArray
    half_elevation_deg: float | FloatArray
    origin_m: FloatArray | None = None

    def take(self, rows: npt.NDArray[np.intp] | slice) -> Beams:
        """The beams of those rows."""
        halves = (self.half_azimuth_deg, self.half_elevation_deg)
        azimuth, elevation = (half if np.ndim(half) == 0 else np.asarray(half)[rows] for half in halves)
        return Beams(self.direction[rows], azimuth, elevation, None if self.origin_m is None else self.origin_m[rows])


class Lattice(Protocol):
    """Beams that are numbered by (layer, point).

    `column_deg`: from a column to the next. `repeats`: whether a column's number names its direction.
    """

    @property
    def layers(self) -> int:
        """How many; so `points`."""

    @property
    def points(self) -> int: ...  # noqa: D102

    @property
    def column_deg(self) -> float:
        """The step of the azimuth."""

    @property
    def repeats(self) -> bool:
        """Whether every frame has the same columns."""

    def layers_beside(self, layer: npt.NDArray[Any], up_deg: FloatArray) -> npt.NDArray[Any]:
        """The layers that look so much higher than these, shape (n,), beyond the sensor's where there is none."""

    def line(self, kind: str, value: float = 0.0) -> str:
        """What to change in the sensor's file where this is wrong; empty where that is not the way."""

    def beams(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> Beams:
        """The beams of those numbers, each of shape (n,); numbers beyond the lattice go on in its steps."""

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Azimuth and elevation [deg] of those numbers, shape (n,) each."""


class ReferenceGrid:
    """The reference sensor's grid."""

    repeats = True

    @property
    def layers(self) -> int:
        """Number of layers."""
        return reference_beams().layers

    @property
    def points(self) -> int:
        """Number of points in a layer."""
        return reference_beams().points

    @property
    def column_deg(self) -> float:
        """From a point to the next one."""
        return reference_beams().azimuth.step_deg

    @property
    def layer_deg(self) -> float:
        """From a layer to the next one."""
        return reference_beams().elevation.step_deg

    def layers_beside(self, layer: npt.NDArray[Any], up_deg: FloatArray) -> npt.NDArray[Any]:
        """The layers that look so much higher."""
        return np.rint(layer + up_deg / self.layer_deg)

    def line(self, kind: str, value: float = 0.0) -> str:
        """The sensor is what it is: none."""
        return ""

    def beams(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> Beams:
        """The beams of those numbers."""
        return Beams(reference_beams().directions(layer, point), 0.5 * self.column_deg, 0.5 * self.layer_deg)

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Azimuth and elevation [deg] of those numbers."""
        elevation, azimuth = reference_beams().angles_deg(layer, point)
        return azimuth, elevation


REFERENCE: Lattice = ReferenceGrid()
