"""Light of a bright target scatters along the layers of its point column."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import Curve, LightEffect, Surroundings, file_parameter, parameter
from lidarcheck.effects.shared.blooming import Direction, Side, bloom, curve_profile, profile
from lidarcheck.scan import Light
from lidarcheck.sensor import Linear, Sensor

__all__ = ["BloomingVertical"]


@dataclass(frozen=True)
class BloomingVertical(LightEffect):
    """Light of a bright target scatters along the layers of its point column.

    Every pulse S of a beam's own surface with S >= `bright_signal` adds S strength y(x) to the other beams of its point
    column, at its own range; x is the offset from the bright beam in SPAD rows, three a layer, positive upward. Several
    bright beams add up: blooming is a linear operator on the light, and a look-up table its cut along one axis. y is
    the table `lut`, linear between its rows and 0 outside, or without one

        y(x) = core exp(-|x| / core_rows) + skirt exp(-|x / skirt_rows|^skirt_power) for |x| <= reach_rows,

    each side with heights of its own. The bright beam itself gains nothing. Scattered light does not scatter
    again. Pulses of fewer than 0.1 expected avalanches are left out, and sources within 0.15 m of range share one.

    Of detectors other than SPAD arrays x counts layers up the column of the image, and a pulse blooms whose expected
    amplitude is `bright_signal`; typical values are those of a SPAD array.

    Typical values follow the measured profile of a traffic sign at 157 m: a core within 20 rows, a skirt above the
    sign that ends near +160 rows, and a fainter one below; the line-shaped illumination stands along the column, so
    this is the stronger of the two bloomings. Identity at strength 0.
    """

    name = "blooming_vertical"
    role = "vertical blooming"
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
    core_up: float = parameter(
        "", low=0.0, high=1.0, typical=3e-4, noticeable=7.5e-5, meaning="height of the core above the target"
    )
    core_down: float = parameter(
        "", low=0.0, high=1.0, typical=2.2e-3, noticeable=5.5e-4, meaning="height of the core below the target"
    )
    core_rows: float = parameter(
        "SPAD rows", low=0.1, high=1000.0, typical=7.0, noticeable=1.4, meaning="decay length of the core"
    )
    skirt_up: float = parameter(
        "", low=0.0, high=1.0, typical=4.8e-4, noticeable=1.2e-4, meaning="height of the skirt above the target"
    )
    skirt_up_rows: float = parameter(
        "SPAD rows", low=0.1, high=2000.0, typical=95.0, noticeable=19.0, meaning="width of that skirt"
    )
    skirt_down: float = parameter(
        "", low=0.0, high=1.0, typical=1.0e-4, noticeable=2.5e-5, meaning="height of the skirt below the target"
    )
    skirt_down_rows: float = parameter(
        "SPAD rows", low=0.1, high=2000.0, typical=60.0, noticeable=12.0, meaning="width of that skirt"
    )
    skirt_power: float = parameter(
        "", low=0.1, high=20.0, typical=2.0, noticeable=0.25, meaning="2: bell, 1: exponential, high: box"
    )
    reach_rows: float = parameter(
        "SPAD rows", low=0.0, high=1560.0, typical=200.0, noticeable=40.0, meaning="no bloom beyond; not for a lut"
    )
    lut: Curve | None = file_parameter("lut.vertical", meaning="INI file with PostPro.LUT_blooming_X and _Y")  # noqa: RUF009

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """Beams that hear each other's light."""
        alone = isinstance(sensor, Linear) and not sensor.sweep.common_receiver
        return "each of its beams has a receiver of its own (common_receiver is false)" if alone else ""

    def light(self, light: Light, around: Surroundings) -> Light:
        """Add the pulses of the bloom."""
        if self.strength == 0.0:
            return light
        up = Side(self.core_up, self.skirt_up, self.skirt_up_rows)
        down = Side(self.core_down, self.skirt_down, self.skirt_down_rows)
        y = profile(up, down, self.core_rows, self.skirt_power, self.reach_rows)
        if self.lut is not None:
            y = curve_profile(self.lut)
        along = Direction.of(around.sensor, light.beams, vertical=True)
        return bloom(light, around, along, lambda x: self.strength * y(x), self.bright_signal)
