"""How amplitudes and ranges scatter over the amplitude, as numbers of a linear detector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from lidarcheck.arrays import FloatArray
from lidarcheck.ideals.repeats.laws.spread import AmplitudeBin
from lidarcheck.ideals.repeats.laws.work import BY_90, THRESHOLD, Work
from lidarcheck.ideals.repeats.response import LinearResponse
from lidarcheck.sensor import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS

__all__ = ["fit_noise", "fit_range"]

_POWERS = np.linspace(0.1, 3.0, 59)
_LEAST = 0.1
"""A threshold is at least this part of the least amplitude where the scatter of ranges is counted from it."""


def _fit_squares(columns: Sequence[FloatArray], y: FloatArray, freedom: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Numbers of 0 or more that make a variance of the columns, and their standard errors.

    A variance's error goes with the variance itself, so the weights follow the fit.
    """
    matrix = np.stack(columns, axis=1)
    scale = np.maximum(np.abs(matrix).max(axis=0), 1e-300)
    model = np.maximum(y, 1e-300)
    for _ in range(6):
        weight = np.sqrt(0.5 * freedom) / np.maximum(model, 1e-3 * float(np.median(np.abs(y))) + 1e-300)
        found, _ = nnls(matrix / scale * weight[:, None], y * weight)
        model = matrix / scale @ found
    inverse = np.linalg.pinv((matrix / scale * weight[:, None]).T @ (matrix / scale * weight[:, None]))
    return found / scale, np.sqrt(np.maximum(np.diag(inverse), 0.0)) / scale


def fit_noise(work: Work, bins: Sequence[AmplitudeBin]) -> None:
    """The photon-transfer line: variance of the amplitude over its mean."""
    sensor = work.sensor
    response = LinearResponse(sensor)
    usable = [b for b in bins if b.resolved and b.amplitude_sd > 0.0]
    clear = [b for b in usable if response.margin(np.array([b.amplitude]))[0] > 3.0]
    usable = clear if len(clear) >= 4 else usable
    mean, variance = np.array([[b.amplitude, b.amplitude_sd**2] for b in usable]).reshape(-1, 2).T
    freedom = np.array([float(b.freedom) for b in usable])
    terms = {"noise": np.ones_like(mean), "excess": mean, "relative": mean**2}
    power = {"noise": 2, "excess": 1, "relative": 2}
    free = [name for name in terms if name in work.free]
    if not free or len(usable) < len(free) + 1:
        return
    fixed = sum(getattr(sensor, name) ** power[name] * column for name, column in terms.items() if name not in free)
    found, error = _fit_squares([terms[name] for name in free], variance - fixed, freedom)
    for name, value, scatter in zip(free, found, error, strict=True):
        if power[name] == 1:
            work.put(name, value, scatter)
        else:
            low, high = (np.sqrt(max(value + sign * BY_90 * scatter, 0.0)) for sign in (-1.0, 1.0))
            work.put(name, float(np.sqrt(value)), ends=(float(low), float(high)))


def fit_range(work: Work, bins: Sequence[AmplitudeBin], coarse: bool) -> None:
    """Scatter of ranges over the amplitude: floor, and either the pulse's edge or a power of threshold over signal."""
    if len(bins) < 2:
        return
    if coarse and {"range_law", "range_floor_m", "edge_factor"} <= work.free:
        _power(work, bins)
        return
    sensor = work.sensor
    if sensor.range_law != "physical":
        return
    response = LinearResponse(sensor)
    pulse_m = 0.5 * LIGHT_SPEED_M_PER_NS * sensor.pulse_fwhm_ns / FWHM_PER_SIGMA
    around = _around(bins)
    edge = np.mean((pulse_m * response.amplitude_sd(around) / np.maximum(around, 1e-12)) ** 2, axis=0)
    y = np.array([b.range_sd_m**2 for b in bins])
    terms = {"range_floor_m": np.ones_like(edge), "edge_factor": edge}
    free = [name for name in terms if name in work.free]
    if not free:
        return
    fixed = sum(getattr(sensor, name) ** 2 * column for name, column in terms.items() if name not in free)
    found, error = _fit_squares([terms[name] for name in free], y - fixed, np.array([float(b.freedom) for b in bins]))
    for name, value, scatter in zip(free, found, error, strict=True):
        low, high = (float(np.sqrt(max(value + sign * BY_90 * scatter, 0.0))) for sign in (-1.0, 1.0))
        work.put(name, float(np.sqrt(value)), ends=(low, high))


def _around(bins: Sequence[AmplitudeBin]) -> FloatArray:
    """Two signals for each bin that have the mean and the scatter of those in it, shape (2, bins).

    The mean of a law that bends lies beside the law of the mean.
    """
    signal = np.array([max(b.amplitude, 1e-12) for b in bins])
    aside = np.sqrt(np.array([b.width**2 + b.amplitude_sd**2 / b.hits + b.step**2 / 12.0 for b in bins]))
    return np.asarray(np.maximum(np.stack([signal - aside, signal + aside]), 0.3 * signal))


def _power(work: Work, bins: Sequence[AmplitudeBin]) -> None:
    sensor = work.sensor
    signal = np.array([max(b.amplitude, 1e-12) for b in bins])
    y, freedom = np.array([b.range_sd_m**2 for b in bins]), np.array([float(b.freedom) for b in bins])
    if THRESHOLD in work.free and sensor.threshold < _LEAST * float(signal.min()):
        # A power of threshold over signal needs one.
        work.put(THRESHOLD, _LEAST * float(signal.min()), ends=(0.0, float(signal.min())))
    threshold = work.sensor.threshold
    if threshold <= 0.0:
        work.note("no power of the threshold describes the scatter of ranges: it is 0")
        return
    around = _around(bins)
    fits = []
    for power in _POWERS:
        columns = [np.ones_like(signal), np.mean((threshold / around) ** (2.0 * power), axis=0)]
        found, error = _fit_squares(columns, y, freedom)
        model = np.maximum(found[0] * columns[0] + found[1] * columns[1], 1e-18)
        score = float((0.5 * freedom * (np.log(model) + y / model)).sum())
        fits.append((score, float(power), found, error))
    score, power, found, error = min(fits, key=lambda fit: fit[0])
    likely = [fit[1] for fit in fits if fit[0] < score + 0.5 * BY_90**2]
    half = 0.5 * float(_POWERS[1] - _POWERS[0])
    work.words["range_law"] = "power"
    work.sensor = replace(work.sensor, range_at_threshold_m=0.0, range_law="power")
    work.put("range_power", power, ends=(min(likely) - half, max(likely) + half))
    for name, value, scatter in zip(("range_floor_m", "range_at_threshold_m"), found, error, strict=True):
        low, high = (float(np.sqrt(max(value + sign * BY_90 * scatter, 0.0))) for sign in (-1.0, 1.0))
        work.put(name, float(np.sqrt(value)), ends=(low, high))
