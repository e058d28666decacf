"""Every range is off by the same length."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import ReadoutEffect, Surroundings, parameter
from lidarcheck.effects.ranges import at_range
from lidarcheck.scan import Scan

__all__ = ["RangeOffset"]


@dataclass(frozen=True)
class RangeOffset(ReadoutEffect):
    """Every range is off by the same length.

    R' = R + offset, along the beam, quantised as the sensor reports it: a constant delay of the trigger or of the
    cabling, 1 ns of delay being 0.15 m. Identity at offset 0.
    """

    name = "range_offset"

    offset_m: float = parameter("m", low=-10.0, high=10.0, typical=0.05, meaning="added to every range")

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move every echo along its beam."""
        return scan if self.offset_m == 0.0 else at_range(scan, scan.range_m + self.offset_m)
