"""The built-in sensors' grid: what a table's beams are where nobody says otherwise."""

from __future__ import annotations

import functools
from typing import Literal

import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.sensor.grid import GridBeams

__all__ = [
    "LAYERS",
    "POINTS",
    "VARIANTS",
    "azimuth_deg",
    "beam_directions",
    "cos_sin",
    "elevation_deg",
    "layer_of",
    "point_of",
    "reference_beams",
]

VARIANTS: tuple[Literal["SMART"], Literal["SLIM"]] = ("SMART", "SLIM")


@functools.cache
def reference_beams() -> GridBeams:
    """The beams of SMART and of SLIM."""
    from lidarcheck.sensor.document import shipped

    beams = shipped(VARIANTS[0]).beams
    assert isinstance(beams, GridBeams)
    return beams


LAYERS, POINTS = 520, 960


def elevation_deg(layer: npt.ArrayLike) -> FloatArray:
    """Elevation of a layer [deg]; same shape."""
    return reference_beams().elevation.angle_deg(layer)


def azimuth_deg(point: npt.ArrayLike) -> FloatArray:
    """Azimuth of a point column [deg], positive to the left; same shape."""
    return reference_beams().azimuth.angle_deg(point)


def layer_of(elevation: npt.ArrayLike) -> IntArray:
    """Nearest layer of an elevation [deg]; may lie outside 0 ... 519."""
    return reference_beams().elevation.nearest(elevation)


def point_of(azimuth: npt.ArrayLike) -> IntArray:
    """Nearest point column of an azimuth [deg]; may lie outside 0 ... 959."""
    return reference_beams().azimuth.nearest(azimuth)


def beam_directions(layer: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
    """Unit vectors of beams, shape (n, 3), in the sensor frame."""
    return reference_beams().directions(layer, point)


def cos_sin(index: npt.ArrayLike, axis: Literal["layer", "point"]) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine of the indices' angles; those of the sensor's own beams are read off a table."""
    beams = reference_beams()
    return (beams.elevation if axis == "layer" else beams.azimuth).cos_sin(index)
