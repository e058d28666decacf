"""Where an echo lies: its direction beside its beam's, and its place beside the surface point that the beam meets."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray, IntArray
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Beams

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


def off_beam(
    x_m: FloatArray, y_m: FloatArray, z_m: FloatArray, layer: IntArray, point: IntArray, beams: Beams
) -> Directions:
    """How far echoes lie off the direction that their beam has by its number, seen from its origin, to 0.001 degree.

    The beam's direction follows from layer and point by the sensor's formulas alone, never from the table by which the
    model places echoes: an error of that table shows. All of shape (n,).
    """
    found = Directions(np.empty(len(x_m)), np.empty(len(x_m)))
    for start in range(0, len(x_m), _CHUNK):
        rows = slice(start, start + _CHUNK)
        x, y, z, numbers = x_m[rows], y_m[rows], z_m[rows], (layer[rows], point[rows])
        origins = _origins_m(beams, *numbers)
        if origins is not None:
            x, y, z = x - origins[:, 0], y - origins[:, 1], z - origins[:, 2]
        found.azimuth_deg[rows], found.elevation_deg[rows] = _off_beam(x, y, z, *_turn(beams, *numbers))
    lost = np.isnan(found.azimuth_deg) | np.isnan(found.elevation_deg)
    if lost.any():
        found.azimuth_deg[lost] = found.elevation_deg[lost] = np.nan
    return found


def _origins_m(beams: Beams, layer: IntArray, point: IntArray) -> FloatArray | None:
    """Where beams begin [m], shape (n, 3), NaN for a beam that the sensor does not have; None where all begin at 0."""
    if beams.central:
        return None
    known = beams.has(layer, point)
    origins = beams.origins_m(np.where(known, layer, 0), np.where(known, point, 0))
    return None if origins is None else np.where(known[:, None], origins, np.nan)


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


def _turn(beams: Beams, layer: IntArray, point: IntArray) -> tuple[_Turn, _Turn]:
    """Of beams' elevations and azimuths; NaN for a beam that the sensor does not have."""
    up, left = _turns(beams)
    known = beams.has(layer, point)
    # The last entry stands for what the sensor does not have.
    if beams.grid:
        rows, columns = np.where(known, layer, -1), np.where(known, point, -1)
    else:
        rows = columns = np.where(known, beams.index(layer, point), -1)
    return _Turn(up.cosine[rows], up.sine[rows]), _Turn(left.cosine[columns], left.sine[columns])


@functools.lru_cache(maxsize=4)
def _turns(beams: Beams) -> tuple[_Turn, _Turn]:
    """Of all elevations and azimuths: of a grid's layers and points, of other sensors' beams in order of `index`."""
    if beams.grid:
        elevation, _ = beams.angles_deg(np.arange(beams.layers), 0)
        _, azimuth = beams.angles_deg(0, np.arange(beams.points))
    else:
        layer, point = np.divmod(np.arange(beams.size), beams.points)
        elevation, azimuth = beams.angles_deg(layer, point)
    up, left = (np.deg2rad(angle) for angle in (elevation, azimuth))
    return _table(up), _table(left)


def _table(angle: FloatArray) -> _Turn:
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
    """Where rows of an ideal scan lie [m], shape (n, 3): its columns X, Y, Z, else `Distance` along the beam from its
    origin.

    Of no meaning where a row meets nothing. `rows`: which; all where None.
    """
    which = slice(None) if rows is None else rows
    named = {name.upper(): column for name, column in ideal.extra.items() if name.upper() in ("X", "Y", "Z")}
    if len(named) == 3:
        return np.stack([np.asarray(named[axis][which], dtype=np.float64) for axis in ("X", "Y", "Z")], axis=1)
    layer, point, distance_m = ideal.layer[which], ideal.point[which], ideal.distance_m[which]
    up, left = _turn(ideal.beams, layer, point)
    level_m = up.cosine * distance_m
    found = np.stack([left.cosine * level_m, left.sine * level_m, up.sine * distance_m], axis=1)
    origins = _origins_m(ideal.beams, layer, point)
    return found if origins is None else np.asarray(found + origins)


def off_surface(scan: Scan, echoes: IndexArray, ideal: IdealScan, surface: IndexArray) -> FloatArray:
    """Echo minus surface point [m], shape (n, 3): of the scan's rows `echoes` and the ideal scan's rows `surface`."""
    off_m = np.empty((3, len(echoes)))
    for start in range(0, len(echoes), _CHUNK):
        rows = slice(start, start + _CHUNK)
        place = surface_points(ideal, surface[rows])
        for axis, column in enumerate((scan.x_m, scan.y_m, scan.z_m)):
            off_m[axis, rows] = column[echoes[rows]] - place[:, axis]
    return off_m.T
