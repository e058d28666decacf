"""Empirical: PEAK, AREA and WIDTH follow functions of the echo, the beam or the surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.effects.base import ReadoutEffect, Surroundings
from lidarcheck.effects.empirical_covariates import EchoColumns
from lidarcheck.effects.empirical_echoes import draws_of, whole
from lidarcheck.effects.empirical_terms import Additive, covariate_parameter, knots_parameter, values_parameter
from lidarcheck.scan import Scan

__all__ = ["EmpiricalAmplitude"]


@dataclass(frozen=True)
class EmpiricalAmplitude(Additive, ReadoutEffect):
    """Empirical: PEAK, AREA and WIDTH follow functions of the echo, the beam or the surface.

    PEAK' = PEAK exp(f(u) + g(v)), AREA' = AREA exp(f(u) + g(v)), WIDTH' = WIDTH + h(w); f, g and h are linear between
    knots and constant outside. It describes and does not explain. Counts stay whole: they are rounded up as often as
    their fraction says, so that the mean is right. PEAK stays above the threshold and ends at the saturation, AREA is
    at least PEAK, WIDTH at least a bin. Exponents lie in -10 ... 10. Identity at values 0.
    """

    name = "empirical_amplitude"
    suffixes = ("", "_2", "_width")

    covariate: str | None = covariate_parameter("what f depends on", example="area_log10")
    knots: tuple[float, ...] = knots_parameter("where f has its values", example=(2.0, 3.0))
    values: tuple[float, ...] = values_parameter("", 10.0, "f there, ln of a factor", example=(0.3, 0.0))
    covariate_2: str | None = covariate_parameter("what g depends on")
    knots_2: tuple[float, ...] = knots_parameter("where g has its values")
    values_2: tuple[float, ...] = values_parameter("", 10.0, "g there, ln of a factor")
    covariate_width: str | None = covariate_parameter("what h depends on")
    knots_width: tuple[float, ...] = knots_parameter("where h has its values")
    values_width: tuple[float, ...] = values_parameter("ns", 100.0, "h there")

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Change each echo's features."""
        if self.is_zero() or len(scan) == 0:
            return scan
        column, sensor = EchoColumns(scan, around), around.sensor
        uniform = draws_of(scan, around, 3)
        exponent = self.total(column, len(scan))
        factor = np.exp(exponent)
        lowest = np.minimum(scan.peak, np.floor(sensor.threshold) + 1.0)
        peak = np.clip(whole(scan.peak * factor, uniform[:, 0]), lowest, np.maximum(sensor.peak_saturation, lowest))
        area = np.maximum(whole(scan.area * factor, uniform[:, 1]), np.minimum(scan.area, peak))
        wider_ns = self.total(column, len(scan), ("_width",))
        width_ns = scan.width_ns + sensor.bin_ns * whole(wider_ns / sensor.bin_ns, uniform[:, 2])
        width_ns = np.maximum(width_ns, np.minimum(scan.width_ns, sensor.bin_ns))
        same = exponent == 0.0
        return replace(
            scan,
            peak=np.where(same, scan.peak, peak),
            area=np.where(same, scan.area, area),
            width_ns=np.where(wider_ns == 0.0, scan.width_ns, width_ns),
        )
