"""What an ideal scan that was estimated may be off by: its distances and reflectances, drawn anew with each seed.

An ideal scan from measurements says of each row how far `Distance` and `Reflectance` may be off. Both are drawn once
for an ideal scan and ray, so that a simulation scatters about the row as written as much as the measurement does. Draws
are spread evenly, as rounding spreads values: where a sensor reports an amplitude in steps that are wide beside its
noise, a normal number of the same deviation would leave the step in one case of twelve, which no measurement does that
the row was estimated from; beside the noise of ranges and fine amplitudes the two are hardly told apart.

A draw is keyed by the seed and by what the row says: frames that are judged against one estimate share it, also where
some rows are left out of one of them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.shared.reflectance import reflectance_of, with_reflectance
from lidarcheck.model import streams
from lidarcheck.scan import IdealScan

__all__ = ["drawn", "is_estimate", "row_keys", "with_row_keys"]

DISTANCE_ERROR, REFLECTANCE_ERROR = "DistanceError", "ReflectanceError"
"""The further columns of an ideal scan: standard errors of the distance [m] and of the row's own reflectance."""
_KEY = "lidarcheck row key"
"""A column that goes with the rows while effects aim them, and into no file."""
_PURPOSE = "ideal scan"
_WIDTH = 2.0 * 3.0**0.5
"""Of an even distribution whose standard deviation is 1."""
_NEAREST_M = 1e-3
"""A drawn surface lies no nearer."""
_MIX = (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31))
_HALF, _LOW = np.uint64(32), np.uint64(0xFFFFFFFF)

Keys = npt.NDArray[np.uint64]


def is_estimate(ideal: IdealScan) -> bool:
    """Whether some row has an error of its own to draw."""
    own = REFLECTANCE_ERROR in ideal.extra and reflectance_of(ideal) is not None
    names = (DISTANCE_ERROR, REFLECTANCE_ERROR)[: 1 + own]
    return any(bool((_error(ideal, name) > 0.0).any()) for name in names if name in ideal.extra)


def row_keys(ideal: IdealScan) -> Keys:
    """One number a row, shape (n,), of its ray and of what it says of distance, reflectance and their errors."""
    kept = ideal.extra.get(_KEY)
    if kept is not None:
        return np.asarray(kept, dtype=np.uint64)
    key = streams.beam_keys(ideal.layer, ideal.point)
    own = reflectance_of(ideal)
    for column in (ideal.distance_m, own, _error(ideal, DISTANCE_ERROR), _error(ideal, REFLECTANCE_ERROR)):
        if column is not None:
            # One bit pattern for whatever is not known, and for zero.
            key = _mixed(key ^ np.where(np.isnan(column), -1.0, column + 0.0).view(np.uint64))
    return key


def with_row_keys(ideal: IdealScan) -> IdealScan:
    """The same rows, which keep their keys while effects aim them; itself where there is nothing to draw."""
    if _KEY in ideal.extra or not is_estimate(ideal):
        return ideal
    return replace(ideal, extra={**ideal.extra, _KEY: row_keys(ideal)})


def drawn(ideal: IdealScan, seed: int) -> IdealScan:
    """The rows with distances and reflectances as they may be, even about what is written; the same for a seed.

    A row without a surface, without an error or without a reflectance of its own stays as it is.
    """
    if not is_estimate(ideal):
        return ideal
    key = row_keys(ideal)
    off = _WIDTH * (streams.uniforms(seed, _PURPOSE, 0, key >> _HALF, key & _LOW, 2) - 0.5)
    distance = ideal.distance_m + _error(ideal, DISTANCE_ERROR) * off[:, 0]
    met = ideal.distance_m > 0.0
    found = replace(ideal, distance_m=np.where(met, np.maximum(distance, _NEAREST_M), ideal.distance_m))
    own = reflectance_of(ideal)
    if own is None:
        return found
    return with_reflectance(found, np.maximum(own + _error(ideal, REFLECTANCE_ERROR) * off[:, 1], 0.0))


def _error(ideal: IdealScan, name: str) -> FloatArray:
    """A column of errors, shape (n,), 0 where there is none."""
    column = ideal.extra.get(name)
    return np.zeros(len(ideal)) if column is None else np.nan_to_num(np.asarray(column, dtype=np.float64))


def _mixed(key: Keys) -> Keys:
    """Another number for each, every bit of which hangs on every bit (the finaliser of SplitMix64); same shape."""
    for factor, shift in zip(_MIX, _SHIFTS[:2], strict=True):
        key = (key ^ key >> shift) * factor
    return np.asarray(key ^ key >> _SHIFTS[2])
