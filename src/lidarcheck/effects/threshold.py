"""The detection threshold is another."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType

from lidarcheck import elementary
from lidarcheck.effects.base import DetectorEffect, parameter
from lidarcheck.sensor import Linear, PhotonHistogram, Sensor, SpadArray

__all__ = ["Threshold"]

_MOST_RISE = 100.0
_FASTEST_HZ = Linear.bounds["false_rate_hz"].high


@dataclass(frozen=True)
class Threshold(DetectorEffect):
    """The detection threshold is another.

    An echo is a run of bins with A_k > A_min + shift. A lower threshold lets weak echoes and false alarms through and
    widens every echo; a higher one loses them. Between two whole numbers it is dithered: each beam of each frame draws
    one of the two, so that their mean is the threshold. Of a linear detector it is T, in the unit of its amplitudes,
    with false echoes by Rice's formula; its amplitudes alone tell it from a gain. Of a histogram chip it is
    `threshold_sigma`. Identity at shift 0; the threshold stays at 0 or above.
    """

    name = "threshold"
    inside = MappingProxyType({"shift": "added"})

    shift: float = parameter(
        "detectors ON", low=-100.0, high=1000.0, typical=3.0, noticeable=0.5, meaning="added to the sensor's threshold"
    )

    def detector(self, sensor: Sensor) -> Sensor:
        """Shift the sensor's threshold."""
        if self.shift == 0.0:
            return sensor
        if isinstance(sensor, Linear):
            return _raised(sensor, max(sensor.threshold + self.shift, 0.0))
        if isinstance(sensor, PhotonHistogram):
            return replace(sensor, threshold_sigma=max(sensor.threshold_sigma + self.shift, 0.0))
        sensor = SpadArray.narrow(sensor)
        wanted = max(sensor.threshold + sensor.nonideal.threshold_dither + self.shift, 0.0)
        threshold = math.floor(wanted)
        real = replace(sensor.nonideal, threshold_dither=wanted - threshold)
        return replace(sensor, threshold=threshold, nonideal=real)


def _raised(sensor: Linear, threshold: float) -> Linear:
    """A linear detector with another threshold, and as many more or fewer false echoes as Rice's formula says."""
    rate_hz = sensor.false_rate_hz
    if rate_hz is not None and sensor.noise > 0.0:
        rise = 0.5 * (sensor.threshold**2 - threshold**2) / sensor.noise**2
        rate_hz = min(rate_hz * float(elementary.exp(min(rise, _MOST_RISE))), _FASTEST_HZ)
    reference = 10.0 * sensor.threshold if sensor.walk_reference is None else sensor.walk_reference
    return replace(sensor, threshold=threshold, false_rate_hz=rate_hz, walk_reference=reference or None)
