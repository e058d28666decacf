"""Where two clouds of one scene hold other numbers of echoes: slices along X, Y and Z."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = ["Slice", "slices_of"]

SLICES = 8
_OUTER = 1.0
"""Percent of the points at either end of an axis that share a slice with what lies beyond."""


@dataclass(frozen=True)
class Slice:
    """Echoes between two planes. `axis`: X, Y or Z; `low_m`, `high_m`: infinite at the ends; `off_sd`: by how many
    standard deviations of counted echoes, sqrt(real + simulated), the counts differ.
    """

    axis: str
    low_m: float
    high_m: float
    real: int
    simulated: int
    off_sd: float

    def words(self) -> str:
        """Where it is."""
        if math.isinf(self.low_m):
            return f"{self.axis} below {self.high_m:.2f} m"
        return (
            f"{self.axis} above {self.low_m:.2f} m"
            if math.isinf(self.high_m)
            else f"{self.axis} {self.low_m:.2f} to {self.high_m:.2f} m"
        )


def slices_of(real_m: FloatArray, simulated_m: FloatArray, slices: int = SLICES) -> list[Slice]:
    """Slices of both clouds, shapes (n, 3), those whose counts differ most first; none of an axis without extent.

    Echoes of a beam are not independent of its neighbours', so that a deviation of 2 is a hint, not a finding.
    """
    found = []
    for i, axis in enumerate("XYZ"):
        both = np.concatenate([real_m[:, i], simulated_m[:, i]])
        if not len(both):
            continue
        low, high = np.percentile(both, [_OUTER, 100.0 - _OUTER])
        if high <= low:
            continue
        borders = np.linspace(low, high, slices + 1)
        borders[[0, -1]] = -math.inf, math.inf
        counts = [np.histogram(side[:, i], borders)[0] for side in (real_m, simulated_m)]
        for at, (r, s) in enumerate(zip(*(count.tolist() for count in counts), strict=True)):
            off = abs(r - s) / math.sqrt(r + s) if r + s else 0.0
            found.append(Slice(axis, float(borders[at]), float(borders[at + 1]), r, s, off))
    return sorted(found, key=lambda one: -one.off_sd)
