"""The laws of a linear detector from repeats: how amplitudes and ranges scatter, and which shots are lost.

What the sensor's file states stays; what it leaves open is fitted. Source: the contract on sensors, 6.4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.ideals.repeats.amplitude import Amplitudes
from lidarcheck.ideals.repeats.groups import Groups, gap_m, grouped
from lidarcheck.ideals.repeats.loss import Lost, fitted_threshold
from lidarcheck.ideals.repeats.neighbours import at_edges, of_surfaces
from lidarcheck.ideals.repeats.observations import Observations
from lidarcheck.ideals.repeats.response import LinearResponse, Response, response_of
from lidarcheck.ideals.repeats.spread import AmplitudeBin, Sample, binned
from lidarcheck.sensor import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS, Feature, Linear, Sensor

__all__ = ["Fitted", "Laws", "fit_laws", "sample_of"]

_ROUNDS = 3
_BY_90 = 1.645
_NEAR_M = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 100.0, 300.0, 1000.0)
_POWERS = np.linspace(0.1, 3.0, 59)
_TELLS_NEAR = 4.0
"""The logarithm of the likelihood must differ by so much over the places that `near_m` may have."""
_BRIGHT = 0.8
"""Reflectance of the brightest twentieth of the surfaces where nothing says how much light the laser sends."""
_MOST_LOST = 0.01
_FEWEST_SEEN = 200
_LEAST = 0.1
"""A threshold is at least this part of the least amplitude where the scatter of ranges is counted from it."""


@dataclass(frozen=True)
class Fitted:
    """A number and the ends of its 90 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Laws:
    """The sensor with its laws, and what they rest on.

    `fitted`: numbers that the sensor's file leaves open, by their names there. `words`: such of them that are words.
    `bins`: what was seen, by amplitude. `coarse`: amplitudes are too coarse to show their scatter. `untold_m`: rays
    nearer than this are judged without amplitude. `notes`: what could not be fitted, and why.
    """

    sensor: Sensor
    fitted: Mapping[str, Fitted] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)
    bins: Sequence[AmplitudeBin] = ()
    coarse: bool = False
    untold_m: float = 0.0
    notes: Sequence[str] = ()


@dataclass
class _Work:
    """A fit under way: the sensor as it is known, what is free, and what has been found."""

    seen: Observations
    feature: Feature | None
    use: BoolArray
    sensor: Linear
    free: set[str]
    fitted: dict[str, Fitted] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def put(self, name: str, value: float, error: float | None = None, ends: tuple[float, float] | None = None) -> None:
        """Take a number as found, within its bounds; `error`: its standard error."""
        bound = type(self.sensor).numbers()[name]
        value = float(np.clip(value, bound.low, bound.high))
        low, high = ends or (value - _BY_90 * (error or 0.0), value + _BY_90 * (error or 0.0))
        self.fitted[name] = Fitted(value, float(max(low, bound.low)), float(min(high, bound.high)))
        missing = tuple(m for m in self.sensor.missing if m != name)
        changed: dict[str, Any] = {name: value}
        self.sensor = replace(self.sensor, missing=missing, **changed)


def fit_laws(
    seen: Observations, sensor: Sensor, feature: Feature | None, stated: frozenset[str], use: BoolArray
) -> Laws:
    """The laws by the frames of `use`, shape (frames,). `stated`: the detector's numbers that the sensor's file has."""
    if not isinstance(sensor, Linear):
        return _as_stated(seen, sensor, feature, use)
    free = {*type(sensor).numbers(), "range_law"} - stated
    work = _Work(seen, feature, use, _begun(seen, sensor, feature, free), free)
    if feature is None:
        work.notes.append("no feature tells amplitudes: noise and threshold are as the sensor's file has them")
    coarse, untold_m = False, 0.0
    if feature is not None and feature.law == "calibrated_reflectivity" and "near_m" in free:
        untold_m = _near(work)
    bins: list[AmplitudeBin] = []
    for _ in range(_ROUNDS):
        sample, _groups, _gaps = sample_of(seen, feature, work.sensor, use)
        bins = binned(sample, work.sensor.range_resolution_m)
        coarse = feature is None or 2 * sum(b.resolved for b in bins) < len(bins)
        if not coarse:
            _noise(work, bins)
        _loss(work, coarse)
        _range(work, bins, coarse)
    _white(work)
    return Laws(work.sensor, work.fitted, work.words, bins, coarse, untold_m, tuple(work.notes))


def _as_stated(seen: Observations, sensor: Sensor, feature: Feature | None, use: BoolArray) -> Laws:
    """The laws of a detector whose counting is physics: nothing is fitted, what was seen is kept beside."""
    if "signal_at_1m" in sensor.missing:
        sensor = replace(sensor, signal_at_1m=1.0, missing=tuple(m for m in sensor.missing if m != "signal_at_1m"))
    sample, _, _ = sample_of(seen, feature, sensor, use)
    return Laws(sensor, bins=binned(sample, sensor.range_resolution_m))


def _begun(seen: Observations, sensor: Linear, feature: Feature | None, free: set[str]) -> Linear:
    """The sensor to begin with: a laser in whose unit amplitudes are as the values, a threshold below all of them."""
    if "signal_at_1m" in sensor.missing:
        path = float(np.median(seen.path_m)) if len(seen.path_m) else 1.0
        sensor = replace(sensor, signal_at_1m=100.0 * (path**2 + sensor.near_m**2))
    sensor = replace(sensor, missing=tuple(m for m in sensor.missing if m not in type(sensor).numbers()))
    if "threshold" in free and feature is not None and len(seen.value):
        low = seen.amplitudes(feature, sensor).low
        sensor = replace(sensor, threshold=float(max(np.quantile(low, 0.002), 0.0)))
    return sensor


def sample_of(
    seen: Observations, feature: Feature | None, sensor: Sensor, use: BoolArray
) -> tuple[Sample, Groups, FloatArray]:
    """Rays of one surface and beside no edge that were seen twice or more; all surfaces; the gaps."""
    response, amplitudes = response_of(sensor, feature), seen.amplitudes(feature, sensor)
    gaps = gap_m(response, sensor, amplitudes.value, seen.path_m)
    groups = grouped(seen, amplitudes, gaps, use)
    place = np.full(len(seen.rays), np.nan)
    place[groups.ray[groups.main]] = groups.path_m[groups.main]
    clean = groups.main & ~groups.two[groups.ray] & ~at_edges(seen.rays, place)[groups.ray]
    rows = np.flatnonzero(clean & (groups.hits >= 2) & ~groups.capped)
    amplitude = np.nan_to_num(groups.amplitude[rows])
    sample = Sample(
        amplitude, groups.path_m[rows], groups.hits[rows], groups.fired[groups.ray[rows]], groups.range_var[rows],
        np.nan_to_num(groups.amplitude_var[rows]), np.nan_to_num(groups.high[rows] - groups.low[rows]),
    )  # fmt: skip
    return sample, groups, gaps


def _near(work: _Work) -> float:
    """`near_m` by which the scatter of ranges hangs on the amplitude alone; the range below which amplitudes say
    nothing, where it cannot be told."""
    scores = []
    for near in _NEAR_M:
        tried = replace(work.sensor, near_m=near)
        sample, _, _ = sample_of(work.seen, work.feature, tried, work.use)
        low = work.seen.amplitudes(work.feature, tried).high
        response = LinearResponse(tried)
        lost = float(np.mean(response.margin(low) < -3.0)) if "threshold" not in work.free else 0.0
        scores.append(-np.inf if lost > _MOST_LOST else _likelihood(sample, tried.range_resolution_m))
    score = np.array(scores)
    if not np.isfinite(score).any() or np.ptp(score[np.isfinite(score)]) < _TELLS_NEAR:
        work.notes.append("near_m cannot be told: rays nearer than 10 m are judged without amplitude")
        return 10.0
    best = int(np.argmax(score))
    likely = np.array(_NEAR_M)[score > score[best] - 1.353]
    path = float(np.median(work.seen.path_m))
    if "signal_at_1m" in work.free:
        work.sensor = replace(work.sensor, signal_at_1m=100.0 * (path**2 + _NEAR_M[best] ** 2))
    work.put("near_m", _NEAR_M[best], ends=(float(likely.min()), float(likely.max())))
    if "threshold" in work.free:
        low = work.seen.amplitudes(work.feature, work.sensor).low
        work.sensor = replace(work.sensor, threshold=float(max(np.quantile(low, 0.002), 0.0)))
    return 0.0


def _likelihood(sample: Sample, step_m: float) -> float:
    """How likely the ranges' variances are where each bin of amplitudes has one of its own."""
    from lidarcheck.ideals.repeats.spread import bins_of, pooled_variance

    total, number = 0.0, bins_of(sample.amplitude, octave=8)
    for k in np.unique(number):
        rows = np.flatnonzero(number == k)
        freedom = sample.hits[rows] - 1
        variance, kept = pooled_variance(sample.range_var[rows], freedom, least=0.04 * step_m**2)
        mean = max(variance, 0.04 * step_m**2, 1e-12)
        some = freedom[kept]
        total -= 0.5 * float((some * (np.log(mean) + sample.range_var[rows][kept] / mean)).sum())
    return total


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


def _noise(work: _Work, bins: Sequence[AmplitudeBin]) -> None:
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
            low, high = (np.sqrt(max(value + sign * _BY_90 * scatter, 0.0)) for sign in (-1.0, 1.0))
            work.put(name, float(np.sqrt(value)), ends=(float(low), float(high)))


def _range(work: _Work, bins: Sequence[AmplitudeBin], coarse: bool) -> None:
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
    signal = np.array([b.amplitude for b in bins])
    pulse_m = 0.5 * LIGHT_SPEED_M_PER_NS * sensor.pulse_fwhm_ns / FWHM_PER_SIGMA
    # A bin holds signals about its mean amplitude: the mean of a law that bends lies beside the law of the mean.
    aside = np.sqrt(np.array([b.width**2 + b.amplitude_sd**2 / b.hits for b in bins]))
    around = np.maximum(np.stack([signal - aside, signal + aside]), 0.3 * signal)
    edge = np.mean((pulse_m * response.amplitude_sd(around) / np.maximum(around, 1e-12)) ** 2, axis=0)
    y = np.array([b.range_sd_m**2 for b in bins])
    terms = {"range_floor_m": np.ones_like(edge), "edge_factor": edge}
    free = [name for name in terms if name in work.free]
    if not free:
        return
    fixed = sum(getattr(sensor, name) ** 2 * column for name, column in terms.items() if name not in free)
    found, error = _fit_squares([terms[name] for name in free], y - fixed, np.array([float(b.freedom) for b in bins]))
    for name, value, scatter in zip(free, found, error, strict=True):
        low, high = (float(np.sqrt(max(value + sign * _BY_90 * scatter, 0.0))) for sign in (-1.0, 1.0))
        work.put(name, float(np.sqrt(value)), ends=(low, high))


def _power(work: _Work, bins: Sequence[AmplitudeBin]) -> None:
    sensor = work.sensor
    signal = np.array([max(b.amplitude, 1e-12) for b in bins])
    y, freedom = np.array([b.range_sd_m**2 for b in bins]), np.array([float(b.freedom) for b in bins])
    if "threshold" in work.free and sensor.threshold < _LEAST * float(signal.min()):
        # A power of threshold over signal needs one.
        work.put("threshold", _LEAST * float(signal.min()), ends=(0.0, float(signal.min())))
    threshold = work.sensor.threshold
    if threshold <= 0.0:
        _note(work, "no power of the threshold describes the scatter of ranges: it is 0")
        return
    best = None
    for power in _POWERS:
        columns = [np.ones_like(signal), (threshold / signal) ** (2.0 * power)]
        found, error = _fit_squares(columns, y, freedom)
        model = np.maximum(found[0] * columns[0] + found[1] * columns[1], 1e-18)
        score = float((0.5 * freedom * (np.log(model) + y / model)).sum())
        if best is None or score < best[0]:
            best = (score, power, found, error)
    assert best is not None
    _, power, found, error = best
    work.words["range_law"] = "power"
    work.sensor = replace(work.sensor, range_at_threshold_m=0.0, range_law="power")
    work.put("range_power", float(power))
    for name, value, scatter in zip(("range_floor_m", "range_at_threshold_m"), found, error, strict=True):
        low, high = (float(np.sqrt(max(value + sign * _BY_90 * scatter, 0.0))) for sign in (-1.0, 1.0))
        work.put(name, float(np.sqrt(value)), ends=(low, high))


def _loss(work: _Work, coarse: bool) -> None:
    """Threshold, and the width where amplitudes do not tell it, from hits and misses."""
    if "threshold" not in work.free or work.feature is None:
        return
    if not work.seen.fired_known:
        _note(work, "the beams that were fired are not known: the threshold is the least amplitude seen")
        return
    sensor, seen = work.sensor, work.seen
    response, amplitudes = LinearResponse(sensor), seen.amplitudes(work.feature, sensor)
    gaps = gap_m(response, sensor, amplitudes.value, seen.path_m)
    groups = grouped(seen, amplitudes, gaps, work.use, half=True)
    width = None
    if coarse:
        width = float(np.median(groups.high - groups.low)) if len(groups) else 1.0
    reach = 10.0 * (width or float(response.amplitude_sd(np.array([sensor.threshold]))[0]))
    place = np.full(len(seen.rays), np.nan)
    place[groups.ray[groups.main]] = groups.path_m[groups.main]
    chosen = groups.main & ~groups.two[groups.ray] & (groups.amplitude < sensor.threshold + reach)
    chosen &= of_surfaces(seen.rays, place)[groups.ray]
    found = fitted_threshold(_lost(groups, amplitudes, chosen, work), response, sensor.threshold, width=width)
    if found is None:
        _note(work, "too few shots were lost to tell the threshold: it is the least amplitude seen")
        return
    threshold, low, high, wide = found
    least = None if coarse else _least_seen(groups, amplitudes, chosen)
    if least is not None and least[1] > threshold:
        # No shot is seen below the threshold: of very many the least lies just above it.
        threshold, low, high = least[1], least[0], least[2]
    work.put("threshold", threshold, ends=(low, high))
    if coarse and "signal_at_1m" in work.free and work.feature.law == "calibrated_reflectivity":
        _in_noise(work, wide)


def _least_seen(groups: Groups, amplitudes: Amplitudes, chosen: BoolArray) -> tuple[float, float, float] | None:
    """The least amplitude of these surfaces' echoes but a thousandth of them, and what would be rounded to it: low end,
    value, high end; None of few."""
    rows = groups.used[(groups.group >= 0) & chosen[np.maximum(groups.group, 0)]]
    if len(rows) < _FEWEST_SEEN:
        return None
    at = rows[np.argpartition(amplitudes.value[rows], 3 + len(rows) // 1000)[3 + len(rows) // 1000]]
    least = float(amplitudes.value[rows].min())
    low, value, high = (float(column[at]) for column in (amplitudes.low, amplitudes.value, amplitudes.high))
    return min(low, least), value, max(high, 2.0 * value - least)


def _in_noise(work: _Work, width: float) -> None:
    """A unit of amplitudes in which the loss law is as wide as the sensor's noise: values alone do not tell it."""
    unit = work.sensor.noise / width
    old = work.fitted["threshold"]
    work.sensor = replace(work.sensor, signal_at_1m=work.sensor.signal_at_1m * unit)
    work.put("threshold", old.value * unit, ends=(old.low * unit, old.high * unit))


def _lost(groups: Groups, amplitudes: Amplitudes, chosen: BoolArray, work: _Work) -> Lost:
    number = np.where(chosen, np.cumsum(chosen) - 1, -1)
    of = np.where(groups.group >= 0, number[np.maximum(groups.group, 0)], -1)
    rows = np.flatnonzero(of >= 0)
    used = groups.used[rows]
    stepped = work.feature is not None and work.feature.step > 0.0
    value = amplitudes.value[used]
    low, high = (amplitudes.low[used], amplitudes.high[used]) if stepped else (value, value)
    return Lost(groups.fired[groups.ray[chosen]], groups.hits[chosen], of[rows], value, low, high)


def _white(work: _Work) -> None:
    """How much light the laser sends, where nothing says it: only its product with reflectances has a meaning."""
    if "signal_at_1m" not in work.free:
        return
    sensor, seen = work.sensor, work.seen
    if work.feature is None or work.feature.law == "calibrated_reflectivity" or not len(seen.path_m):
        work.fitted["signal_at_1m"] = Fitted(sensor.signal_at_1m, sensor.signal_at_1m, sensor.signal_at_1m)
        return
    strength = seen.amplitudes(work.feature, sensor).value * (seen.path_m**2 + sensor.near_m**2)
    bright = float(np.quantile(strength, 0.95)) / _BRIGHT
    work.put("signal_at_1m", max(bright, 1e-9))


def _note(work: _Work, text: str) -> None:
    if text not in work.notes:
        work.notes.append(text)


def predicted_sd(response: Response, bins: Sequence[AmplitudeBin]) -> tuple[FloatArray, FloatArray]:
    """Scatter of ranges and of amplitudes that the laws foretell of each bin, shape (bins,)."""
    signal = response.signal_of(np.array([b.amplitude for b in bins]))
    path = np.array([b.path_m for b in bins])
    return response.range_sd_m(signal, path), response.amplitude_sd(signal)
