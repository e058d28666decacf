"""Empirical: PEAK, AREA and WIDTH follow functions of the echo, the beam or the surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck import elementary
from lidarcheck.effects.base import ReadoutEffect, Surroundings, unfit_for
from lidarcheck.effects.empirical.covariates import EchoColumns
from lidarcheck.effects.empirical.echoes import draws_of, whole
from lidarcheck.effects.empirical.terms import (
    NOT_COUNTED,
    Additive,
    covariate_parameter,
    knots_parameter,
    uncounted,
    values_parameter,
)
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor, SpadArray

__all__ = ["EmpiricalAmplitude"]


@dataclass(frozen=True)
class EmpiricalAmplitude(Additive, ReadoutEffect):
    """Empirical: PEAK, AREA and WIDTH follow functions of the echo, the beam or the surface.

    PEAK' = PEAK exp(f(u) + g(v) + p(x)), AREA' = AREA exp(f(u) + g(v) + a(y)), WIDTH' = WIDTH + h(w); all are linear
    between knots and constant outside. It describes and does not explain. Counts stay whole: they are rounded up as
    often as their fraction says, so that the mean is right. A changed PEAK stays above the threshold and ends at the
    saturation, a changed AREA is at least PEAK, a changed WIDTH at least a bin. Exponents lie in -10 ... 10.
    Identity at values 0.
    """

    name = "empirical_amplitude"
    unfit = unfit_for(linear=NOT_COUNTED, photon_histogram=NOT_COUNTED)
    suffixes = ("", "_2", "_peak", "_area", "_width")

    covariate: str | None = covariate_parameter("what f depends on", example="area_log10")
    knots: tuple[float, ...] = knots_parameter("where f has its values", example=(2.0, 3.0))
    values: tuple[float, ...] = values_parameter("", 10.0, "f there, ln of a factor", example=(0.3, 0.0))
    covariate_2: str | None = covariate_parameter("what g depends on")
    knots_2: tuple[float, ...] = knots_parameter("where g has its values")
    values_2: tuple[float, ...] = values_parameter("", 10.0, "g there, ln of a factor")
    covariate_peak: str | None = covariate_parameter("what p depends on")
    knots_peak: tuple[float, ...] = knots_parameter("where p has its values")
    values_peak: tuple[float, ...] = values_parameter("", 10.0, "p there, ln of PEAK's own factor")
    covariate_area: str | None = covariate_parameter("what a depends on")
    knots_area: tuple[float, ...] = knots_parameter("where a has its values")
    values_area: tuple[float, ...] = values_parameter("", 10.0, "a there, ln of AREA's own factor")
    covariate_width: str | None = covariate_parameter("what h depends on")
    knots_width: tuple[float, ...] = knots_parameter("where h has its values")
    values_width: tuple[float, ...] = values_parameter("ns", 100.0, "h there")

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """What is counted, also around a program."""
        return uncounted(sensor)

    def readout(self, scan: Scan, around: Surroundings) -> Scan:
        """Change each echo's features."""
        if self.is_zero() or len(scan) == 0:
            return scan
        column, sensor = EchoColumns(scan, around), SpadArray.narrow(around.sensor.nominal)
        uniform = draws_of(scan, around, 3)
        both = self.total(column, len(scan))
        peak_ln, area_ln = (both + self.total(column, len(scan), (suffix,)) for suffix in ("_peak", "_area"))
        lowest = np.minimum(scan.peak, np.floor(sensor.threshold) + 1.0)
        peak = whole(scan.peak * elementary.exp(peak_ln), uniform[:, 0])
        peak = np.clip(peak, lowest, np.maximum(sensor.peak_saturation, lowest))
        peak = np.where(peak_ln == 0.0, scan.peak, peak)
        area = np.maximum(whole(scan.area * elementary.exp(area_ln), uniform[:, 1]), np.minimum(scan.area, peak))
        wider_ns = self.total(column, len(scan), ("_width",))
        width_ns = scan.width_ns + sensor.bin_ns * whole(wider_ns / sensor.bin_ns, uniform[:, 2])
        width_ns = np.maximum(width_ns, np.minimum(scan.width_ns, sensor.bin_ns))
        return replace(
            scan,
            peak=peak,
            area=np.where(area_ln == 0.0, scan.area, area),
            width_ns=np.where(wider_ns == 0.0, scan.width_ns, width_ns),
        )
