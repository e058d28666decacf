"""Empirical: the range is off by a function of the echo, the beam or the surface."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import ReadoutEffect, Surroundings
from lidarcheck.effects.empirical.covariates import EchoColumns
from lidarcheck.effects.empirical.terms import (
    Additive,
    beyond_parameter,
    covariate_parameter,
    knots_parameter,
    values_parameter,
)
from lidarcheck.effects.shared.ranges import at_range
from lidarcheck.scan import Scan

__all__ = ["EmpiricalRange"]


@dataclass(frozen=True)
class EmpiricalRange(Additive, ReadoutEffect):
    """Empirical: the range is off by a function of the echo, the beam or the surface.

    R' = R + f(u) + g(v) of every echo, f and g linear between knots and constant outside, or f the same over and over
    with the distance of its last knot from its first as period (`beyond = "repeats"`). It describes and does not
    explain. A function counts 0 for echoes on beams that do not know its covariate, as one that meets nothing knows no
    material. No range falls below 0, and echoes of a beam that change places are numbered anew. Shifts lie in
    -100 ... 100 m each. Identity at values 0.
    """

    name = "empirical_range"

    covariate: str | None = covariate_parameter("what f depends on", example="range_m")
    knots: tuple[float, ...] = knots_parameter("where f has its values", example=(10.0, 60.0))
    values: tuple[float, ...] = values_parameter("m", 100.0, "f there", example=(0.0, 0.1))
    beyond: str | None = beyond_parameter()
    covariate_2: str | None = covariate_parameter("what g depends on")
    knots_2: tuple[float, ...] = knots_parameter("where g has its values")
    values_2: tuple[float, ...] = values_parameter("m", 100.0, "g there")

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move each echo along its beam."""
        if self.is_zero() or len(scan) == 0:
            return scan
        return at_range(scan, scan.range_m + self.total(EchoColumns(scan, around), len(scan)))
