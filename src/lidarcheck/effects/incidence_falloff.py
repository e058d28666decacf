"""Signal falls with incidence by another power than cos^1."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck import elementary
from lidarcheck.effects.base import LightEffect, Surroundings, list_parameter, parameter
from lidarcheck.effects.geometry.beam_rows import by_material
from lidarcheck.scan import Light

__all__ = ["STEP_DEG", "IncidenceFalloff"]

_LEAST_COSINE = 1e-3
STEP_DEG = 10.0
"""Between the knots of the table of factors."""


@dataclass(frozen=True)
class IncidenceFalloff(LightEffect):
    """Signal falls with incidence by another power than cos^1.

    S' = S cos^(exponent - 1)(iota) for the light of Lambertian surfaces, so that S goes with cos^exponent: 1 is
    Lambert's law, below 1 rough surfaces and foliage (Oren and Nayar, SIGGRAPH 1994), above 1 glossy ones, asphalt and
    car paint; the range equation with cos^m is common in laser radiometry (Jutzi and Gross, ISPRS Archives 38, 2009).
    Retro-reflectors, which have no cosine, stay as they are, and so does light that no surface returned. Light
    scattered into other beams falls with the incidence on the surface that it comes from.

    From `level_from_deg` on the factor stays what it is there, as where the facets of a rough surface that is met at
    grazing incidence face the sensor. What no power has, a gloss that is seen straight on, say, a table tells:
    `factors` on top, at 0, 10, ... 90 degrees, linearly between; the last one goes on.

    Valid for 0 <= exponent <= 10 at any incidence: at grazing incidence S stays finite. Identity at exponent 1 without
    factors.
    """

    name = "incidence_falloff"

    exponent: float = parameter("", low=0.0, high=10.0, typical=2.0, noticeable=0.25, meaning="power of the cosine")
    factors: tuple[float, ...] = list_parameter(
        "", low=0.0, high=10.0, noticeable=0.1, meaning="factors besides, at an incidence of 0, 10, ... 90 degrees"
    )
    level_from_deg: float = parameter(
        "deg",
        low=0.0,
        high=90.0,
        typical=90.0,
        noticeable=-10.0,
        meaning="incidence from which on the power changes no more",
        option=True,
    )

    def light(self, light: Light, around: Surroundings) -> Light:
        """Scale the pulses of Lambertian surfaces."""
        row = light.rows()
        if (self.exponent == 1.0 and not self.factors) or len(row) == 0 or len(around.ideal) == 0:
            return light
        ideal = around.ideal
        lambertian = by_material(ideal, around.materials, lambda material: float(material.kind == "lambertian"), 0.0)
        # A mirror shows a surface at another incidence than its row's: none may become brighter without bound.
        least = max(_LEAST_COSINE, float(elementary.cos(np.deg2rad(self.level_from_deg))))
        cosine = np.clip(elementary.cos(np.deg2rad(ideal.incidence_deg)), least, 1.0)
        factor = elementary.power(cosine, self.exponent - 1.0)
        if self.factors:
            factor = factor * np.interp(ideal.incidence_deg / STEP_DEG, np.arange(len(self.factors)), self.factors)
        factor = np.where(lambertian > 0.0, factor, 1.0)
        return replace(light, pulse_signal=light.pulse_signal * np.where(row >= 0, factor[row], 1.0))
