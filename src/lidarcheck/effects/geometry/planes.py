"""The plane through what each beam meets, estimated from the beams around it.

Along beams from one origin, the inverse range of a plane is linear in the direction: 1/R = m . u, where m is the
plane's normal over its distance. So q = 1/R and its slopes along elevation and azimuth give m without a solver, and
three beams lie on one plane where q does not bend.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.geometry.beam_grid import BeamGrid
from lidarcheck.scan import IdealScan

__all__ = ["Planes", "planes_of", "same_surface"]


_BEND, _BEND_OF_STEP = 1e-3, 0.25
"""Three beams lie on one surface where q bends by less than this, of itself or of its step from beam to beam."""
_STEP = 0.02
"""Two beams alone lie on one surface where q differs by less than this."""


class Planes(NamedTuple):
    """The plane m . (x - origin) = 1 of each row, `m` (n, 3), 0 where it meets nothing.

    `known`: whether neighbours told its slope both ways; otherwise it faces the beam in the direction they did not.
    """

    m: FloatArray
    known: BoolArray


class _Slope(NamedTuple):
    """dq/dangle, whether it is known, and to which side it was taken: -1, 0 or 1."""

    value: FloatArray
    known: BoolArray
    side: FloatArray


def planes_of(ideal: IdealScan, direction: FloatArray, grid: BeamGrid) -> Planes:
    """The planes of the rows, whose rays have the unit vectors `direction` (n, 3)."""
    hit = ideal.distance_m > 0.0
    q = np.divide(1.0, ideal.distance_m, out=np.zeros(len(ideal)), where=hit)
    x, y, sine = direction.T
    cosine = np.maximum(np.sqrt(x * x + y * y), 1e-12)
    steps = grid.steps_rad
    up = _slope(ideal, grid, q, steps[0], vertical=True)
    left = _slope(ideal, grid, q, steps[1], vertical=False)
    # One-sided along a circle of equal elevation: the part along Z does not turn with the azimuth.
    m_z = q * sine + up.value * cosine
    across = left.value - left.side * m_z * sine * elementary.tan(0.5 * steps[1])
    across = np.where(left.known, across, 0.0) / cosine
    east, north = x / cosine, y / cosine
    m = np.stack(
        [
            q * x - up.value * sine * east - across * north,
            q * y - up.value * sine * north + across * east,
            m_z,
        ],
        axis=1,
    )
    return Planes(m, hit & up.known & left.known)


def same_surface(ideal: IdealScan, row: IndexArray) -> BoolArray:
    """Whether each row and the row beside it (-1: none) meet one object, or one material where objects are unknown."""
    label = ideal.material_id if ideal.object_id is None else ideal.object_id
    there = row >= 0
    return np.asarray(there & (ideal.distance_m > 0.0) & (ideal.distance_m[row] > 0.0) & (label == label[row]))


def _slope(ideal: IdealScan, grid: BeamGrid, q: FloatArray, step_rad: float, *, vertical: bool) -> _Slope:
    """Of the two one-sided slopes and the central one, the one along which q bends least."""
    from lidarcheck.effects.geometry.compiled import slopes

    n = len(q)
    found = _Slope(np.empty(n), np.empty(n, dtype=bool), np.empty(n))
    label = ideal.material_id if ideal.object_id is None else ideal.object_id
    step = float(elementary.sin(step_rad)), float(elementary.cos(step_rad))
    limits = _BEND, _BEND_OF_STEP, _STEP
    slopes(q, label, grid.cells_of(ideal), grid.lines, vertical, step, limits, found.value, found.side, found.known)
    return found
