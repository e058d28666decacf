"""Empirical: the range scatters by a function of the echo, the beam or the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.effects.base import ReadoutEffect, Surroundings
from lidarcheck.effects.empirical.covariates import EchoColumns
from lidarcheck.effects.empirical.echoes import draws_of
from lidarcheck.effects.empirical.terms import Additive, covariate_parameter, knots_parameter, values_parameter
from lidarcheck.effects.shared.draws import normals
from lidarcheck.effects.shared.ranges import at_range
from lidarcheck.scan import Scan

__all__ = ["EmpiricalSpread"]


@dataclass(frozen=True)
class EmpiricalSpread(Additive, ReadoutEffect):
    """Empirical: the range scatters by a function of the echo, the beam or the surface.

    R' = R + max(f(u) + g(v), 0) z, z standard normal and drawn anew for each echo, f and g linear between knots and
    constant outside. It describes and does not explain. No range falls below 0, and echoes of a beam that change places
    are numbered anew. Standard deviations lie below 100 m each. Identity at values 0.
    """

    name = "empirical_spread"

    covariate: str | None = covariate_parameter("what f depends on", example="range_m")
    knots: tuple[float, ...] = knots_parameter("where f has its values", example=(10.0, 60.0))
    values: tuple[float, ...] = values_parameter("m", 100.0, "f there, a standard deviation", example=(0.02, 0.2))
    covariate_2: str | None = covariate_parameter("what g depends on")
    knots_2: tuple[float, ...] = knots_parameter("where g has its values")
    values_2: tuple[float, ...] = values_parameter("m", 100.0, "g there, added to it")

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Move each echo by its own draw."""
        if self.is_zero() or len(scan) == 0:
            return scan
        sigma_m = np.maximum(self.total(EchoColumns(scan, around), len(scan)), 0.0)
        return at_range(scan, scan.range_m + sigma_m * normals(draws_of(scan, around)[:, 0]))
