"""How fast the head turns and how a file writes its times, as the times of its rows show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.assign.cloud import Cloud
from lidarcheck.formats.guess.columns import turn_rate
from lidarcheck.formats.guess.rows import Labelled
from lidarcheck.formats.times import TIME_UNITS

__all__ = ["Turning", "turning_of"]

_RATES_HZ = (1.0, 50.0)
"""Heads turn so often a second; units lie a factor of 1000 apart, so that one fits."""
_WHOLE = 0.03
"""A rate so near to a whole number, as a part of it, is meant to be it."""


@dataclass(frozen=True)
class Turning:
    """`deg_per_s` with its sign, the unit and zero of the file's times, and `time_s` (n,) from each frame's first."""

    deg_per_s: float
    unit: str
    zero: str
    time_s: FloatArray

    @property
    def rate_hz(self) -> float:
        """Turns a second."""
        rate = abs(self.deg_per_s) / 360.0
        return float(round(rate)) if abs(rate - round(rate)) <= _WHOLE * rate else round(rate, 3)


def turning_of(clouds: Sequence[Cloud], rows: Labelled) -> Turning | None:
    """What the times say; None where there are none, or where they show no turning."""
    if rows.time is None:
        return None
    first = np.array([rows.time[rows.frame == k].min() for k in range(rows.frames)])
    since = (rows.time - first[rows.frame]).astype(np.float64)
    own = turn_rate(rows.azimuth_deg, since, rows.ring.astype(np.int64) + rows.frame.astype(np.int64) * 100_000)
    if own is None:
        return None
    low, high = _RATES_HZ
    fitting = [(name, s) for name, s in TIME_UNITS.items() if low <= abs(own) / s / 360.0 <= high]
    if len(fitting) != 1:
        return None
    unit, unit_s = fitting[0]
    last = float(max(cloud.time.max() for cloud in clouds if cloud.time is not None)) * unit_s
    start = float(first.min()) * unit_s
    zero = "last" if start < 0.0 and last <= 0.0 else "first" if start >= 0.0 and last <= 2.0 / low else "epoch"
    return Turning(own / unit_s, unit, zero, since * unit_s)
