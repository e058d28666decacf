"""What the echoes of one panel say about the sensor: detection, noise, bias, walk; and the model beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.echoes import amplitude, features_of
from lidarcheck.calibration.panels.samples import PanelSamples
from lidarcheck.kpi.compare import feature_gap
from lidarcheck.kpi.comparison import FeatureGap
from lidarcheck.kpi.detection import wilson
from lidarcheck.kpi.features import decades_of
from lidarcheck.kpi.scatter import RangeScatter, central_half_width, range_scatter
from lidarcheck.kpi.walk import WalkOffset, walk_offset
from lidarcheck.sensor import Sensor

__all__ = [
    "NoiseSide",
    "PanelNoise",
    "WalkCurve",
    "compare_sides",
    "noise_of",
    "resolution_of",
    "scatter_of",
    "walk_curve",
]

RESIDUAL = "range residual"
GRIDS_M = (0.01, 0.005, 0.004, 0.003, 0.002, 0.001)
WALK_BINS = 8
FEWEST_IN_BIN = 20
NAN = float("nan")


@dataclass(frozen=True)
class WalkCurve:
    """Median range residual over the amplitude, in bins of equally many echoes; shapes (k,).

    `amplitude`: median of a bin; `low_m`, `high_m`: 95 % interval of the median, from order statistics.
    """

    amplitude: FloatArray
    residual_m: FloatArray
    low_m: FloatArray
    high_m: FloatArray
    echoes: IndexArray


@dataclass(frozen=True)
class NoiseSide:
    """One panel as the sensor, or as the model, shows it in `frames` frames.

    `detection`, `detection_low`, `detection_high`: echoing beams of those that must hit it, with Wilson's 95 %
    interval. `range_m`: mean. `bias_m`: median range minus the ideal one, NaN without an ideal scan. `noise_m`:
    standard deviation of a beam's range from frame to frame; `noise_robust_m`: half the central 68.3 %, the step of
    the range taken off; NaN with one frame. `plane_m`, `plane_robust_m`: the same of all residuals from the plane that
    fits the panel best, so noise and fixed pattern together. `means`, `spreads`: of each feature.
    """

    frames: int
    beams: int
    trials: int
    detected: int
    detection: float
    detection_low: float
    detection_high: float
    echoes: int
    range_m: float
    bias_m: float
    noise_m: float
    noise_robust_m: float
    plane_m: float
    plane_robust_m: float
    resolution_m: float
    means: Mapping[str, float]
    spreads: Mapping[str, float]
    walk: WalkCurve


@dataclass(frozen=True)
class PanelNoise:
    """Measured and simulated beside each other; what needs both is empty or None where nothing was simulated.

    `gaps`: feature to distances, the range residual among them. `walk`: measured minus simulated per decade
    of AREA, or of the sensor's own strength.
    """

    measured: NoiseSide
    simulated: NoiseSide | None
    gaps: Mapping[str, FeatureGap]
    walk: WalkOffset | None


def resolution_of(range_m: FloatArray) -> float:
    """The step that ranges [m] are multiples of, the widest of some usual ones; 0 where they are of none."""
    if range_m.size < 10:
        return 0.0
    some = range_m[:: max(range_m.size // 5000, 1)]
    for step in GRIDS_M:
        off = np.abs(some / step - np.rint(some / step)) * step
        if np.mean(off < 2e-4) > 0.99 and step > 8e-4:
            return step
    return 0.0


def noise_of(samples: PanelSamples, beams: int, *, known_truth: bool, sensor: Sensor | None = None) -> NoiseSide:
    """The figures of one side; `known_truth`: an ideal scan says where the panel stands; `sensor`: what measured."""
    residual, range_m = samples.residual_m, samples.scan.range_m
    low, high = (float(v) for v in wilson(samples.detected, samples.trials))
    resolution = resolution_of(np.round(range_m, 4))
    noise, robust = _from_frame_to_frame(samples, resolution)
    flat = _from_plane(samples, residual)
    features = features_of(samples.scan, sensor)
    some = len(range_m) > 0
    return NoiseSide(
        frames=len(samples.detected_in),
        beams=beams,
        trials=samples.trials,
        detected=samples.detected,
        detection=samples.detected / samples.trials if samples.trials else NAN,
        detection_low=low,
        detection_high=high,
        echoes=len(range_m),
        range_m=float(range_m.mean()) if some else NAN,
        bias_m=float(np.median(residual)) if some and known_truth else NAN,
        noise_m=noise,
        noise_robust_m=robust,
        plane_m=_deviation(flat),
        plane_robust_m=_robust(flat, resolution),
        resolution_m=resolution,
        means={name: float(values.mean()) if some else NAN for name, (_, values) in features.items()},
        spreads={name: _deviation(values) for name, (_, values) in features.items()},
        walk=walk_curve(amplitude(samples.scan, sensor)[1], residual),
    )


def compare_sides(
    measured: PanelSamples, simulated: PanelSamples, sensor: Sensor | None = None
) -> tuple[dict[str, FeatureGap], WalkOffset | None]:
    """Distances of every feature that both have, and the walk where both have an AREA, or the sensor's own strength."""
    m, s = features_of(measured.scan, sensor), features_of(simulated.scan, sensor)
    gaps = {RESIDUAL: feature_gap(measured.residual_m, simulated.residual_m, unit="m")}
    gaps |= {name: feature_gap(m[name][1], s[name][1], unit=m[name][0]) for name in m if name in s}
    decades = decades_of(sensor)
    if decades is None or decades.name not in m or decades.name not in s:
        return gaps, None
    strengths = m[decades.name][1], s[decades.name][1]
    return gaps, walk_offset(measured.residual_m, strengths[0], simulated.residual_m, strengths[1], decades)


def scatter_of(samples: Sequence[PanelSamples], sensor: Sensor | None = None) -> RangeScatter:
    """Range noise over the amplitude, from the successive echoes of each beam of all panels."""
    first, second, signal = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for one in samples:
        order = np.lexsort((one.frame, one.beam))
        pair = np.flatnonzero(np.diff(one.beam[order]) == 0)
        range_m, strength = np.round(one.scan.range_m[order], 4), amplitude(one.scan, sensor)[1][order]
        first.append(range_m[pair])
        second.append(range_m[pair + 1])
        signal.append(0.5 * (strength[pair] + strength[pair + 1]))
    resolution = max((resolution_of(r) for r in first if r.size), default=0.0)
    return range_scatter(*(np.concatenate(part) for part in (first, second, signal)), resolution_m=resolution)


def _deviation(values: FloatArray) -> float:
    return float(values.std(ddof=1)) if values.size > 1 else NAN


def _robust(values: FloatArray, resolution_m: float) -> float:
    """Half the central 68.3 % around the median; the variance of a rounding step is taken off."""
    if values.size < 2:
        return NAN
    half = central_half_width(np.abs(values - np.median(values)))
    return float(np.sqrt(max(half**2 - resolution_m**2 / 12.0, 0.0)))


def _from_frame_to_frame(samples: PanelSamples, resolution_m: float) -> tuple[float, float]:
    """Standard deviation of a beam's ranges, pooled over beams, and the robust one from a beam's successive echoes."""
    order = np.lexsort((samples.frame, samples.beam))
    beam, range_m = samples.beam[order], np.round(samples.scan.range_m[order], 4)
    if not beam.size:
        return NAN, NAN
    count = np.bincount(beam)
    mean = np.bincount(beam, weights=range_m) / np.maximum(count, 1)
    freedom = int(np.maximum(count - 1, 0).sum())
    if not freedom:
        return NAN, NAN
    noise = float(np.sqrt(np.sum((range_m - mean[beam]) ** 2) / freedom))
    step = np.abs(np.diff(range_m)[np.diff(beam) == 0])
    half = central_half_width(step, step=resolution_m)
    return noise, float(np.sqrt(max(half**2 - resolution_m**2 / 4.0, 0.0) / 2.0))


def _from_plane(samples: PanelSamples, residual_m: FloatArray) -> FloatArray:
    """Residuals without their mean and their slopes over the panel: an error of its pose is no noise. Shape (n,)."""
    if residual_m.size < 4:
        return residual_m
    rows = np.column_stack([np.ones(len(residual_m)), *_places(samples)]).astype(np.float64)
    rows[:, 1:] -= rows[:, 1:].mean(axis=0)
    middle = np.median(residual_m)
    kept = np.abs(residual_m - middle) <= 5.0 * max(central_half_width(np.abs(residual_m - middle)), 1e-4)
    slopes = np.linalg.lstsq(rows[kept], residual_m[kept])[0]
    return np.asarray(residual_m - rows @ slopes, dtype=np.float64)


def _places(samples: PanelSamples) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Where the beams of echoes stand beside each other, upward and sideways, shapes (n,)."""
    scan = samples.scan
    if scan.beams.grid or not scan.beams.has(scan.layer, scan.point).all():
        return scan.layer, scan.point
    elevation, azimuth = scan.beams.angles_deg(scan.layer, scan.point)
    return elevation, np.mod(azimuth - azimuth[0] + 180.0, 360.0)


def walk_curve(strength: FloatArray, residual_m: FloatArray, bins: int = WALK_BINS) -> WalkCurve:
    """Median residual per bin of amplitude; as many bins as hold 20 echoes each, `bins` at most; none without any."""
    usable = np.isfinite(strength) & (strength > 0.0)
    strength, residual_m = strength[usable], residual_m[usable]
    k = min(bins, strength.size // FEWEST_IN_BIN)
    if k == 0:
        nothing = np.zeros(0)
        return WalkCurve(nothing, nothing, nothing, nothing, np.zeros(0, dtype=np.int64))
    order = np.argsort(strength, kind="stable")
    # Equal amplitudes stay together: a bin ends where the amplitude changes.
    edges = np.unique(strength[order][[round(i * strength.size / k) for i in range(k)]])
    where = np.searchsorted(edges, strength, "right") - 1
    groups = [(strength[where == i], np.sort(residual_m[where == i])) for i in range(len(edges))]
    intervals = [_median_interval(r) for _, r in groups]
    return WalkCurve(
        np.array([np.median(a) for a, _ in groups]),
        np.array([np.median(r) for _, r in groups]),
        np.array([low for low, _ in intervals]),
        np.array([high for _, high in intervals]),
        np.array([len(r) for _, r in groups], dtype=np.int64),
    )


def _median_interval(ordered: FloatArray) -> tuple[float, float]:
    """95 % interval of the median from the order statistics of an ascending sample (normal approximation)."""
    n = len(ordered)
    reach = 0.98 * np.sqrt(n)
    low, high = int(np.floor((n - 1) / 2 - reach)), int(np.ceil((n - 1) / 2 + reach))
    return float(ordered[max(low, 0)]), float(ordered[min(high, n - 1)])
