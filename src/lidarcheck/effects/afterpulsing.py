"""An avalanche sets off a later one in the same SPAD."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

from lidarcheck.effects.base import DetectorEffect, parameter, unfit_for
from lidarcheck.errors import UsageError
from lidarcheck.sensor import Sensor, SpadArray

__all__ = ["Afterpulsing"]


@dataclass(frozen=True)
class Afterpulsing(DetectorEffect):
    """An avalanche sets off a later one in the same SPAD.

    With that probability an avalanche is followed by another one, an exponential time behind the end of the dead time,
    unless the SPAD is dead again by then. Traps release carriers at several speeds (Haitz, J. Appl. Phys. 36 (1965)
    3123), so two means: `delay_ns`, and `slow_delay_ns` for `slow_share` of them; one exponential does not fit
    measurements (Ziarkash et al., Sci. Rep. 8 (2018) 5076). Bright echoes get a tail, or a fainter second echo behind
    the dead time; all background is raised by about the probability. Published: 0.014 to 0.03, delays of 0.1 to 90 ns.
    `delay_ns`, `slow_share` and `slow_delay_ns` mean nothing without the probability. Identity at probability 0.
    """

    name = "afterpulsing"
    inside = MappingProxyType({"probability": "added"})
    unfit = unfit_for(
        linear="its SPADs are not read one by one; what follows a bright echo is `recovery_ns` of the sensor file",
        photon_histogram="afterpulses of a histogram are not simulated",
    )

    probability: float = parameter(
        "",
        low=0.0,
        high=0.9,
        typical=0.03,
        noticeable=0.0075,
        meaning="probability that an avalanche sets off a later one",
    )
    delay_ns: float = parameter(
        "ns", low=0.0, high=1000.0, typical=5.0, noticeable=1.0, meaning="mean delay behind the end of the dead time"
    )
    slow_share: float = parameter(
        "",
        low=0.0,
        high=1.0,
        typical=0.3,
        noticeable=0.2,
        meaning="share of the afterpulses that come by the slow delay",
    )
    slow_delay_ns: float = parameter(
        "ns", low=0.0, high=1000.0, typical=30.0, noticeable=6.0, meaning="mean delay of the slow ones"
    )

    def detector(self, sensor: Sensor) -> Sensor:
        """Let avalanches have afterpulses."""
        sensor = SpadArray.narrow(sensor)
        if self.probability == 0.0:
            return sensor
        if sensor.nonideal.afterpulse > 0.0:
            raise UsageError(
                "afterpulsing stands in the model twice: probability is set already", fix="keep one of the two"
            )
        real = replace(
            sensor.nonideal,
            afterpulse=float(self.probability),
            afterpulse_ns=float(self.delay_ns),
            afterpulse_slow_share=float(self.slow_share),
            afterpulse_slow_ns=float(self.slow_delay_ns),
        )
        return replace(sensor, nonideal=real)
