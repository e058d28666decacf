"""Where an echo lies: its direction beside its beam's, and its place beside the surface point that the beam meets."""

from __future__ import annotations

import functools
from typing import Literal, NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import LAYERS, POINTS, azimuth_deg, elevation_deg

__all__ = ["Directions", "off_beam", "off_surface", "surface_points"]

ANGLE_DIGITS = 3
"""Decimals of a direction [deg]: a text file rounds X, Y and Z, and two equal directions must not differ by that."""
_SMALL = 0.02
"""Up to this sine its series to the third order gives the angle to 1e-7 deg."""
_CHUNK = 16_384
"""Echoes at a time: few enough that what lies between is still in the cache."""


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
    found = Directions(np.empty(len(x_m)), np.empty(len(x_m)))
    for start in range(0, len(x_m), _CHUNK):
        rows = slice(start, start + _CHUNK)
        found.azimuth_deg[rows], found.elevation_deg[rows] = _off_beam(
            x_m[rows], y_m[rows], z_m[rows], _turn(layer[rows], "layer"), _turn(point[rows], "point")
        )
    lost = np.isnan(found.azimuth_deg) | np.isnan(found.elevation_deg)
    if lost.any():
        found.azimuth_deg[lost] = found.elevation_deg[lost] = np.nan
    return found


class _Turn(NamedTuple):
    """Cosine and sine of angles."""

    cosine: FloatArray
    sine: FloatArray


def _off_beam(x_m: FloatArray, y_m: FloatArray, z_m: FloatArray, up: _Turn, left: _Turn) -> Directions:
    level_m = np.sqrt(x_m * x_m + y_m * y_m)
    return Directions(
        _angle_deg(y_m * left.cosine - x_m * left.sine, x_m * left.cosine + y_m * left.sine, level_m),
        _angle_deg(
            z_m * up.cosine - level_m * up.sine,
            level_m * up.cosine + z_m * up.sine,
            np.sqrt(level_m * level_m + z_m * z_m),
        ),
    )


def _turn(index: IntArray, axis: Literal["layer", "point"]) -> _Turn:
    """Of layers' elevations or points' azimuths; NaN for a layer or point that the sensor does not have."""
    cosine, sine = _turns(axis)
    # The last entry stands for what the sensor does not have, -1 among it.
    at = np.where(index < len(cosine) - 1, index, -1)
    at = np.where(at < 0, -1, at)
    return _Turn(cosine[at], sine[at])


@functools.cache
def _turns(axis: Literal["layer", "point"]) -> _Turn:
    degrees = elevation_deg(np.arange(LAYERS)) if axis == "layer" else azimuth_deg(np.arange(POINTS))
    angle = np.deg2rad(degrees)
    return _Turn(np.append(elementary.cos(angle), np.nan), np.append(elementary.sin(angle), np.nan))


def _angle_deg(opposite_m: FloatArray, adjacent_m: FloatArray, length_m: FloatArray) -> FloatArray:
    """The angle with those sides, rounded; NaN where the length is 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sine = opposite_m / length_m
    angle = sine + sine * sine * sine / 6.0
    wide = np.flatnonzero((np.abs(sine) > _SMALL) | (adjacent_m < 0.0))
    if len(wide):
        angle[wide] = elementary.arctan2(opposite_m[wide], adjacent_m[wide])
    # Adding 0 makes a positive zero of a negative one: means of nothing but zeros are then one number.
    return np.asarray(np.round(np.rad2deg(angle), ANGLE_DIGITS) + 0.0)


def surface_points(ideal: IdealScan, rows: IndexArray | None = None) -> FloatArray:
    """Where rows of an ideal scan lie [m], shape (n, 3): its columns X, Y, Z, else `Distance` along the beam.

    Of no meaning where a row meets nothing. `rows`: which; all where None.
    """
    which = slice(None) if rows is None else rows
    named = {name.upper(): column for name, column in ideal.extra.items() if name.upper() in ("X", "Y", "Z")}
    if len(named) == 3:
        return np.stack([np.asarray(named[axis][which], dtype=np.float64) for axis in ("X", "Y", "Z")], axis=1)
    up, left, distance_m = _turn(ideal.layer[which], "layer"), _turn(ideal.point[which], "point"), ideal.distance_m
    level_m = up.cosine * distance_m[which]
    return np.stack([left.cosine * level_m, left.sine * level_m, up.sine * distance_m[which]], axis=1)


def off_surface(scan: Scan, echoes: IndexArray, ideal: IdealScan, surface: IndexArray) -> FloatArray:
    """Echo minus surface point [m], shape (n, 3): of the scan's rows `echoes` and the ideal scan's rows `surface`."""
    off_m = np.empty((3, len(echoes)))
    for start in range(0, len(echoes), _CHUNK):
        rows = slice(start, start + _CHUNK)
        place = surface_points(ideal, surface[rows])
        for axis, column in enumerate((scan.x_m, scan.y_m, scan.z_m)):
            off_m[axis, rows] = column[echoes[rows]] - place[:, axis]
    return off_m.T
