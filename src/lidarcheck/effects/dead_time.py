"""The dead time is another, or varies from avalanche to avalanche."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType

from lidarcheck import elementary
from lidarcheck.effects.base import DetectorEffect, parameter, unfit_for
from lidarcheck.errors import UsageError
from lidarcheck.sensor import PhotonHistogram, Sensor, SpadArray

__all__ = ["DeadTime"]


@dataclass(frozen=True)
class DeadTime(DetectorEffect):
    """The dead time is another, or varies from avalanche to avalanche.

    The SPAD cannot avalanche before dead + shift has passed; shift is rounded to whole time bins, below half a bin it
    changes nothing. With a spread every avalanche draws its own dead time: a normal number of that standard deviation,
    rounded to whole bins, and at least the time the output is ON. With `recovery_ns` it is ready an exponential time of
    that mean later still, as where its bias comes back through a resistor. A SPAD that is ready again while a bright
    pulse lasts fires once more: AREA and WIDTH of bright echoes follow the dead time, those of weak ones do not.
    Quenching circuits, active and passive: Cova et al., Appl. Opt. 35 (1996) 1956; published dead times are 7 ns and
    more. A shift that makes the dead time shorter than the ON time is refused. Of several such effects shifts and
    recoveries add up, and the squares of spreads. A histogram of many shots shows the mean dead time alone, dead +
    shift + recovery. Identity at shift, spread and recovery 0.
    """

    name = "dead_time"
    inside = MappingProxyType({"shift_ns": "added", "spread_ns": "added", "recovery_ns": "added"})
    unfit = unfit_for(linear="its SPADs are not read one by one; what follows a bright echo is `recovery_ns`")

    shift_ns: float = parameter(
        "ns", low=-1000.0, high=1000.0, typical=-2.0, noticeable=1.0, meaning="added to the dead time"
    )
    spread_ns: float = parameter(
        "ns",
        low=0.0,
        high=100.0,
        typical=1.0,
        noticeable=0.5,
        meaning="standard deviation of the dead time between avalanches",
    )
    recovery_ns: float = parameter(
        "ns",
        low=0.0,
        high=100.0,
        typical=0.0,
        noticeable=1.0,
        meaning="mean of an exponential time until it is ready",
        option=True,
    )

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """A readout that counts more than one photon of a SPAD and shot."""
        first = isinstance(sensor, PhotonHistogram) and sensor.readout == "first"
        return 'its readout = "first" counts one photon a SPAD and shot' if first else ""

    def detector(self, sensor: Sensor) -> Sensor:
        """Change the dead time and let it vary."""
        if isinstance(sensor, PhotonHistogram):
            return self._of_histogram(sensor)
        sensor = SpadArray.narrow(sensor)
        shift = math.floor(self.shift_ns / sensor.bin_ns + 0.5)
        if shift == 0 and self.spread_ns == self.recovery_ns == 0.0:
            return sensor
        # Two spreads add up as independent ones do.
        spread_ns = elementary.hypot(sensor.nonideal.dead_spread_ns, self.spread_ns)
        recovery_ns = sensor.nonideal.dead_recovery_ns + self.recovery_ns
        dead, most = sensor.dead_bins + shift, int(SpadArray.bounds["dead_bins"].high)
        if not sensor.on_bins <= dead <= most:
            low, high = (bins * sensor.bin_ns for bins in (sensor.on_bins - sensor.dead_bins, most - sensor.dead_bins))
            raise UsageError(
                f"dead_time: shift_ns = {self.shift_ns} makes a dead time of {dead * sensor.bin_ns:g} ns, which must "
                f"lie between the ON time, {sensor.on_bins * sensor.bin_ns:g} ns, and {most * sensor.bin_ns:g} ns",
                fix=f"use a shift_ns from {low:g} to {high:g} ns",
            )
        real = replace(sensor.nonideal, dead_spread_ns=spread_ns, dead_recovery_ns=recovery_ns)
        return replace(sensor, dead_bins=dead, nonideal=real)

    def _of_histogram(self, sensor: PhotonHistogram) -> PhotonHistogram:
        """A histogram counts so many avalanches that the mean of the dead time alone shows."""
        shift = math.floor((self.shift_ns + self.recovery_ns) / sensor.bin_ns + 0.5)
        if shift == 0:
            return sensor
        dead, most = sensor.dead_bins + shift, int(PhotonHistogram.bounds["dead_bins"].high)
        if not 1 <= dead <= most:
            low, high = ((bins - sensor.dead_bins) * sensor.bin_ns for bins in (1, most))
            raise UsageError(
                f"dead_time: shift_ns = {self.shift_ns} makes a dead time of {dead * sensor.bin_ns:g} ns, which must "
                f"be a bin of {sensor.bin_ns:g} ns at least",
                fix=f"use a shift_ns from {low:g} to {high:g} ns",
            )
        return replace(sensor, dead_bins=dead)
