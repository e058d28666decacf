"""Light of a bright target scatters along the points of its layer."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import Curve, LightEffect, Surroundings, file_parameter, parameter
from lidarcheck.effects.shared.blooming import Direction, Side, bloom, curve_profile, profile
from lidarcheck.scan import Light

__all__ = ["BloomingHorizontal"]


@dataclass(frozen=True)
class BloomingHorizontal(LightEffect):
    """Light of a bright target scatters along the points of its layer.

    Every pulse S of a beam's own surface with S >= `bright_signal` adds S strength y(x) to the other beams of its
    layer, at its own range; x is the offset from the bright beam in columns of 0.05 deg, 2.5 a point, positive to the
    left, which is towards higher points. Several bright beams add up: blooming is a linear operator on the light, and a
    look-up table its cut along one axis. y is the table `lut`, linear between its rows and 0 outside (one without
    negative X, as real files have it, holds for both sides), or without one

        y(x) = core exp(-|x| / core_columns) + skirt exp(-|x / skirt_columns|^skirt_power) for |x| <= reach_columns,

    each side with heights of its own. The bright beam itself gains nothing. Scattered light does not
    scatter again. Pulses of fewer than 0.1 expected avalanches are left out, and sources within 0.15 m of range share
    one.

    Of detectors other than SPAD arrays x counts points of the layer, and a pulse blooms whose expected
    amplitude is `bright_signal`; typical values are those of a SPAD array.

    Typical values follow the measured profile of a traffic sign at 25 m: halos of a few tens of avalanches over about
    half a metre to either side. Identity at strength 0.
    """

    name = "blooming_horizontal"
    role = "horizontal blooming"
    tree = (72,)

    strength: float = parameter(
        "", low=0.0, high=100.0, typical=1.0, noticeable=0.25, meaning="factor on the whole profile or table"
    )
    bright_signal: float = parameter(
        "avalanches per SPAD and shot",
        low=0.0,
        high=1e9,
        typical=30.0,
        noticeable=3.0,
        meaning="S from which on a pulse blooms",
    )
    core_left: float = parameter(
        "", low=0.0, high=1.0, typical=1e-4, noticeable=2.5e-5, meaning="height of the core to the left"
    )
    core_right: float = parameter(
        "", low=0.0, high=1.0, typical=1e-4, noticeable=2.5e-5, meaning="height of the core to the right"
    )
    core_columns: float = parameter(
        "columns", low=0.1, high=1000.0, typical=2.5, noticeable=0.5, meaning="decay length of the core"
    )
    skirt_left: float = parameter(
        "", low=0.0, high=1.0, typical=1.5e-6, noticeable=4e-7, meaning="height of the skirt to the left"
    )
    skirt_left_columns: float = parameter(
        "columns", low=0.1, high=3000.0, typical=30.0, noticeable=6.0, meaning="width of that skirt"
    )
    skirt_right: float = parameter(
        "", low=0.0, high=1.0, typical=1.5e-6, noticeable=4e-7, meaning="height of the skirt to the right"
    )
    skirt_right_columns: float = parameter(
        "columns", low=0.1, high=3000.0, typical=30.0, noticeable=6.0, meaning="width of that skirt"
    )
    skirt_power: float = parameter(
        "", low=0.1, high=20.0, typical=2.0, noticeable=0.25, meaning="2: bell, 1: exponential, high: box"
    )
    reach_columns: float = parameter(
        "columns", low=0.0, high=2400.0, typical=100.0, noticeable=20.0, meaning="no bloom beyond; not for a lut"
    )
    lut: Curve | None = file_parameter("lut.horizontal", meaning="INI file with PostPro.LUT_bloomingH_X and _Y")  # noqa: RUF009

    def light(self, light: Light, around: Surroundings) -> Light:
        """Add the pulses of the bloom."""
        if self.strength == 0.0:
            return light
        left = Side(self.core_left, self.skirt_left, self.skirt_left_columns)
        right = Side(self.core_right, self.skirt_right, self.skirt_right_columns)
        y = profile(left, right, self.core_columns, self.skirt_power, self.reach_columns)
        if self.lut is not None:
            y = curve_profile(self.lut, mirrored=True)
        along = Direction.of(around.sensor, light.beams, vertical=False)
        return bloom(light, around, along, lambda x: self.strength * y(x), self.bright_signal)
