"""From the value that a sensor reports of an echo back to the amplitude that its detector saw.

The laws of features are those of `sensor.laws`; here each is turned round. A value that is rounded to a step stands for
an interval of amplitudes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Scan
from lidarcheck.sensor import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS, Feature, Linear, PhotonHistogram, Sensor

__all__ = ["Amplitudes", "amplitude_feature", "amplitudes_of", "values_of"]

_PREFERRED = (
    "photons", "affine", "range_corrected", "area_counts", "histogram", "log", "table", "calibrated_reflectivity",
    "peak_counts", "width_above_threshold", "confidence",
)  # fmt: skip
"""Laws from which an amplitude follows, the one that says most of it first."""
_FAINTEST = 1e-300


@dataclass(frozen=True)
class Amplitudes:
    """What echoes' values say of their amplitudes, shape (n,) each; `low`, `high`: what would be rounded to the value.

    `capped`: the value is the largest that the sensor reports: the amplitude may be any above `low`.
    """

    value: FloatArray
    low: FloatArray
    high: FloatArray
    capped: BoolArray


def amplitude_feature(sensor: Sensor, scans: Sequence[Scan]) -> Feature | None:
    """The feature that tells amplitudes best among those that all scans have; None where none does."""
    there = set.intersection(*(set(scan.feature_names) for scan in scans))
    if all(scan.histograms is not None for scan in scans):
        there |= {feature.name for feature in sensor.features if feature.law == "histogram"}
    found = [feature for feature in sensor.features if feature.law in _PREFERRED and feature.name in there]
    return min(found, key=lambda feature: _PREFERRED.index(feature.law), default=None)


def values_of(feature: Feature, scan: Scan, sensor: Sensor) -> FloatArray:
    """The feature's value of each echo, shape (n,); of a histogram its counts under the echo."""
    if feature.law != "histogram":
        return np.asarray(scan.feature(feature.name), dtype=np.float64)
    assert scan.histograms is not None
    assert isinstance(sensor, PhotonHistogram)
    held = scan.histograms
    keys, asked = (beam_keys(one.layer, one.point) for one in (held, scan))
    order = np.argsort(keys, kind="stable")
    row = order[np.minimum(np.searchsorted(keys[order], asked), len(order) - 1)]
    counts = held.counts[row]
    late = counts[:, 3 * counts.shape[1] // 4 :]
    time_ns = 2.0 * scan.range_m / LIGHT_SPEED_M_PER_NS
    centre_ns = sensor.first_bin_ns + (np.arange(counts.shape[1]) + 0.5) * sensor.bin_ns
    under = np.abs(centre_ns - time_ns[:, None]) <= sensor.pulse_fwhm_ns
    return np.asarray(((counts - np.median(late, axis=1)[:, None]) * under).sum(axis=1))


def amplitudes_of(feature: Feature, values: FloatArray, path_m: FloatArray, sensor: Sensor) -> Amplitudes:
    """The amplitudes of echoes at these ways from the beams' origins, columns of shape (n,)."""
    turned = _INVERSE[feature.law]
    half = 0.5 * feature.step
    mid = turned(feature, values, path_m, sensor)
    low = turned(feature, values - half, path_m, sensor) if half > 0.0 else mid
    high = turned(feature, values + half, path_m, sensor) if half > 0.0 else mid
    most = np.inf if feature.most is None else feature.most
    capped = values >= most - 1e-9 * abs(most) if np.isfinite(most) else np.zeros(len(values), dtype=np.bool_)
    low, high = np.maximum(np.minimum(low, high), 0.0), np.maximum(low, high)
    if half > 0.0:
        mid = np.where(values <= half, 0.5 * (low + high), mid)  # what is rounded to 0 lies above it
    return Amplitudes(mid, low, high, np.asarray(capped))


def _number(feature: Feature, name: str, default: float) -> float:
    return float(feature.numbers.get(name, default))


def _same(feature: Feature, value: FloatArray, path_m: FloatArray, sensor: Sensor) -> FloatArray:
    return value


def _affine(feature: Feature, value: FloatArray, path_m: FloatArray, sensor: Sensor) -> FloatArray:
    return (value - _number(feature, "offset", 0.0)) / _number(feature, "gain", 1.0)


def _range_corrected(feature: Feature, value: FloatArray, path_m: FloatArray, sensor: Sensor) -> FloatArray:
    return value / (_number(feature, "gain", 1.0) * np.maximum(path_m, 1e-3) ** 2)


def _log(feature: Feature, value: FloatArray, path_m: FloatArray, sensor: Sensor) -> FloatArray:
    decades = (value - _number(feature, "offset", 0.0)) / _number(feature, "gain", 1.0)
    return np.asarray(10.0 ** np.clip(decades, -300.0, 300.0))


def _table(feature: Feature, value: FloatArray, path_m: FloatArray, sensor: Sensor) -> FloatArray:
    assert feature.table is not None
    at, values = (np.asarray(column, dtype=np.float64) for column in feature.table)
    order = np.argsort(values, kind="stable")
    return np.asarray(np.exp(np.interp(value, values[order], np.log(np.maximum(at[order], _FAINTEST)))))


def _calibrated(feature: Feature, value: FloatArray, path_m: FloatArray, sensor: Sensor) -> FloatArray:
    """By the nominal range equation, as the sensor calibrates."""
    knee, above = _number(feature, "knee", 100.0), str(feature.numbers.get("above", "log"))
    percent = value * (100.0 / knee)
    if above == "log":
        top = 255.0 if feature.high is None else feature.high
        decades = np.log(_number(feature, "top_percent", 10_000.0) / 100.0)
        bright = 100.0 * np.exp(np.maximum(value - knee, 0.0) / (top - knee) * decades)
        percent = np.where(value > knee, bright, percent)
    return np.asarray(percent * (0.01 * sensor.signal_at_1m) / (path_m**2 + sensor.near_m**2))


def _width(feature: Feature, value: FloatArray, path_m: FloatArray, sensor: Sensor) -> FloatArray:
    """How strong a Gaussian pulse is that lies above the threshold for so long."""
    assert isinstance(sensor, Linear)
    per_ns = {"m": 0.5 * LIGHT_SPEED_M_PER_NS, "cm": 50.0 * LIGHT_SPEED_M_PER_NS}.get(feature.unit, 1.0)
    sigmas = np.maximum(value, 0.0) / per_ns / (sensor.pulse_fwhm_ns / FWHM_PER_SIGMA)
    return np.asarray(sensor.threshold * np.exp(np.minimum(sigmas**2 / 8.0, 300.0)))


def _confidence(feature: Feature, value: FloatArray, path_m: FloatArray, sensor: Sensor) -> FloatArray:
    most = feature.most or 1.0
    noise = sensor.noise if isinstance(sensor, Linear) else 1.0
    return np.asarray(np.maximum(value, 0.0) / most * _number(feature, "snr_full", 20.0) * noise)


_INVERSE: Mapping[str, Callable[[Feature, FloatArray, FloatArray, Sensor], FloatArray]] = {
    "photons": _same,
    "affine": _affine,
    "range_corrected": _range_corrected,
    "area_counts": _same,
    "histogram": _same,
    "peak_counts": _same,
    "log": _log,
    "table": _table,
    "calibrated_reflectivity": _calibrated,
    "width_above_threshold": _width,
    "confidence": _confidence,
}
