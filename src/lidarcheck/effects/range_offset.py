"""Every range is off by the same length."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import ReadoutEffect, Surroundings, parameter
from lidarcheck.effects.shared.ranges import StageByWhat, at_range, moved_light, what_moves
from lidarcheck.scan import Light, Scan

__all__ = ["RangeOffset"]


@dataclass(frozen=True)
class RangeOffset(ReadoutEffect):
    """Every range is off by the same length.

    R' = R + offset, along the beam, quantised as the sensor reports it: a constant error of calibration, added to
    every echo. With `moves = "light"`, all light arrives that much later, as with a delay of the trigger or of the
    cabling, 1 ns of delay being 0.15 m: what falls into one bin is then another light, and the errors of counting in
    bins move along. It then belongs to the stage `light`. Identity at offset 0.
    """

    name = "range_offset"
    stage = StageByWhat()

    offset_m: float = parameter(
        "m", low=-10.0, high=10.0, typical=0.05, noticeable=0.01, meaning="added to every range"
    )
    moves: str | None = what_moves()

    def light(self, light: Light, around: Surroundings) -> Light:
        """Move all light."""
        return light if self.offset_m == 0.0 else moved_light(light, 1.0, self.offset_m)

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move every echo along its beam."""
        return scan if self.offset_m == 0.0 else at_range(scan, scan.range_m + self.offset_m)
