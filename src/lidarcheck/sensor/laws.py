"""The laws by which a sensor's features follow from an echo: pure functions of arrays, a function a law.

Source: the contract on sensors, 1.2; docs/detectors.md states each law with its units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError
from lidarcheck.sensor.bounds import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS
from lidarcheck.sensor.feature import Feature
from lidarcheck.sensor.linear import Linear
from lidarcheck.sensor.sensor import Sensor

__all__ = ["EchoNumbers", "coded", "value"]

_HALF_LIGHT_SPEED = 0.5 * LIGHT_SPEED_M_PER_NS
_FAINTEST = 1e-300
"""What stands for amplitudes of 0 or less where a logarithm is taken."""


@dataclass(frozen=True)
class EchoNumbers:
    """What the laws ask of echoes; columns of shape (n,).

    `amplitude`: what this shot gave, a of a linear detector or N_s of a histogram, before any calibration.
    `range_m`: the reported range less the channel's `range_offset`. `background`: the background counts of the echo's
    beam; `floor_counts`: those below the echo itself, B_w of a histogram. `longer_ns`: by how much saturation has
    lengthened the pulse. `fwhm_ns`: of the pulse, where it is not the sensor's own. None: not known, or not so.
    """

    amplitude: FloatArray
    range_m: FloatArray
    background: FloatArray | None = None
    floor_counts: FloatArray | None = None
    longer_ns: FloatArray | None = None
    fwhm_ns: float | None = None


def value(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    """The feature's values as the sensor reports them: by its law, rounded and cut. Shape (n,).

    `sensor`: its nominal numbers. Raises `UsageError` for a law that the sensor's detector has no numbers for.
    """
    law = _LAWS.get(feature.law)
    if law is None:
        what = f"feature {feature.name}: law {feature.law!r} is no number of an echo of a {sensor.detector} detector"
        raise UsageError(what, fix=f"use one of {', '.join(_LAWS)}")
    return coded(feature, law(feature, echoes, sensor))


def coded(feature: Feature, plain: FloatArray) -> FloatArray:
    """Values as they are reported: to the nearest step, halves to the even one, then within the limits. Shape (n,)."""
    reported = np.rint(plain / feature.step) * feature.step if feature.step > 0.0 else plain
    low = feature.low if feature.bits is None else max(0.0, feature.low or 0.0)
    return reported if low is None and feature.most is None else np.clip(reported, low, feature.most)


def _number(feature: Feature, name: str, default: float) -> float:
    return float(feature.numbers.get(name, default))


def _needed(feature: Feature, column: FloatArray | None, what: str) -> FloatArray:
    if column is None:
        raise UsageError(f"feature {feature.name}: this detector has no {what}", fix="use another law")
    return column


def _log(amplitude: FloatArray) -> FloatArray:
    return np.asarray(elementary.log(np.maximum(amplitude, _FAINTEST)))


def _photons(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    return echoes.amplitude


def _affine(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    return _number(feature, "gain", 1.0) * echoes.amplitude + _number(feature, "offset", 0.0)


def _logarithmic(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    decades = elementary.log10(np.maximum(echoes.amplitude, _FAINTEST))
    return np.asarray(_number(feature, "offset", 0.0) + _number(feature, "gain", 1.0) * decades)


def _range_corrected(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    return _number(feature, "gain", 1.0) * echoes.amplitude * echoes.range_m**2


def _calibrated_reflectivity(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    """Percent by the nominal range equation up to 100 %, which reads `knee`; brighter ones by `above`."""
    knee = _number(feature, "knee", 100.0)
    percent = echoes.amplitude * (echoes.range_m**2 + sensor.near_m * sensor.near_m) * (100.0 / sensor.signal_at_1m)
    read = percent * (knee / 100.0)
    top = 255.0 if feature.high is None else feature.high
    above = str(feature.numbers.get("above", "log"))
    if above == "clip":
        return np.asarray(np.minimum(read, min(knee, top)))
    bright = np.flatnonzero(percent > 100.0)
    if above == "log" and len(bright):
        decades = elementary.log(_number(feature, "top_percent", 10_000.0) / 100.0)
        read[bright] = knee + (top - knee) * elementary.log(percent[bright] / 100.0) / decades
    return np.asarray(np.minimum(read, top))


def _background(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    return _number(feature, "gain", 1.0) * _needed(feature, echoes.background, "background counts")


_PER_NS: Mapping[str, float] = {"m": _HALF_LIGHT_SPEED, "cm": 100.0 * _HALF_LIGHT_SPEED}


def _width_above_threshold(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    """How long a Gaussian pulse of that amplitude lies above the threshold, in ns, m or cm."""
    if not isinstance(sensor, Linear) or sensor.threshold <= 0.0:
        what = f"feature {feature.name}: law 'width_above_threshold' needs a linear detector with a threshold above 0"
        raise UsageError(what, fix="use another law, or a threshold above 0")
    sigma_ns = (sensor.pulse_fwhm_ns if echoes.fwhm_ns is None else echoes.fwhm_ns) / FWHM_PER_SIGMA
    decibels = np.maximum(elementary.log(np.maximum(echoes.amplitude / sensor.threshold, 1.0)), 0.0)
    width_ns = 2.0 * sigma_ns * np.sqrt(2.0 * decibels)
    if echoes.longer_ns is not None:
        width_ns = width_ns + echoes.longer_ns
    return np.asarray(width_ns * _PER_NS.get(feature.unit, 1.0))


def _attenuation(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    return np.asarray(elementary.exp(-_number(feature, "per_m", 0.0) * echoes.range_m))


def _confidence(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    """The share of `snr_full` that the echo's signal over its noise reaches."""
    most = feature.high if feature.high is not None else feature.most
    if most is None:
        raise UsageError(f"feature {feature.name}: law 'confidence' has no maximum", fix="give it `bits` or `max`")
    amplitude = np.maximum(echoes.amplitude, 0.0)
    if echoes.floor_counts is not None:
        noise = np.sqrt(amplitude + echoes.floor_counts)
    else:
        noise = np.full(len(amplitude), sensor.noise if isinstance(sensor, Linear) else 0.0)
    full = np.minimum(amplitude, _number(feature, "snr_full", 20.0) * noise)
    with np.errstate(invalid="ignore"):
        share = np.where(noise > 0.0, full / (_number(feature, "snr_full", 20.0) * noise), 1.0)
    return np.asarray(most * share)


def _table(feature: Feature, echoes: EchoNumbers, sensor: Sensor) -> FloatArray:
    """Read off the file's amplitudes and values, linear in the logarithm of the amplitude; constant beyond its ends."""
    if feature.table is None:
        raise UsageError(f"feature {feature.name}: law 'table' has no table", fix="give it `file`")
    at, values = (np.asarray(column, dtype=np.float64) for column in feature.table)
    return np.asarray(np.interp(_log(echoes.amplitude), _log(at), values))


_LAWS: Mapping[str, Callable[[Feature, EchoNumbers, Sensor], FloatArray]] = {
    "photons": _photons,
    "affine": _affine,
    "log": _logarithmic,
    "range_corrected": _range_corrected,
    "calibrated_reflectivity": _calibrated_reflectivity,
    "background": _background,
    "width_above_threshold": _width_above_threshold,
    "attenuation": _attenuation,
    "confidence": _confidence,
    "table": _table,
}
