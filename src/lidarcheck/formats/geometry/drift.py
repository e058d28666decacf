"""What lies within the tolerance and is still no chance: a small rotation, and layers off by a constant each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IntArray
from lidarcheck.formats.geometry.changes import layer_medians
from lidarcheck.formats.geometry.check import angle_errors
from lidarcheck.formats.geometry.lattice import Beams

__all__ = ["Drift", "drift_of"]

_OF_SPACING = 0.1
"""A rotation or a layer is worth a warning beyond this part of the spacing, and what noise there is."""
_LAYERS_SHARE, _FEWEST_LAYERS = 0.1, 2
_FEWEST_IN_LAYER = 5
"""Rows that give a layer a median."""
_FEWEST_ROWS = 50
"""Of fewer judged rows no rotation is said."""


@dataclass(frozen=True, slots=True)
class Drift:
    """A warning of what the judged rows share. `rotation_deg`: roll, pitch, yaw that turn the points onto the beams.

    `off_layers`: layers that are off when the rotation is out. `words`: what to say.
    """

    rotation_deg: tuple[float, float, float]
    off_layers: int
    words: str


def drift_of(position: FloatArray, beams: Beams, layer: IntArray, judged: BoolArray, error_m: float) -> Drift | None:
    """What the judged rows, shape (n,), share that is more than noise; None where it is not."""
    rows = np.flatnonzero(judged)
    if len(rows) < _FEWEST_ROWS:
        return None
    position, beams, layer = position[rows], beams.take(rows), layer[rows]
    errors = np.stack(angle_errors(position, beams.direction))
    blur = float(np.rad2deg(np.median(error_m / np.linalg.norm(position, axis=1))))
    limits = []
    for error, half in zip(errors, (beams.half_azimuth_deg, beams.half_elevation_deg), strict=True):
        own = layer_medians(error, layer)
        spread = float(np.median(np.abs(error - own)))
        limits.append(_OF_SPACING * 2.0 * float(np.median(half)) + blur + spread)
    turn, made = _rotation(beams.direction, errors)
    moved = np.sqrt(np.mean(np.square(made), axis=1))
    left = errors - made
    off, count = _off_layers(left, layer, limits)
    few = max(_FEWEST_LAYERS, _LAYERS_SHARE * count)
    roll, pitch, yaw = (round(float(a), 3) + 0.0 for a in np.rad2deg(-turn))
    if moved[0] > limits[0] or moved[1] > limits[1]:
        by = f"roll {0.0 - roll:g}, pitch {0.0 - pitch:g}, yaw {0.0 - yaw:g} deg"
        back = f'--pose "0,0,0,{roll:g},{pitch:g},{yaw:g}" takes that out'
        words = f"the points are turned against the beams by {by}; {back}"
        return Drift((roll, pitch, yaw), len(off), words)
    if len(off) >= few:
        worst = int(off[0])
        return Drift(
            (roll, pitch, yaw), len(off), f"{len(off)} of {count} layers lie off their beams, as layer {worst}"
        )
    return None


def _rotation(direction: FloatArray, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The small rotation vector [rad] that the errors, shape (2, n) [deg], show, and the errors it makes."""
    level = np.maximum(np.hypot(direction[:, 0], direction[:, 1]), 1e-12)
    zero = np.zeros_like(level)
    east = np.stack([-direction[:, 1] / level, direction[:, 0] / level, zero], axis=-1)
    up = np.cross(direction, east)
    # (w x u) . e = w . (u x e)
    slopes = np.concatenate([np.cross(direction, east), np.cross(direction, up)])
    turn = np.linalg.lstsq(slopes, np.deg2rad(errors).ravel(), rcond=1e-4)[0]
    return turn, np.rad2deg(slopes @ turn).reshape(2, -1)


def _off_layers(errors: FloatArray, layer: IntArray, limits: list[float]) -> tuple[IntArray, int]:
    """The layers whose median error is above the limit in either angle, the worst first, and how many there are."""
    names, first, counts = np.unique(layer, return_index=True, return_counts=True)
    azimuth, elevation = (np.abs(layer_medians(error, layer)[first]) for error in errors)
    times = np.maximum(azimuth / limits[0], elevation / limits[1])
    enough = counts >= _FEWEST_IN_LAYER
    order = np.argsort(-times, kind="stable")
    return names[order][enough[order] & (times[order] > 1.0)], int(np.count_nonzero(enough))
