"""How far an estimate scatters: the same estimator, run on draws from the laws.

Two tables are drawn once for each number of repeats: of distances over the scatter of a range in steps, and of signals
over their margin above the threshold and the step of the amplitude. Errors of rays are read off these.
"""

from __future__ import annotations

import functools

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.ideals.repeats.response import LinearResponse, Response, SimulatedResponse
from lidarcheck.ideals.repeats.signal import STRONG, Shots, signals
from lidarcheck.sensor import Linear

__all__ = ["errors_of"]

_SEED = 0xE44
_DRAWS = 4000
_STEPS = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7, 1.0, 1.5, 2.5, 5.0, 10.0])
"""Standard deviations of a range, in steps."""
_MARGINS = np.array([-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, STRONG])
_COARSE = np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0])
"""Steps of the amplitude, in standard deviations."""
_MOST_REPEATS = 64
_FEWEST_SHOTS = 200
_CORE = 0.995


def errors_of(
    signal: FloatArray, range_sd_m: FloatArray, step: FloatArray, hits: IndexArray, fired: IndexArray,
    response: Response, step_m: float, *, fired_known: bool,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Standard deviations of the estimates of distance [m] and signal, shape (n,) each.

    `range_sd_m`: scatter of one range; `step`: of the amplitude; `step_m`: of the range.
    """
    if isinstance(response, SimulatedResponse):
        return _drawn(signal, hits, fired, response, step_m)
    error = signal_error(signal, step, hits, fired, response, fired_known=fired_known)
    moved = response.shift_m(signal + error) - response.shift_m(signal)
    return np.hypot(distance_error_m(range_sd_m, hits, step_m), moved), error


def _drawn(
    signal: FloatArray, hits: IndexArray, fired: IndexArray, response: SimulatedResponse, step_m: float
) -> tuple[FloatArray, FloatArray]:
    distance, error = np.empty((2, len(signal)))
    seen, shot = np.minimum(hits, _MOST_REPEATS), np.minimum(fired, _MOST_REPEATS)
    for pair in np.unique(np.column_stack([seen, shot]), axis=0):
        rows = (seen == pair[0]) & (shot == pair[1])
        of_distance, of_signal = drawn_errors(response, int(pair[0]), int(pair[1]), step_m)
        at = np.log(np.maximum(signal[rows], 1e-300))
        distance[rows] = np.interp(at, response.log_signal, of_distance)
        error[rows] = signal[rows] * np.interp(at, response.log_signal, of_signal)
    return distance, error


def distance_error_m(sigma_m: FloatArray, hits: IndexArray, step_m: float) -> FloatArray:
    """Standard deviation of the median of so many ranges, each rounded to a step and spread over it; shapes (n,)."""
    count = np.minimum(hits, _MOST_REPEATS)
    found = np.empty(len(sigma_m))
    for n in np.unique(count):
        rows = count == n
        table = _distance_table(int(n))
        if step_m > 0.0:
            ratio = sigma_m[rows] / step_m
            # Beyond the last the step no longer matters but for its own variance, spread and rounding: 1/6.
            wide = np.sqrt(np.maximum(ratio, _STEPS[-1]) ** 2 + 1.0 / 6.0) / np.sqrt(_STEPS[-1] ** 2 + 1.0 / 6.0)
            found[rows] = step_m * np.interp(ratio, _STEPS, table) * wide
        else:
            found[rows] = sigma_m[rows] * table[-1] / np.sqrt(_STEPS[-1] ** 2 + 1.0 / 6.0)
        found[rows] *= np.sqrt(n / np.maximum(hits[rows], n))
    return found


@functools.cache
def _distance_table(hits: int) -> FloatArray:
    """Standard deviation of the estimate, in steps, for each of `_STEPS`."""
    rng = np.random.default_rng([_SEED, hits])
    place = rng.random((_DRAWS, 1))
    z, spread = rng.standard_normal((_DRAWS, hits)), rng.random((_DRAWS, hits)) - 0.5
    found = np.empty(len(_STEPS))
    for k, sigma in enumerate(_STEPS):
        ranges = np.rint(place + sigma * z) + spread
        found[k] = np.sqrt(np.mean((np.median(ranges, axis=1) - place[:, 0]) ** 2))
    return found


def signal_error(
    signal: FloatArray, step: FloatArray, hits: IndexArray, fired: IndexArray, response: Response, *, fired_known: bool
) -> FloatArray:
    """Standard deviation of the estimate of each signal, shape (n,). `step`: of the amplitude at that signal."""
    margin, sd = response.margin(signal), response.signal_sd(signal)
    strong = margin >= STRONG
    count = np.minimum(np.where(strong, hits, fired), _MOST_REPEATS)
    coarse = np.minimum(step / np.maximum(response.amplitude_sd(signal), 1e-300), 1e3)
    found = np.empty(len(signal))
    for n in np.unique(count):
        rows = count == n
        table = _signal_table(int(n), fired_known, bool((coarse[rows] > 0.0).any()))
        found[rows] = sd[rows] * _read(table, margin[rows], coarse[rows])
    return found


def _read(table: FloatArray, margin: FloatArray, coarse: FloatArray) -> FloatArray:
    """Between the table's places, linearly; coarser steps than its last go on in proportion."""
    at = np.clip(np.interp(margin, _MARGINS, np.arange(len(_MARGINS))), 0, len(_MARGINS) - 1)
    over = np.maximum(coarse / _COARSE[-1], 1.0)
    to = np.interp(coarse, _COARSE, np.arange(len(_COARSE)))
    i, j = (np.minimum(x.astype(np.int64), n - 2) for x, n in ((at, len(_MARGINS)), (to, len(_COARSE))))
    u, v = at - i, to - j
    low = table[i, j] * (1 - v) + table[i, j + 1] * v
    high = table[i + 1, j] * (1 - v) + table[i + 1, j + 1] * v
    return np.asarray((low * (1 - u) + high * u) * over)


@functools.cache
def _signal_table(fired: int, fired_known: bool, stepped: bool) -> FloatArray:
    """Standard deviation of the signal's estimate in those of a shot, by `_MARGINS` and `_COARSE`.

    Drawn of a detector of noise 1: what differs from sensor to sensor are the margin and the step alone.
    """
    found = np.empty((len(_MARGINS), len(_COARSE)))
    for i, margin in enumerate(_MARGINS):
        for j, step in enumerate(_COARSE[: None if stepped else 1]):
            found[i, j] = _scatter(fired, float(margin), float(step), fired_known)
        if not stepped:
            found[i, 1:] = found[i, 0]
    return found


def _scatter(fired: int, margin: float, step: float, fired_known: bool) -> float:
    response = LinearResponse(_UNIT())
    shift = response.sensor.threshold
    rng = np.random.default_rng([_SEED, fired, round(1e3 * (margin + 10)), round(1e3 * step)])
    # What is called strong stands far above the threshold: nothing is lost there.
    true = shift + (margin if margin < STRONG else 1000.0) + step * (rng.random((_DRAWS // 2, 1)) - 0.5)
    a = true + rng.standard_normal((_DRAWS // 2, fired))
    hit = a > shift
    value = np.rint(a / step) * step if step > 0.0 else a
    hits = hit.sum(axis=1)
    seen = np.flatnonzero((2 * hits > fired) & (hits >= 1))
    if len(seen) < 50:
        return 1.5
    mask, value, hits = hit[seen], value[seen], hits[seen]
    mean = np.where(mask, value, 0.0).sum(axis=1) / hits
    variance = np.where(mask, (value - mean[:, None]) ** 2, 0.0).sum(axis=1) / hits
    shots = Shots(
        np.full(len(seen), fired), hits, mean, variance, mean - 0.5 * step, mean + 0.5 * step,
        np.zeros(len(seen), dtype=np.bool_),
    )  # fmt: skip
    off = signals(shots, response, fired_known=fired_known) - true[seen, 0]
    return float(np.sqrt(np.mean(off**2)))


@functools.cache
def _UNIT() -> Linear:
    """A detector whose noise is 1, and far enough from 0 for no signal to end there."""
    from dataclasses import replace

    from lidarcheck.sensor import shipped

    plain = shipped("VLP-16")
    assert isinstance(plain, Linear)
    return replace(plain, threshold=20.0, noise=1.0, excess=0.0, relative=0.0, saturation=None, missing=())


@functools.lru_cache(maxsize=256)
def drawn_errors(response: SimulatedResponse, hits: int, fired: int, step_m: float) -> tuple[FloatArray, FloatArray]:
    """Standard deviations of the estimates of distance [m] and of signal (as a share of it), for each signal simulated.

    Amplitude and range of a shot are drawn together, as the model made them: pile-up moves both.
    """
    rng = np.random.default_rng([_SEED, hits, fired])
    distance, share = np.full((2, len(response.shots)), np.nan)
    for k, shots in enumerate(response.shots):
        if len(shots) < _FEWEST_SHOTS:
            continue
        picked = shots[rng.integers(0, len(shots), (_DRAWS // 4, hits))]
        amplitude, off = picked[..., 0], picked[..., 1]
        mean = amplitude.mean(axis=1)
        rows = len(mean)
        found = signals(
            Shots(
                np.full(rows, fired), np.full(rows, hits), mean, amplitude.var(axis=1), mean, mean,
                np.zeros(rows, dtype=np.bool_),
            ),
            response,
        )  # fmt: skip
        place = rng.random((rows, 1)) * step_m
        ranges = off + place
        if step_m > 0.0:
            ranges = np.rint(ranges / step_m) * step_m + step_m * (rng.random((rows, hits)) - 0.5)
        distance[k] = _core(np.median(ranges, axis=1) - place[:, 0] - response.shift_m(found))
        share[k] = _core(found / np.exp(response.log_signal[k]) - 1.0)
    at = np.flatnonzero(np.isfinite(distance))
    return tuple(np.interp(np.arange(len(column)), at, column[at]) for column in (distance, share))


def _core(error: FloatArray) -> float:
    """Root mean square, without the draws in which another echo was taken."""
    inside = np.abs(error - np.median(error)) <= np.quantile(np.abs(error - np.median(error)), _CORE)
    return float(np.sqrt(np.mean(error[inside] ** 2)))
