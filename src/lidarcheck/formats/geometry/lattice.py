"""What a sensor's beams are for the geometry check: a direction for each (layer, point), and how far apart they lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.sensor import LAYERS, POINTS, azimuth_deg, beam_directions, elevation_deg

__all__ = ["REFERENCE", "Beams", "Lattice", "ReferenceGrid"]


@dataclass(frozen=True, slots=True)
class Beams:
    """Where beams point: unit vectors, shape (n, 3), and half the distance to a beam's neighbours in each angle [deg].

    `half_azimuth_deg`, `half_elevation_deg`: a number, or shape (n,). The azimuth's counts around the vertical axis,
    and is held times the cosine of the elevation.
    """

    direction: FloatArray
    half_azimuth_deg: float | FloatArray
    half_elevation_deg: float | FloatArray

    def take(self, rows: npt.NDArray[np.intp] | slice) -> Beams:
        """The beams of those rows."""
        halves = (self.half_azimuth_deg, self.half_elevation_deg)
        azimuth, elevation = (half if np.ndim(half) == 0 else np.asarray(half)[rows] for half in halves)
        return Beams(self.direction[rows], azimuth, elevation)


class Lattice(Protocol):
    """Beams that are numbered by (layer, point). `step_deg`: from column to column and from layer to layer."""

    layers: int
    points: int
    step_deg: tuple[float, float]

    def beams(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> Beams:
        """The beams of those numbers, each of shape (n,); numbers beyond the lattice go on in its steps."""

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Azimuth and elevation [deg] of those numbers, shape (n,) each."""


class ReferenceGrid:
    """The reference sensor's grid."""

    layers = LAYERS
    points = POINTS
    step_deg = (0.125, 0.05)

    def beams(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> Beams:
        """The beams of those numbers."""
        azimuth, elevation = self.step_deg
        return Beams(beam_directions(layer, point), 0.5 * azimuth, 0.5 * elevation)

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Azimuth and elevation [deg] of those numbers."""
        return azimuth_deg(point), elevation_deg(layer)


REFERENCE: Lattice = ReferenceGrid()
