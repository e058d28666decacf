"""Where an echo lies: its direction beside its beam's, and its place beside the surface point that the beam meets."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import LAYERS, POINTS, azimuth_deg, elevation_deg

__all__ = ["Directions", "off_beam", "surface_points"]

ANGLE_DIGITS = 3
"""Decimals of a direction [deg]: a text file rounds X, Y and Z, and two equal directions must not differ by that."""
_SMALL = 0.02
"""Up to this sine its series to the third order gives the angle to 1e-7 deg."""
_Turns = tuple[FloatArray, FloatArray]


class Directions(NamedTuple):
    """Directions of echoes minus those of their beams [deg], shape (n,) each, positive to the left and upward.

    NaN where an echo's beam is not one of the sensor's, or the echo lies at the sensor itself.
    """

    azimuth_deg: FloatArray
    elevation_deg: FloatArray


def off_beam(x_m: FloatArray, y_m: FloatArray, z_m: FloatArray, layer: IntArray, point: IntArray) -> Directions:
    """How far echoes lie off the direction that their beam has by its number, to a thousandth of a degree.

    The beam's direction follows from layer and point by the sensor's formulas alone, never from the table by which the
    model places echoes: an error of that table shows. All of shape (n,).
    """
    own = (layer >= 0) & (layer < LAYERS) & (point >= 0) & (point < POINTS)
    (cos_up, sin_up), (cos_left, sin_left) = (
        (turns[0][at], turns[1][at])
        for turns, at in ((_turns("layer"), np.where(own, layer, 0)), (_turns("point"), np.where(own, point, 0)))
    )
    along_m = np.sqrt(x_m * x_m + y_m * y_m)
    left = _angle_deg(y_m * cos_left - x_m * sin_left, x_m * cos_left + y_m * sin_left, along_m)
    up = _angle_deg(
        z_m * cos_up - along_m * sin_up, along_m * cos_up + z_m * sin_up, np.sqrt(along_m * along_m + z_m * z_m)
    )
    for angle in (left, up):
        angle[~own] = np.nan
    return Directions(left, up)


@functools.cache
def _turns(axis: str) -> _Turns:
    """Cosine and sine of each layer's elevation, or of each point's azimuth."""
    degrees = elevation_deg(np.arange(LAYERS)) if axis == "layer" else azimuth_deg(np.arange(POINTS))
    angle = np.deg2rad(degrees)
    return elementary.cos(angle), elementary.sin(angle)


def _angle_deg(opposite_m: FloatArray, adjacent_m: FloatArray, length_m: FloatArray) -> FloatArray:
    """The angle with those sides, rounded; NaN where the length is 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sine = opposite_m / length_m
    angle = sine + sine * sine * sine / 6.0
    wide = np.flatnonzero((np.abs(sine) > _SMALL) | (adjacent_m < 0.0))
    angle[wide] = elementary.arctan2(opposite_m[wide], adjacent_m[wide])
    # Adding 0 makes a positive zero of a negative one: means of nothing but zeros are then one number.
    return np.asarray(np.round(np.rad2deg(angle), ANGLE_DIGITS) + 0.0)


def surface_points(ideal: IdealScan) -> FloatArray:
    """Where the rows of an ideal scan lie [m], shape (n, 3): its columns X, Y, Z, else `Distance` along the beam.

    Of no meaning where a row meets nothing.
    """
    named = {name.upper(): column for name, column in ideal.extra.items() if name.upper() in ("X", "Y", "Z")}
    if len(named) == 3:
        return np.stack([np.asarray(named[axis], dtype=np.float64) for axis in ("X", "Y", "Z")], axis=1)
    (cos_up, sin_up), (cos_left, sin_left) = (
        (elementary.cos(angle), elementary.sin(angle))
        for angle in (np.deg2rad(elevation_deg(ideal.layer)), np.deg2rad(azimuth_deg(ideal.point)))
    )
    return np.stack([cos_left * cos_up, sin_left * cos_up, sin_up], axis=1) * ideal.distance_m[:, None]
