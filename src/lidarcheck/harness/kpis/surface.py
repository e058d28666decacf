"""Kinds of KPI of the echoes on a surface: what they are like, and how that depends on where they lie."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.harness.kpis.base import (
    KpiKind,
    distance_kind,
    proportion_kind,
    quantile,
    slope,
    spread_between,
    standard_deviation,
)
from lidarcheck.harness.kpis.selection import KpiInput
from lidarcheck.kpi.validation import mean

__all__ = ["DISTANCE_KINDS", "SURFACE_KINDS", "TREND_KINDS"]

_LEAST_COSINE = 1e-6
"""A surface seen along itself has no cosine to take the logarithm of."""

SURFACE_KINDS: Mapping[str, KpiKind] = {
    "detection_probability": proportion_kind(
        "beams with an echo on their surface / beams that meet one",
        lambda seen: seen.beams_with(seen.on),
        lambda seen: seen.beams_meeting,
    ),
    "area_mean": KpiKind("mean AREA on the surface", "counts", value=lambda seen: mean(seen.area)),
    "peak_mean": KpiKind("mean PEAK on the surface", "detectors", value=lambda seen: mean(seen.peak)),
    "width_mean": KpiKind("mean WIDTH on the surface", "ns", value=lambda seen: mean(seen.width_ns)),
    "range_residual_mean": KpiKind(
        "mean range minus true range: offset and walk", "m", value=lambda seen: mean(seen.residual_m)
    ),
    "range_residual_median": KpiKind(
        "median range minus true range", "m", value=lambda seen: quantile(seen.residual_m, 0.5)
    ),
    "range_noise": KpiKind(
        "standard deviation of range minus true range", "m", value=lambda seen: standard_deviation(seen.residual_m)
    ),
    "area_spread": KpiKind(
        "standard deviation of AREA on the surface", "counts", value=lambda seen: standard_deviation(seen.area)
    ),
}
"""What the echoes on a surface are like."""

TREND_KINDS: Mapping[str, KpiKind] = {
    "range_residual_per_decade": KpiKind(
        "slope of the range residual over log10 AREA, or of the sensor's own strength: walk",
        "m/decade",
        value=lambda seen: _walk(seen),
    ),
    "range_residual_per_metre": KpiKind(
        "slope of the range residual over true range: a wrong scale",
        "m/m",
        value=lambda seen: slope(seen.distance_m, seen.residual_m),
    ),
    "range_residual_per_point": KpiKind(
        "slope of the range residual over Point: motion while the frame is swept",
        "m/point",
        value=lambda seen: slope(seen.point(seen.on), seen.residual_m),
    ),
    "range_residual_per_layer": KpiKind(
        "slope of the range residual over Layer: a wrong pitch",
        "m/layer",
        value=lambda seen: slope(seen.layer(seen.on), seen.residual_m),
    ),
    "range_residual_point_spread": KpiKind(
        "standard deviation of the range residual between point columns, without the scatter within them: vibration",
        "m",
        value=lambda seen: _point_spread(seen, seen.residual_m),
    ),
    "range_residual_layer_spread": KpiKind(
        "standard deviation of the range residual between layers, without the scatter within them",
        "m",
        value=lambda seen: _layer_spread(seen, seen.residual_m),
    ),
    "area_point_spread": KpiKind(
        "standard deviation of AREA between point columns, without the scatter within them: dirt",
        "counts",
        value=lambda seen: _point_spread(seen, seen.area),
    ),
    "area_layer_spread": KpiKind(
        "standard deviation of AREA between layers, without the scatter within them: unequal layers",
        "counts",
        value=lambda seen: _layer_spread(seen, seen.area),
    ),
    "area_loss_per_metre": KpiKind(
        "fall of ln(AREA R²) over true range: twice the extinction, far from saturation",
        "1/m",
        value=lambda seen: _loss(seen),
    ),
    "area_incidence_exponent": KpiKind(
        "exponent m of AREA R² ∝ cosᵐ(incidence), far from saturation", "1", value=lambda seen: _falloff(seen)
    ),
}
"""How the echoes on a surface depend on where they lie."""

DISTANCE_KINDS: Mapping[str, KpiKind] = {
    "area_distance": distance_kind("AREA", "counts", lambda seen: seen.area),
    "peak_distance": distance_kind("PEAK", "detectors", lambda seen: seen.peak),
    "width_distance": distance_kind("WIDTH", "ns", lambda seen: seen.width_ns),
    "range_residual_distance": distance_kind("range residual", "m", lambda seen: seen.residual_m),
}
"""The distributions that a golden, or a measured file, may be compared by."""


def _point_spread(seen: KpiInput, values: FloatArray) -> float:
    return spread_between(values, _lines(seen, seen.point(seen.on)))


def _layer_spread(seen: KpiInput, values: FloatArray) -> float:
    return spread_between(values, _lines(seen, seen.layer(seen.on)))


def _lines(seen: KpiInput, line: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
    """A number for each line of each frame: what shakes is another from frame to frame."""
    return seen.echoes.frame[seen.on] * 2**32 + line


def _walk(seen: KpiInput) -> float:
    decades = seen.decades
    some = np.isfinite(decades)
    return slope(decades[some], seen.residual_m[some])


def _loss(seen: KpiInput) -> float:
    some = seen.area > 0.0
    return -slope(seen.distance_m[some], _log_signal(seen)[some])


def _falloff(seen: KpiInput) -> float:
    cosine = elementary.cos(np.deg2rad(seen.incidence_deg))
    some = (seen.area > 0.0) & (cosine > _LEAST_COSINE)
    return slope(elementary.log(cosine[some]), _log_signal(seen)[some])


def _log_signal(seen: KpiInput) -> FloatArray:
    """ln(AREA R²), which does not depend on range in a clear atmosphere; of no use where AREA is 0."""
    return np.asarray(elementary.log(np.maximum(seen.area, 1e-300)) + 2.0 * elementary.log(seen.distance_m))
