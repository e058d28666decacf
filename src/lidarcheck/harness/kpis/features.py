"""Kinds of KPI of any feature that a sensor reports, which the scenario names; of a histogram, of its bins together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.harness.kpis.base import KpiKind, Needs, distance_kind, standard_deviation
from lidarcheck.harness.kpis.selection import KpiInput
from lidarcheck.kpi.histogram import histogram_quantiles
from lidarcheck.kpi.percentiles import LEVELS, percentile
from lidarcheck.kpi.quantisation import quantisation_step
from lidarcheck.kpi.validation import mean

__all__ = ["FEATURE_KINDS"]


def _values(seen: KpiInput) -> FloatArray:
    """The feature of the echoes on the surface that have it; of a histogram places of its counts, in bins."""
    if _of_histogram(seen):
        return histogram_quantiles(_histograms(seen)[1].sum(axis=0))
    values = seen.echoes.feature(seen.selection.feature)[seen.on]
    return values[~np.isnan(values)]


def _of_histogram(seen: KpiInput) -> bool:
    sensor, name = seen.selection.sensor, seen.selection.feature
    return sensor is not None and any(f.name == name and f.law == "histogram" for f in sensor.features)


def _histograms(seen: KpiInput) -> tuple[IndexArray, FloatArray]:
    """The histogram of each selected beam in each frame that has one: beam (n,), and counts (n, bins)."""
    if seen.echoes.histograms is None:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 0))
    beam, _, counts = seen.echoes.histograms
    selected = seen.selection.beams[beam]
    return beam[selected], counts[selected]


def _mean(seen: KpiInput) -> float:
    return mean(_histograms(seen)[1].ravel() if _of_histogram(seen) else _values(seen))


def _spread(seen: KpiInput) -> float:
    """Standard deviation; of a histogram that of a beam's bin between frames over the root of its mean."""
    if not _of_histogram(seen):
        return standard_deviation(_values(seen))
    beam, counts = _histograms(seen)
    _, index, frames = np.unique(beam, return_inverse=True, return_counts=True)
    means = np.zeros((len(frames), counts.shape[1]))
    np.add.at(means, index, counts)
    means /= np.maximum(frames, 1)[:, None]
    counted = (means > 0.0) & (frames > 1)[:, None]
    freedom = float((counted * (frames - 1)[:, None]).sum())
    square = (counts - means[index]) ** 2 / np.where(counted, means, 1.0)[index]
    return float(np.sqrt(square[counted[index]].sum() / freedom)) if freedom > 0.0 else float("nan")


def _all(seen: KpiInput) -> FloatArray:
    values = seen.echoes.feature(seen.selection.feature)[seen.every]
    return values[~np.isnan(values)]


def _kind(meaning: str, value: Callable[[KpiInput], float], needs: Needs = "surface") -> KpiKind:
    return KpiKind(meaning, "", value=value, needs=needs, of_feature=True)


def _percentile(level: int) -> Callable[[KpiInput], float]:
    return lambda seen: percentile(_values(seen), level)


FEATURE_KINDS: Mapping[str, KpiKind] = {
    "feature_mean": _kind("mean of a feature on the surface; of a histogram, of a bin's counts", _mean),
    "feature_spread": _kind(
        "standard deviation of a feature on the surface; of a histogram, of a bin between frames over √mean", _spread
    ),
    **{
        f"feature_percentile_{level}": _kind(f"{level}th percentile of a feature on the surface", _percentile(level))
        for level in LEVELS
    },
    "feature_quantisation_step": _kind(
        "largest step of which 99 % of a feature of all echoes are multiples, 0 without one",
        lambda seen: quantisation_step(_all(seen)),
        "beams",
    ),
    "feature_distance": replace(distance_kind("feature's", "", _values), of_feature=True),
}
"""What a feature of any sensor is like on a surface."""
