"""Extra background, the same for every beam."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidarcheck.effects.base import LightEffect, Surroundings, parameter, unfit_for
from lidarcheck.scan import Light

__all__ = ["DarkCounts"]


@dataclass(frozen=True)
class DarkCounts(LightEffect):
    """Extra background, the same for every beam.

    b' = b + rate. Thermal generation in the SPADs: published dark count rates lie between 0.1 and 200 kcps per SPAD,
    1e-7 ... 2e-4 per ns at room temperature, and double about every 10 K. Around somebody else's
    program the rate counts in the program's own background. Identity at rate 0.
    """

    name = "dark_counts"
    tree = (101,)
    handed = ("Background",)
    unfit = unfit_for(linear="its dark noise is one number with `noise` of the sensor file: fit that")

    rate_per_ns: float = parameter(
        "1/ns",
        low=0.0,
        high=1000.0,
        typical=0.0002,
        noticeable=5e-5,
        meaning="avalanches per armed SPAD and ns, added to the background",
    )

    def light(self, light: Light, around: Surroundings) -> Light:
        """Add the rate to every beam's background."""
        if self.rate_per_ns == 0.0:
            return light
        return replace(light, background_per_ns=light.background_per_ns + self.rate_per_ns)
