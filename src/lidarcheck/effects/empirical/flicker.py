"""Empirical: the signal scatters from beam to beam by a function of the beam or of its surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck import elementary
from lidarcheck.effects.base import LightEffect, Surroundings
from lidarcheck.effects.empirical.covariates import PulseColumns
from lidarcheck.effects.empirical.terms import Additive, covariate_parameter, knots_parameter, values_parameter
from lidarcheck.effects.shared.draws import normals
from lidarcheck.scan import Light

__all__ = ["EmpiricalFlicker"]


@dataclass(frozen=True)
class EmpiricalFlicker(Additive, LightEffect):
    """Empirical: the signal scatters from beam to beam by a function of the beam or of its surface.

    S' = S exp(max(f(u) + g(v), 0) z) of every pulse, z standard normal and drawn anew for each beam, the same for all
    of its pulses; f and g are linear between knots and constant outside. It describes and does not explain. The
    background and what the air scatters back stay. Standard deviations lie below 10 each. Identity at values 0.
    """

    name = "empirical_flicker"

    covariate: str | None = covariate_parameter("what f depends on", echo=False, example="range_m")
    knots: tuple[float, ...] = knots_parameter("where f has its values", example=(20.0, 60.0))
    values: tuple[float, ...] = values_parameter("", 10.0, "f there, a standard deviation of ln S", example=(0.1, 0.4))
    covariate_2: str | None = covariate_parameter("what g depends on", echo=False)
    knots_2: tuple[float, ...] = knots_parameter("where g has its values")
    values_2: tuple[float, ...] = values_parameter("", 10.0, "g there, added to it")

    def light(self, light: Light, around: Surroundings) -> Light:
        """Scale every beam's pulses by its own draw."""
        if self.is_zero():
            return light
        drawn = normals(around.uniforms(light.layer, light.point)[:, 0])
        sigma = np.maximum(self.total(PulseColumns(light, around), len(light.pulse_signal)), 0.0)
        return replace(
            light,
            pulse_signal=light.pulse_signal * elementary.exp(sigma * np.repeat(drawn, np.diff(light.first_pulse))),
        )
