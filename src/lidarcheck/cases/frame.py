"""One frame of a case."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.scan import IdealScan, Scan

__all__ = ["FEWEST_FRAMES", "Frame"]

FEWEST_FRAMES = 3
"""One frame each to fit, to select and to verify."""


@dataclass(frozen=True)
class Frame:
    """One frame of a case: `number` from 0 as in the case's file, what its beams meet, and what was measured.

    `untold`: what the ranges cannot tell from the frame as it is, as `the frame before`.
    """

    number: int
    ideal: IdealScan
    measured: Scan
    time_s: float
    untold: tuple[str, ...] = ()

    @property
    def median_range_m(self) -> float:
        """Of the surfaces that beams meet, 0 where none does."""
        met = self.ideal.distance_m[self.ideal.distance_m > 0.0]
        return float(np.median(met)) if len(met) else 0.0
