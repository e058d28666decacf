"""The range shifts with the echo's amplitude, beyond pile-up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import ReadoutEffect, Surroundings, list_parameter, parameter
from lidarcheck.effects.shared.ranges import at_range
from lidarcheck.scan import Scan

__all__ = ["LARGEST_REFERENCE", "QUARTERS", "WalkError"]

LARGEST_REFERENCE = 1e6
"""The largest AREA that may be the one that is not shifted."""
QUARTERS = 4
"""Knots of the table of shifts in a decade of AREA."""


@dataclass(frozen=True)
class WalkError(ReadoutEffect):
    """The range shifts with the echo's amplitude, beyond pile-up.

    R' = R + per_decade y + bend y^2, y = log10(AREA / reference_area), AREA being the amplitude that the detector
    counts: of a SPAD array AREA, of a linear detector a before calibration and rounding, of a histogram chip the
    photons of the echo, of a program its `strength` feature; with a `power` q other than 0 instead y = ((AREA /
    reference_area)^q - 1) / (q ln 10), of which the logarithm is the limit, so that a walk of a / AREA^p is power -p.
    What such curves have not, a table says: `shifts_m` are added at AREA 1, 10^(1/4), 10^(1/2) and so on in quarters of
    a decade, and linearly in log AREA between. By AREA, since PEAK saturates: a comparator's threshold is crossed
    earlier by a larger pulse, or an amplitude correction was calibrated on other data. The pile-up's own walk comes
    from the SPADs and stays. Silicon photomultipliers: 36.6 cm over 1.3 ... 46.5 photons, 1.95 cm after correction
    (Photonics 9, 24, 2022).

    The echoes of a beam that change places are numbered anew; no range falls below 0. Valid where the shift stays below
    a few metres; an AREA below 1 counts as 1. Identity at per_decade 0 and bend 0 without shifts.
    """

    name = "walk_error"
    by_strength = True

    per_decade_m: float = parameter(
        "m", low=-2.0, high=2.0, typical=0.05, noticeable=0.01, meaning="shift per decade of AREA"
    )
    bend_m: float = parameter(
        "m", low=-2.0, high=2.0, typical=0.0, noticeable=0.01, meaning="shift per squared decade of AREA"
    )
    reference_area: float = parameter(
        "", low=1.0, high=LARGEST_REFERENCE, typical=1000.0, noticeable=100.0, meaning="AREA that is not shifted"
    )
    power: float = parameter(
        "", low=-2.0, high=2.0, typical=0.0, noticeable=0.25, meaning="power of AREA; 0 for the logarithm"
    )
    shifts_m: tuple[float, ...] = list_parameter(
        "m",
        low=-10.0,
        high=10.0,
        noticeable=0.01,
        meaning="shifts besides, at AREA 1 and every quarter of a decade from there",
    )

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move each echo by its amplitude's shift."""
        if self.per_decade_m == 0.0 and self.bend_m == 0.0 and not self.shifts_m:
            return scan
        return at_range(scan, scan.range_m + self.shift_m(scan.strength))

    def shift_m(self, area: FloatArray) -> FloatArray:
        """The shift of echoes of that AREA, same shape."""
        exponent = self.power * elementary.log(np.maximum(area, 1.0) / self.reference_area)
        if abs(self.power) < 1e-6:
            y = elementary.log10(np.maximum(area, 1.0) / self.reference_area)
        else:
            y = elementary.expm1(exponent) / (self.power * elementary.log(10.0))
        curve = self.per_decade_m * y + self.bend_m * y**2
        if not self.shifts_m:
            return np.asarray(curve)
        quarters = QUARTERS * elementary.log10(np.maximum(area, 1.0))
        return np.asarray(curve + np.interp(quarters, np.arange(len(self.shifts_m)), self.shifts_m))
