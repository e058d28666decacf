"""One frame of a case."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.cases.origin import CAST, Origin, Part
from lidarcheck.scan import IdealScan, Scan

__all__ = ["FEWEST_FRAMES", "Frame"]

FEWEST_FRAMES = 3
"""One frame each to fit, to select and to verify."""


@dataclass(frozen=True)
class Frame:
    """One frame of a case: `number` from 0 as in the case's file, what its beams meet, and what was measured.

    `untold`: what the ranges cannot tell from the frame as it is, as `the frame before`. `part`: what the case says
    that it is for, empty where it does not. `origin`: where its ideal scan comes from.
    """

    number: int
    ideal: IdealScan
    measured: Scan
    time_s: float
    untold: tuple[str, ...] = ()
    part: Part = ""
    origin: Origin = CAST

    @property
    def repeated(self) -> bool:
        """Whether all frames show the same rays again: those of a case whose ideal scans come from repeats."""
        return self.origin.source == "repeats" or (not self.origin.source and "DistanceError" in self.ideal.extra)

    @property
    def median_range_m(self) -> float:
        """Of the surfaces that beams meet, 0 where none does."""
        met = self.ideal.distance_m[self.ideal.distance_m > 0.0]
        return float(np.median(met)) if len(met) else 0.0
