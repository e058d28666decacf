"""What usual errors of the sensor's place do to ranges: worth no name, and no classifier is asked of them."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.inference.nuisances import HEIGHT_ERROR_M, LIMIT, POSE_ERROR_DEG
from lidarcheck.inference.observed.beam_table import BeamTable
from lidarcheck.inference.observed.observations import Observations

__all__ = ["farther_by_height_m", "height_errors_m", "usual_range_errors_m"]

_FARTHEST_MOVED_M = 1.0
"""A surface seen at a grazing angle is taken to move no farther."""


def farther_by_height_m(beams: BeamTable, height_m: float = HEIGHT_ERROR_M) -> FloatArray:
    """How much longer ranges are for a sensor that is higher by so much, shape (n_beams,) [m]: it sees a surface as if
    it looked up by h / R, and ranges change along the surface's slope."""
    turn_deg = np.rad2deg(height_m / np.maximum(beams.distance_m, 1.0))
    return np.clip(beams.slope_m_per_deg[:, 0] * turn_deg, -_FARTHEST_MOVED_M, _FARTHEST_MOVED_M)


def usual_range_errors_m(
    beams: BeamTable, spread_m: FloatArray, measured: Observations, shown: Observations
) -> FloatArray:
    """By how much measured ranges are longer than what is shown, as far as usual errors of yaw, pitch and height make
    it, shape (n_beams,) [m]. Each costs the square of its usual errors, and none is beyond its limit.

    `spread_m` (n_beams,): of one range.
    """
    along = np.clip(beams.slope_m_per_deg * POSE_ERROR_DEG, -_FARTHEST_MOVED_M, _FARTHEST_MOVED_M)
    return _usual(np.column_stack([along, farther_by_height_m(beams)]), spread_m, measured, shown)


def height_errors_m(beams: BeamTable, spread_m: FloatArray, measured: Observations, shown: Observations) -> FloatArray:
    """The same of the height alone: no turn of the sensor does to near and far ground what a centimetre of it does."""
    return _usual(farther_by_height_m(beams)[:, None], spread_m, measured, shown)


def _usual(columns: FloatArray, spread_m: FloatArray, measured: Observations, shown: Observations) -> FloatArray:
    """By how much measured ranges are longer along `columns` (n_beams, n), each a usual error; shape (n_beams,) [m]."""
    both = measured.detected & shown.detected & columns.any(axis=1)
    # Of both sides' noise; what lies farther apart than any usual error makes it says nothing of these.
    noise = np.sqrt(2.0) * spread_m[both]
    off = np.clip((measured.feature[both, 0] - shown.feature[both, 0]) / noise, -LIMIT, LIMIT)
    standard = columns[both] / noise[:, None]
    errors = np.linalg.solve(standard.T @ standard + np.eye(columns.shape[1]), standard.T @ off)
    return np.asarray(columns @ np.clip(errors, -LIMIT, LIMIT))
