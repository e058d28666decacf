"""The detection threshold is another."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from lidarcheck.effects.base import DetectorEffect, parameter
from lidarcheck.sensor import Sensor, SpadArray

__all__ = ["Threshold"]


@dataclass(frozen=True)
class Threshold(DetectorEffect):
    """The detection threshold is another.

    An echo is a run of bins with A_k > A_min + shift. A lower threshold lets weak echoes and false alarms through and
    widens every echo; a higher one loses them. Between two whole numbers it is dithered: each beam of each frame draws
    one of the two, so that their mean is the threshold. Identity at shift 0; A_min + shift stays at 0 or above.
    """

    name = "threshold"

    shift: float = parameter(
        "detectors ON", low=-100.0, high=1000.0, typical=3.0, noticeable=0.5, meaning="added to the sensor's threshold"
    )

    def detector(self, sensor: Sensor) -> Sensor:
        """Shift the sensor's threshold."""
        sensor = SpadArray.narrow(sensor)
        if self.shift == 0.0:
            return sensor
        wanted = max(sensor.threshold + sensor.nonideal.threshold_dither + self.shift, 0.0)
        threshold = math.floor(wanted)
        real = replace(sensor.nonideal, threshold_dither=wanted - threshold)
        return replace(sensor, threshold=threshold, nonideal=real)
