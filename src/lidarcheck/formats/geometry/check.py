"""Whether points lie where their beams point: the errors of each angle, what can be judged, and the verdict.

Pure functions of arrays: directions of shape (n, 3), positions of shape (n, 3) from the beams' origin. The check says
whether X, Y, Z and a beam agree; `mismatch` says what would make them agree.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.formats.geometry.lattice import Beams

__all__ = ["FEWEST_JUDGED", "FEWEST_ROWS", "PASSED", "Agreement", "agreement", "angle_errors", "outside", "refuses"]

PASSED = 0.99
"""Share of the judged rows that must lie within their tolerance."""
FEWEST_JUDGED = 200
"""Of fewer rows nothing is confirmed."""
FEWEST_ROWS = 4
"""Three points are fitted by some pose whatever they are; fewer than four rows refuse nothing."""
_PIECE = 1 << 15
"""Rows that are looked at together: their columns stay in the processor's cache."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """How many of the `rows` could be judged, how many of these passed, and how many of all lie outside their bound."""

    rows: int
    judged: int
    passed: int
    outside: int


def agreement(x: FloatArray, y: FloatArray, z: FloatArray, beams: Beams, error_m: float) -> Agreement:
    """How the points, columns of shape (n,), agree with their beams, shape (n,).

    `error_m`: how far the file's rounding can have moved a point. A row's bound in each angle is half the distance to
    the neighbouring beam and what the rounding makes of it; the row is judged where the second is not the larger.
    """
    judged = passed = out = 0
    for rows in _pieces(len(x)):
        wide, clear = _outside(x[rows], y[rows], z[rows], beams.take(rows), error_m)
        judged += int(np.count_nonzero(clear))
        passed += int(np.count_nonzero(clear & ~wide))
        out += int(np.count_nonzero(wide))
    return Agreement(len(x), judged, passed, out)


def refuses(found: Agreement) -> bool:
    """Whether the rows do not lie where their beams point.

    Where too few can be judged, so do 1 % of all rows outside their bound, or half of them where there are few rows.
    """
    if found.judged >= FEWEST_JUDGED:
        return found.passed < PASSED * found.judged
    if found.rows < FEWEST_ROWS:
        return False
    return found.outside > (1.0 - PASSED if found.rows >= FEWEST_JUDGED else 0.5) * found.rows


def outside(position: FloatArray, beams: Beams, error_m: float) -> tuple[BoolArray, BoolArray]:
    """Which points, shape (n, 3), lie outside their bound, and which can be judged; shape (n,) each."""
    return _outside(position[:, 0], position[:, 1], position[:, 2], beams, error_m)


def angle_errors(position: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Azimuth (times the elevation's cosine) and elevation of points less those of directions [deg], shape (n,)."""
    azimuth = np.arctan2(position[:, 1], position[:, 0]) - np.arctan2(direction[:, 1], direction[:, 0])
    level = np.hypot(direction[:, 0], direction[:, 1])
    elevation = np.arctan2(position[:, 2], np.hypot(position[:, 0], position[:, 1])) - np.arctan2(
        direction[:, 2], level
    )
    around = (azimuth + np.pi) % (2.0 * np.pi) - np.pi
    return np.rad2deg(around) * level, np.rad2deg(elevation)


def _pieces(n: int) -> Iterator[slice]:
    return (slice(start, start + _PIECE) for start in range(0, n, _PIECE))


def _outside(x: FloatArray, y: FloatArray, z: FloatArray, beams: Beams, error_m: float) -> tuple[BoolArray, BoolArray]:
    """As `outside`; by sines, without an inverse function: what lies behind its beam is outside whatever its sine."""
    ux, uy, uz = beams.direction[:, 0], beams.direction[:, 1], beams.direction[:, 2]
    level_sq = x * x + y * y
    level, range_m = np.sqrt(level_sq), np.sqrt(level_sq + z * z)
    cosine = np.sqrt(1.0 - np.minimum(uz * uz, 1.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        blur = error_m / range_m
        sine_azimuth = np.abs(y * ux - x * uy) / level
        sine_elevation = np.abs(z * cosine - level * uz) / range_m
    half_azimuth = np.deg2rad(beams.half_azimuth_deg) * cosine
    half_elevation = np.deg2rad(beams.half_elevation_deg)
    # One part in a million: a neighbour's very edge lies within, whatever the last bit says.
    near_azimuth = sine_azimuth <= half_azimuth * (1.0 + 1e-6) + blur
    near_elevation = sine_elevation <= half_elevation * (1.0 + 1e-6) + blur
    within = near_azimuth & near_elevation & (x * ux + y * uy > 0.0)
    clear = (blur <= half_azimuth) & (blur <= half_elevation)
    # A blur wider than the sky hides everything.
    return ~within & (blur < 1.0), clear
