"""Empirical: the signal follows a function of the beam or of its surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidarcheck import elementary
from lidarcheck.effects.base import LightEffect, Surroundings
from lidarcheck.effects.empirical.covariates import PulseColumns
from lidarcheck.effects.empirical.terms import (
    Additive,
    beyond_parameter,
    covariate_parameter,
    knots_parameter,
    values_parameter,
)
from lidarcheck.scan import Light

__all__ = ["EmpiricalSignal"]


@dataclass(frozen=True)
class EmpiricalSignal(Additive, LightEffect):
    """Empirical: the signal follows a function of the beam or of its surface.

    S' = S exp(f(u) + g(v)) of every pulse, f and g linear between knots and constant outside, or f the same over and
    over with the distance of its last knot from its first as period (`beyond = "repeats"`). u and v are covariates: the
    pulse's own range, its beam, or what its surface is. It describes and does not explain. The background and what the
    air scatters back stay. A function counts 0 for pulses that do not know its covariate, as another sensor's light
    does not know a material. Exponents lie in -10 ... 10 each. Identity at values 0.
    """

    name = "empirical_signal"

    covariate: str | None = covariate_parameter("what f depends on", echo=False, example="range_m")
    knots: tuple[float, ...] = knots_parameter("where f has its values", example=(20.0, 60.0))
    values: tuple[float, ...] = values_parameter("", 10.0, "f there, ln of a factor", example=(0.0, -0.7))
    beyond: str | None = beyond_parameter()
    covariate_2: str | None = covariate_parameter("what g depends on", echo=False)
    knots_2: tuple[float, ...] = knots_parameter("where g has its values")
    values_2: tuple[float, ...] = values_parameter("", 10.0, "g there, ln of a factor")

    def light(self, light: Light, around: Surroundings) -> Light:
        """Scale every pulse by its own factor."""
        if self.is_zero():
            return light
        exponent = self.total(PulseColumns(light, around), len(light.pulse_signal))
        return replace(light, pulse_signal=light.pulse_signal * elementary.exp(exponent))
