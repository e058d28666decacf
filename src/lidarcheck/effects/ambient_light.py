"""Sunlight: extra background that follows the reflectance of what the beam meets."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.geometry.beam_rows import BeamRows, by_material
from lidarcheck.effects.geometry.surfaces import normals_of
from lidarcheck.effects.shared.reflectance import reflectance_of
from lidarcheck.scan import Light

__all__ = ["AmbientLight"]

_DIGITS = 2
"""How bright a surface is counts in hundredths: detectors keep tables for each background that they meet."""


@dataclass(frozen=True)
class AmbientLight(LightEffect):
    """Sunlight: extra background that follows the reflectance of what the beam meets.

    b' = b + rate sum_i share_i rho_i over the beam's rows, rho the reflectance of the row or of its material, without
    retro-reflection, which returns nothing to the sensor but the sensor's own light; `sky` stands in for rho where a
    row meets nothing. A Lambertian surface that fills a pixel looks equally bright from any distance and angle, so the
    background is constant along the trace. 110 klux are 0.82 W / m^2 / nm at 905 nm (ASTM G173): a SPAD of 10 um behind
    F/1.2 and a filter of 20 nm, transmission 0.6, detection efficiency 0.2, sees 0.14 per ns from rho = 1, which blinds
    it. The rate goes with the light, the SPAD's area and the filter's width; the typical value, 1/280 of that, is what
    400 lux of daylight give, or 110 klux behind optics that keep out as much.

    Where `direct` is above 0, rho counts by 1 - direct + direct max(0, n . s), n the surface's normal towards the
    sensor, s the direction to the sun (Lambert's cosine law); the rate is then that of a surface that faces the sun.
    Normals are those of the planes through neighbouring beams' hits. Of a clear day's 110 klux, 10 come from the sky: a
    `direct` of 0.9; under clouds it is 0.

    Of a linear detector the light is noise alone: its amplitude's variance in the dark grows, in the square of the
    amplitude's unit, by what `rate_per_ns` says for a white surface; around somebody else's program the rate counts in
    the program's own background. Valid without shadows, and with no sun in the
    field of view. Identity at rate 0.
    """

    name = "ambient_light"
    tree = (86,)
    handed = ("Background",)

    rate_per_ns: float = parameter(
        "1/ns",
        low=0.0,
        high=1000.0,
        typical=0.0005,
        noticeable=0.000125,
        meaning="avalanches per armed SPAD and ns from a white surface",
    )
    sky: float = parameter(
        "", low=0.0, high=10.0, typical=0.1, noticeable=0.025, meaning="reflectance that open sky looks like"
    )
    direct: float = parameter(
        "",
        low=0.0,
        high=1.0,
        typical=0.0,
        noticeable=0.2,
        meaning="part of the light that comes from the sun",
        option=True,
    )
    sun_azimuth_deg: float = parameter(
        "deg",
        low=-360.0,
        high=360.0,
        typical=120.0,
        noticeable=15.0,
        meaning="where the sun is, from X to the left",
        option=True,
    )
    sun_elevation_deg: float = parameter(
        "deg", low=0.0, high=90.0, typical=45.0, noticeable=15.0, meaning="how high the sun stands", option=True
    )

    def light(self, light: Light, around: Surroundings) -> Light:
        """Add what each beam's surfaces send on from the sun."""
        if self.rate_per_ns == 0.0:
            return light
        rows = BeamRows.of(light, around.ideal)
        whiteness = by_material(around.ideal, around.materials, lambda material: material.reflectance, self.sky)
        own = reflectance_of(around.ideal)
        if own is not None:
            whiteness = np.where((around.ideal.distance_m > 0.0) & np.isfinite(own), np.round(own, _DIGITS), whiteness)
        if self.direct > 0.0:
            whiteness = whiteness * np.where(around.ideal.distance_m > 0.0, self._lit(around), 1.0)
        mixture = rows.total(rows.share * rows.of_each(whiteness))
        return replace(light, background_per_ns=light.background_per_ns + self.rate_per_ns * mixture)

    def _lit(self, around: Surroundings) -> npt.NDArray[np.float64]:
        """How bright each row of the ideal scan is beside one that faces the sun, shape (n,)."""
        azimuth, elevation = np.deg2rad([self.sun_azimuth_deg, self.sun_elevation_deg])
        level = elementary.cos(elevation)
        sun = np.array([level * elementary.cos(azimuth), level * elementary.sin(azimuth), elementary.sin(elevation)])
        cosine = np.maximum(elementary.product(normals_of(around.ideal, around), sun), 0.0)
        return np.asarray(np.round(1.0 - self.direct + self.direct * cosine, _DIGITS))
