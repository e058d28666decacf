"""Signal falls with incidence by another power than cos^1."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.beam_rows import by_material
from lidarcheck.scan import Light

__all__ = ["IncidenceFalloff"]

_LEAST_COSINE = 1e-3


@dataclass(frozen=True)
class IncidenceFalloff(LightEffect):
    """Signal falls with incidence by another power than cos^1.

    S' = S cos^(exponent - 1)(iota) for the light of Lambertian surfaces, so that S goes with cos^exponent: 1 is
    Lambert's law, below 1 rough surfaces and foliage (Oren and Nayar, SIGGRAPH 1994), above 1 glossy ones, asphalt and
    car paint; the range equation with cos^m is common in laser radiometry (Jutzi and Gross, ISPRS Archives 38, 2009).
    Retro-reflectors, which have no cosine, stay as they are, and so does light that no surface returned. Light
    scattered into other beams falls with the incidence on the surface that it comes from.

    Valid for 0 <= exponent <= 10 at any incidence: at grazing incidence S stays finite and is at most S at 0 degrees.
    Identity at exponent 1.
    """

    name = "incidence_falloff"

    exponent: float = parameter("", low=0.0, high=10.0, typical=2.0, meaning="power of the cosine")

    def light(self, light: Light, around: Surroundings) -> Light:
        """Scale the pulses of Lambertian surfaces."""
        row = light.rows()
        if self.exponent == 1.0 or len(row) == 0 or len(around.ideal) == 0:
            return light
        ideal = around.ideal
        lambertian = by_material(ideal, around.materials, lambda material: float(material.kind == "lambertian"), 0.0)
        # A mirror shows a surface at another incidence than its row's: none may become brighter without bound.
        cosine = np.clip(np.cos(np.deg2rad(ideal.incidence_deg)), _LEAST_COSINE, 1.0)
        factor = cosine ** (self.exponent - 1.0)
        factor = np.where(lambertian > 0.0, factor, 1.0)
        return replace(light, pulse_signal=light.pulse_signal * np.where(row >= 0, factor[row], 1.0))
