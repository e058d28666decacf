"""The laser pulse is longer, or has a tail, or a second one behind it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.scan import Light, PulseShape
from lidarcheck.sensor import Linear, Sensor

__all__ = ["BroadPulse"]


@dataclass(frozen=True)
class BroadPulse(LightEffect):
    """The laser pulse is longer, or has a tail, or a second one behind it.

    The Gaussian's FWHM is `stretch` times as long, and the share `tail_share` of the light trails off behind it as an
    exponential of time constant `tail_ns`, convolved with the Gaussian (an exponentially modified Gaussian, the usual
    response of a laser driver and a detector). The light of a pulse stays the same; the tail's centroid lies `tail_ns`
    later. With `tail_delay_ns` all of that share comes so much later still: as a second pulse where `tail_ns` is short,
    such as a laser that rings or light that runs twice through its optics makes. A second `pulse_shape` acts on the
    first: FWHMs multiply, and its tail, where it has one, replaces the tail.

    The typical values were fitted to a measured sensor on a retro-reflecting sign, whose weak echoes are 7 to 11 ns
    wide and its saturated ones up to 44 ns: a core shorter than the nominal pulse, and a tail so weak that only a
    retro-reflector shows it, and only if SPADs re-arm while it lasts. Identity at `stretch` 1 with `tail_share` 0.
    """

    name = "pulse_shape"
    inside = MappingProxyType({"stretch": "times", "tail_share": "added"})
    role = "pulse"
    hash_word = "BroadPulse"
    tree = (109,)

    stretch: float = parameter(
        "", low=0.05, high=20.0, typical=0.7, noticeable=0.035, meaning="factor on the pulse's FWHM"
    )
    tail_share: float = parameter(
        "", low=0.0, high=1.0, typical=1.2e-3, noticeable=0.0003, meaning="share of the light that trails behind"
    )
    tail_ns: float = parameter(
        "ns", low=0.01, high=200.0, typical=5.5, noticeable=1.1, meaning="time constant of the tail's decay"
    )
    tail_delay_ns: float = parameter(
        "ns", low=0.0, high=200.0, typical=0.0, noticeable=1.0, meaning="how much later the tail begins", option=True
    )

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """Something that depends on the pulse's length: a width, surfaces that merge, or the slope of its edge."""
        if not isinstance(sensor, Linear) or sensor.max_echoes > 1:
            return ""
        if any(feature.law == "width_above_threshold" for feature in sensor.features):
            return ""
        by_edge = sensor.range_law == "physical" and sensor.edge_factor > 0.0
        return "" if by_edge else "it reports no width, one echo a beam, and ranges that scatter by no edge"

    def light(self, light: Light, around: Surroundings) -> Light:
        """Give the light that shape."""
        if self.stretch == 1.0 and self.tail_share == 0.0:
            return light
        before = light.shape or PulseShape(around.sensor.pulse_fwhm_ns)
        shape = replace(before, fwhm_ns=before.fwhm_ns * self.stretch)
        if self.tail_share > 0.0:
            tail = {"tail_share": self.tail_share, "tail_ns": self.tail_ns, "tail_delay_ns": self.tail_delay_ns}
            shape = replace(shape, **tail)
        return replace(light, shape=shape)
