"""The plane through what each beam meets, for beams that are no even grid: fitted to the beams around it.

Seen from the sensor's middle, the inverse range q of a plane is linear in the direction: q = m . u. Among the beams
around a row, those that agree on one m are its surface; m is the least squares of these.
"""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.effects.geometry.beam_tree import BeamTree
from lidarcheck.effects.geometry.planes import Planes, same_surface
from lidarcheck.scan import IdealScan

__all__ = ["planes_around"]

_BEND, _BEND_OF_STEP = 1e-3, 0.25
"""A beam lies on a surface where its q is off by less than this, of itself or of its step from the row's."""
_STEP = 0.02
"""Two beams alone lie on one surface where q differs by less than this."""
_EVEN = 0.01
"""Directions tell both slopes where their smaller spread is at least this part of the larger one, in squares."""
_RIDGE = 1e-9


def planes_around(ideal: IdealScan, point_m: FloatArray, axis: FloatArray, tree: BeamTree) -> Planes:
    """The planes m . x = 1, in the sensor's frame, of rows that meet something at `point_m` (n, 3) along `axis`.

    Where beams around a row tell its slope in one direction alone, it faces the sensor in the other one.
    """
    hit = ideal.distance_m > 0.0
    range_m = np.sqrt(np.square(point_m).sum(axis=1))
    q = np.divide(1.0, range_m, out=np.zeros(len(ideal)), where=hit)
    unit = np.where(hit[:, None], point_m * q[:, None], axis)
    east, north = _across(unit)
    columns = []
    for row in tree.neighbours(ideal):
        used = same_surface(ideal, row)
        off = unit[row]
        along = np.einsum("ij,ij->i", unit, off)
        a, b = np.einsum("ij,ij->i", east, off), np.einsum("ij,ij->i", north, off)
        columns.append((used, a, b, q[row] - q * along, np.abs(q[row] - q)))
    used, a, b, change, step = (np.stack(column, axis=1) for column in zip(*columns, strict=True))
    allowed = np.maximum(_BEND * q[:, None], _BEND_OF_STEP * step)
    agrees = _most_agreed(used, a, b, change, allowed)
    alone = used & (used.sum(axis=1, keepdims=True) <= 2) & (step <= _STEP * q[:, None])
    agrees = np.where(used.sum(axis=1, keepdims=True) <= 2, alone, agrees)
    slope, even = _least_squares(agrees, a, b, change)
    m = q[:, None] * unit + slope[:, :1] * east + slope[:, 1:] * north
    return Planes(m, hit & even)


def _across(unit: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors across each direction and each other: to the left, and up."""
    x, y = unit[:, 0], unit[:, 1]
    flat = np.sqrt(x * x + y * y)
    steep = flat < 1e-9
    flat = np.where(steep, 1.0, flat)
    east = np.stack([np.where(steep, 0.0, -y / flat), np.where(steep, 1.0, x / flat), np.zeros(len(x))], axis=1)
    return east, np.cross(unit, east)


def _most_agreed(used: BoolArray, a: FloatArray, b: FloatArray, change: FloatArray, allowed: FloatArray) -> BoolArray:
    """Of the planes through each row and two beams beside it, those that lie on the one that most do; (n, k)."""
    from lidarcheck.effects.geometry.compiled import most_agreed

    best = np.empty(used.shape, dtype=bool)
    most_agreed(used, (a, b, change), allowed, _RIDGE, np.empty(used.shape[1]), best)
    return best


def _least_squares(used: BoolArray, a: FloatArray, b: FloatArray, change: FloatArray) -> tuple[FloatArray, BoolArray]:
    """The slopes (n, 2) along both axes, and whether the beams that are used tell both."""
    aa, bb, ab = (np.where(used, one * other, 0.0).sum(axis=1) for one, other in ((a, a), (b, b), (a, b)))
    ac, bc = (np.where(used, one * change, 0.0).sum(axis=1) for one in (a, b))
    middle, half = 0.5 * (aa + bb), np.sqrt(0.25 * (aa - bb) ** 2 + ab**2)
    even = (middle > 0.0) & (middle - half >= _EVEN * (middle + half))
    aa, bb = aa + _RIDGE * middle, bb + _RIDGE * middle
    whole = np.where(middle > 0.0, aa * bb - ab * ab, 1.0)
    return np.stack([(ac * bb - bc * ab) / whole, (bc * aa - ac * ab) / whole], axis=1), even
