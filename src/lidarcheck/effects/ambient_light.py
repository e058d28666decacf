"""Sunlight: extra background that follows the reflectance of what the beam meets."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.beam_rows import BeamRows, by_material
from lidarcheck.scan import Light

__all__ = ["AmbientLight"]


@dataclass(frozen=True)
class AmbientLight(LightEffect):
    """Sunlight: extra background that follows the reflectance of what the beam meets.

    b' = b + rate sum_i share_i rho_i over the beam's rows, rho the reflectance of the row's material, without
    retro-reflection, which returns nothing to the sensor but the sensor's own light; `sky` stands in for rho where a
    row meets nothing. A Lambertian surface that fills a pixel looks equally bright from any distance and angle, so the
    background is constant along the trace. 110 klux are 0.82 W / m^2 / nm at 905 nm (ASTM G173): a SPAD of 10 um behind
    F/1.2 and a filter of 20 nm, transmission 0.6, detection efficiency 0.2, sees 0.14 per ns from rho = 1, which blinds
    it. The rate goes with the light, the SPAD's area and the filter's width; the typical value, 1/280 of that, is what
    400 lux of daylight give, or 110 klux behind optics that keep out as much.

    Valid for evenly lit scenes: no shadows, no sun in the field of view. Identity at rate 0.
    """

    name = "ambient_light"
    tree = (86,)

    rate_per_ns: float = parameter(
        "1/ns", low=0.0, high=10.0, typical=0.0005, meaning="avalanches per armed SPAD and ns from a white surface"
    )
    sky: float = parameter("", low=0.0, high=10.0, typical=0.1, meaning="reflectance that open sky looks like")

    def light(self, light: Light, around: Surroundings) -> Light:
        """Add what each beam's surfaces send on from the sun."""
        if self.rate_per_ns == 0.0:
            return light
        rows = BeamRows.of(light, around.ideal)
        whiteness = by_material(around.ideal, around.materials, lambda material: material.reflectance, self.sky)
        mixture = rows.total(rows.share * whiteness[rows.row])
        return replace(light, background_per_ns=light.background_per_ns + self.rate_per_ns * mixture)
