"""Empirical: echoes vanish with a probability that follows a function."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.effects.base import ReadoutEffect, Surroundings
from lidarcheck.effects.empirical.covariates import EchoColumns
from lidarcheck.effects.empirical.echoes import draws_of
from lidarcheck.effects.empirical.terms import Additive, covariate_parameter, knots_parameter, values_parameter
from lidarcheck.effects.shared.ranges import renumbered
from lidarcheck.scan import Scan

__all__ = ["EmpiricalLoss"]


@dataclass(frozen=True)
class EmpiricalLoss(Additive, ReadoutEffect):
    """Empirical: echoes vanish with a probability that follows a function of the echo, the beam or the surface.

    An echo vanishes with probability f(u) + g(v), cut to 0 ... 1, each by its own draw; f and g are linear between
    knots and constant outside. It describes and does not explain. The echoes that a beam keeps are numbered anew.
    Identity at values 0.
    """

    name = "empirical_loss"
    moves_echoes = False

    covariate: str | None = covariate_parameter("what f depends on", example="range_m")
    knots: tuple[float, ...] = knots_parameter("where f has its values", example=(20.0, 60.0))
    values: tuple[float, ...] = values_parameter("", 1.0, "f there, a probability", example=(0.0, 0.3))
    covariate_2: str | None = covariate_parameter("what g depends on")
    knots_2: tuple[float, ...] = knots_parameter("where g has its values")
    values_2: tuple[float, ...] = values_parameter("", 1.0, "g there, added to it")

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Leave out the echoes that vanish."""
        if self.is_zero() or len(scan) == 0:
            return scan
        kept = draws_of(scan, around)[:, 0] >= self.total(EchoColumns(scan, around), len(scan))
        return scan if bool(kept.all()) else renumbered(scan.take(kept))
