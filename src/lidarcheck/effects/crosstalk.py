"""An avalanche sets off neighbouring SPADs in the same bin."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

from lidarcheck.effects.base import DetectorEffect, parameter, unfit_for
from lidarcheck.errors import UsageError
from lidarcheck.sensor import Sensor, SpadArray

__all__ = ["Crosstalk"]


@dataclass(frozen=True)
class Crosstalk(DetectorEffect):
    """An avalanche sets off neighbouring SPADs in the same bin.

    Each of the four side neighbours that is armed avalanches with probability sides / 4, each of the four corner
    neighbours with corners / 4, and so on from those that were set off; a shot's SPADs stand in 3 rows (in one,
    where their number is no multiple of 3), and what lies outside the point's array is not followed. Weak echoes
    grow by up to sides + corners, false alarms multiply, and the scatter of AREA exceeds the binomial one. Photons
    of hot carriers: Rech et al., Opt. Express 16 (2008) 8381; the cascade: Gallego et al., JINST 8 (2013) P05010.
    Published: 0.035 over the sides and 0.017 over the corners, 0.002 in large arrays. The bounds keep the mean
    offspring of an avalanche below 0.9 in an endless array. Identity at sides 0 and corners 0.
    """

    name = "crosstalk"
    inside = MappingProxyType({"sides": "added", "corners": "added"})
    tree = (84,)
    unfit = unfit_for(
        linear="it adds avalanches into one amplitude; its scatter is in `excess` of the sensor file",
        photon_histogram="among so many shots it only widens the counts' scatter; vendors call the cover glass so",
    )

    sides: float = parameter(
        "",
        low=0.0,
        high=0.6,
        typical=0.035,
        noticeable=0.009,
        meaning="mean avalanches set off among the four side neighbours",
    )
    corners: float = parameter(
        "",
        low=0.0,
        high=0.3,
        typical=0.017,
        noticeable=0.004,
        meaning="mean avalanches set off among the four corner neighbours",
    )

    def detector(self, sensor: Sensor) -> Sensor:
        """Let neighbours set each other off."""
        sensor = SpadArray.narrow(sensor)
        if self.sides == 0.0 and self.corners == 0.0:
            return sensor
        if max(sensor.nonideal.crosstalk_sides, sensor.nonideal.crosstalk_corners) > 0.0:
            raise UsageError("crosstalk stands in the model twice: sides is set already", fix="keep one of the two")
        real = replace(sensor.nonideal, crosstalk_sides=float(self.sides), crosstalk_corners=float(self.corners))
        return replace(sensor, nonideal=real)
