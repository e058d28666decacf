"""Every range is off by the same fraction."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import ReadoutEffect, Surroundings, parameter
from lidarcheck.effects.shared.ranges import StageByWhat, at_range, moved_light, what_moves
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import PhotonHistogram, Program, Sensor

__all__ = ["RangeScale"]


@dataclass(frozen=True)
class RangeScale(ReadoutEffect):
    """Every range is off by the same fraction.

    R' = (1 + fraction) R, along the beam, quantised as the sensor reports it: time is turned into range with a wrong
    factor. With `moves = "light"`, the bins are shorter or longer than they should be: the clock of the time-to-digital
    converter runs fast or slow; quartz drifts by 1e-5, an uncalibrated ring oscillator by percents. What falls into one
    bin is then another light; the effect belongs to the stage `light`. Identity at 0.
    """

    name = "range_scale"
    moves_echoes = False
    stage = StageByWhat()

    fraction: float = parameter(
        "", low=-0.1, high=0.1, typical=0.001, noticeable=0.0005, meaning="relative error of every range"
    )
    moves: str | None = what_moves()

    def light(self, light: Light, around: Surroundings) -> Light:
        """Move all light."""
        return self.light_of(light)

    def light_of(self, light: Light) -> Light:
        """All light, moved."""
        return light if self.fraction == 0.0 else moved_light(light, 1.0 + self.fraction, 0.0)

    def before(self, light: Light, sensor: Sensor) -> tuple[Light, Sensor]:
        """Move the light that a program is handed, and the surfaces' of a histogram; the cover glass stays."""
        return (self.light_of(light), sensor) if isinstance(sensor, PhotonHistogram | Program) else (light, sensor)

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move every echo along its beam."""
        still = self.fraction == 0.0 or isinstance(around.sensor, PhotonHistogram | Program)
        return scan if still else at_range(scan, scan.range_m * (1.0 + self.fraction))
