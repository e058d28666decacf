"""The laws of a linear detector from repeats: how amplitudes and ranges scatter, and which shots are lost.

What the sensor's file states stays; what it leaves open is fitted. Source: the contract on sensors, 6.4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.ideals.repeats.laws.loss import fit_loss
from lidarcheck.ideals.repeats.laws.scatter import fit_noise, fit_range
from lidarcheck.ideals.repeats.laws.spread import CORE_TAIL, AmplitudeBin, Sample, binned, bins_of, pooled_variance
from lidarcheck.ideals.repeats.laws.work import THRESHOLD, Fitted, Work, sample_of
from lidarcheck.ideals.repeats.observations import Observations
from lidarcheck.ideals.repeats.response import LinearResponse, Response
from lidarcheck.sensor import Feature, Linear, Sensor

__all__ = ["Laws", "fit_laws", "predicted_sd"]

_ROUNDS = 3
_NEAR_M = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 100.0, 300.0, 1000.0)
_TELLS_NEAR = 4.0
"""The logarithm of the likelihood must differ by so much over the places that `near_m` may have."""
_BRIGHT = 0.8
"""Reflectance of the brightest twentieth of the surfaces where nothing says how much light the laser sends."""
_MOST_LOST = 0.01
_FINE = 0.25
"""Amplitudes of coarser steps than this part of them blur what `near_m` is fitted to."""


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


def fit_laws(
    seen: Observations, sensor: Sensor, feature: Feature | None, stated: frozenset[str], use: BoolArray
) -> Laws:
    """The laws by the frames of `use`, shape (frames,). `stated`: the detector's numbers that the sensor's file has."""
    if not isinstance(sensor, Linear):
        return _as_stated(seen, sensor, feature, use)
    free = {*type(sensor).numbers(), "range_law"} - stated
    work = Work(seen, feature, use, _begun(seen, sensor, feature, free), free)
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
            fit_noise(work, bins)
        fit_loss(work, coarse)
        fit_range(work, bins, coarse)
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
    if THRESHOLD in free and feature is not None and len(seen.value):
        low = seen.amplitudes(feature, sensor).low
        sensor = replace(sensor, threshold=float(max(np.quantile(low, 0.002), 0.0)))
    return sensor


def _near(work: Work) -> float:
    """`near_m` by which the scatter of ranges hangs on the amplitude alone; the range below which amplitudes say
    nothing, where it cannot be told."""
    scores = []
    for near in _NEAR_M:
        tried = replace(work.sensor, near_m=near)
        sample, _, _ = sample_of(work.seen, work.feature, tried, work.use)
        low = work.seen.amplitudes(work.feature, tried).high
        response = LinearResponse(tried)
        lost = float(np.mean(response.margin(low) < -3.0)) if THRESHOLD not in work.free else 0.0
        scores.append(-np.inf if lost > _MOST_LOST else _likelihood(sample, tried.range_resolution_m))
    score = np.array(scores)
    if not np.isfinite(score).any() or np.ptp(score[np.isfinite(score)]) < _TELLS_NEAR:
        work.notes.append("near_m cannot be told: rays nearer than 10 m are judged without amplitude")
        return 10.0
    best = int(np.argmax(score))
    likely = np.flatnonzero(score > score[best] - 1.353)
    ends = _NEAR_M[max(likely[0] - 1, 0)], _NEAR_M[min(likely[-1] + 1, len(_NEAR_M) - 1)]
    path = float(np.median(work.seen.path_m))
    if "signal_at_1m" in work.free:
        work.sensor = replace(work.sensor, signal_at_1m=100.0 * (path**2 + _NEAR_M[best] ** 2))
    work.put("near_m", _NEAR_M[best], ends=ends)
    if THRESHOLD in work.free:
        low = work.seen.amplitudes(work.feature, work.sensor).low
        work.sensor = replace(work.sensor, threshold=float(max(np.quantile(low, 0.002), 0.0)))
    return 0.0


def _likelihood(sample: Sample, step_m: float) -> float:
    """How likely the ranges' variances are where each bin of amplitudes has one of its own."""
    fine = np.flatnonzero(sample.step < _FINE * sample.amplitude)
    total, number = 0.0, bins_of(sample.amplitude[fine], octave=8)
    for k in np.unique(number):
        rows = fine[number == k]
        freedom = sample.hits[rows] - 1
        variance, kept = pooled_variance(sample.range_var[rows], freedom, least=0.04 * step_m**2, tail=CORE_TAIL)
        mean = max(variance, 0.04 * step_m**2, 1e-12)
        some = freedom[kept]
        total -= 0.5 * float((some * (np.log(mean) + sample.range_var[rows][kept] / mean)).sum())
    return total


def _white(work: Work) -> None:
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


def predicted_sd(response: Response, bins: Sequence[AmplitudeBin]) -> tuple[FloatArray, FloatArray]:
    """Scatter of ranges and of amplitudes that the laws foretell of each bin, shape (bins,)."""
    signal = response.signal_of(np.array([b.amplitude for b in bins]))
    path = np.array([b.path_m for b in bins])
    return response.range_sd_m(signal, path), response.amplitude_sd(signal)
