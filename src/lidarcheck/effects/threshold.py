"""The detection threshold is another."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidarcheck.effects.base import DetectorEffect, parameter
from lidarcheck.sensor import Sensor

__all__ = ["Threshold"]


@dataclass(frozen=True)
class Threshold(DetectorEffect):
    """The detection threshold is another.

    An echo is a run of bins with A_k > A_min + shift. A lower threshold lets weak echoes and false alarms through and
    widens every echo; a higher one loses them. Identity at shift 0; A_min + shift stays at 0 or above.
    """

    name = "threshold"

    shift: int = parameter(
        "detectors ON", low=-100, high=1000, typical=3, whole=True, meaning="added to the sensor's threshold"
    )

    def detector(self, sensor: Sensor) -> Sensor:
        """Shift the sensor's threshold."""
        return replace(sensor, threshold=max(sensor.threshold + self.shift, 0)) if self.shift else sensor
