"""Every range is off by the same length."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import ReadoutEffect, Surroundings, parameter
from lidarcheck.effects.shared.ranges import StageByWhat, at_range, moved_light, what_moves
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import PhotonHistogram, Program, Sensor

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
    moves_echoes = False
    stage = StageByWhat()

    offset_m: float = parameter(
        "m", low=-10.0, high=10.0, typical=0.05, noticeable=0.01, meaning="added to every range"
    )
    moves: str | None = what_moves()

    def light(self, light: Light, around: Surroundings) -> Light:
        """Move all light."""
        return self.light_of(light)

    def light_of(self, light: Light) -> Light:
        """All light, moved."""
        return light if self.offset_m == 0.0 else moved_light(light, 1.0, self.offset_m)

    def before(self, light: Light, sensor: Sensor) -> tuple[Light, Sensor]:
        """Move the light that a program is handed, and the surfaces' of a histogram; the cover glass stays."""
        return (self.light_of(light), sensor) if isinstance(sensor, PhotonHistogram | Program) else (light, sensor)

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move every echo along its beam."""
        still = self.offset_m == 0.0 or isinstance(around.sensor, PhotonHistogram | Program)
        return scan if still else at_range(scan, scan.range_m + self.offset_m)
