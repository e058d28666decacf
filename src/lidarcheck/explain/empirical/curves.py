"""The curves of empirical terms: over a covariate, over a phase that repeats, over the levels of a feature."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = ["at", "curve", "levels", "repeating", "rhythms", "steps_of"]


FINE_FROM = 12
"""Curves of more knots than this have them at even distances, or a knot for each of so many whole numbers."""
_COUNTED, _EACH = ("layer", "point"), 200
_PHASES = 24
_FEWEST_PERIODS, _OVERSAMPLED, _MOST_RHYTHMS = 2.5, 6.0, 3
_CELLS = {"range_m": 0.05, "layer": 1.0, "point": 1.0}
"""Covariates in which something may repeat, and to what they are rounded for that."""
_SHORTEST = {"range_m": 1.0, "layer": 4.0, "point": 4.0}
"""What repeats within less is not looked for."""
_FINEST_M, _LONGEST_M = 0.005, 5.0
"""Ranges are rounded to the first to find their steps, which are no coarser than the second and four times the first
or more: centimetres are how a file is written."""
_REFINED = 3
_ON_STEPS, _ALIKE = 0.9, 0.95
"""Ranges on a lattice agree in phase to this part, and to such a part of the best with all that divides it."""
_MOST_LEVELS, _LEVELS = 400, 40
_FEW = 5.0
"""A level that so many echoes have is believed by half."""


def curve(u: FloatArray, value: FloatArray, weight: FloatArray, name: str, most: int) -> tuple[FloatArray, FloatArray]:
    """Knots and values: weighted means, shrunk where little is known of them and 0 where nothing is."""
    if name == "material_id" or (name in _COUNTED and most > FINE_FROM and len(np.unique(u)) <= _EACH):
        knots, place = np.unique(u, return_inverse=True)
    elif most > FINE_FROM:
        # Evenly and with an empty bin at either end: what no beam has met is left as it is, not extrapolated.
        width = max(float(np.ptp(u)), 1e-3) / (most - 2)
        edges = u.min() - width + width * np.arange(most + 1)
        place = np.clip(np.searchsorted(edges, u, side="right") - 1, 0, most - 1)
        knots = 0.5 * (edges[1:] + edges[:-1])
    else:
        edges = np.unique(np.quantile(u, np.linspace(0.0, 1.0, most + 1)))
        place = np.clip(np.searchsorted(edges, u, side="right") - 1, 0, max(len(edges) - 2, 0))
        count = np.bincount(place, minlength=max(len(edges) - 1, 1))
        knots = np.bincount(place, u, len(count)) / np.maximum(count, 1)
    heft = np.bincount(place, weight, len(knots))
    values = np.bincount(place, weight * value, len(knots)) / np.maximum(heft + 0.02 * heft.mean(), 1e-12)
    keep = np.concatenate([[True], np.diff(knots) > 1e-3]) if len(knots) > 1 else np.ones(len(knots), dtype=bool)
    return np.asarray(knots[keep], dtype=np.float64), np.asarray(values[keep])


def at(knots: FloatArray, values: FloatArray, u: FloatArray, name: str) -> FloatArray:
    """A curve at values of its covariate, same shape."""
    if name == "material_id":
        place = np.minimum(np.searchsorted(knots, u), len(knots) - 1)
        return np.where(knots[place] == u, values[place], 0.0)
    return np.asarray(np.interp(u, knots, values))


def rhythms(u: FloatArray, value: FloatArray, weight: FloatArray, name: str) -> list[tuple[float, float]]:
    """The periods of the waves that explain most, each better than its neighbours, and how much of the values'
    weighted squares they explain; the best first, at most three."""
    cell, total, heft = _cells(u, value, weight, _CELLS[name])
    span, shortest = float(np.ptp(u)), _SHORTEST[name]
    if span < 2.0 * _FEWEST_PERIODS * shortest or heft.sum() == 0.0:
        return []
    frequency = np.arange(_FEWEST_PERIODS / span, 1.0 / shortest, 1.0 / (_OVERSAMPLED * span))
    explained = np.array([_explained(cell, total, heft, f) for f in frequency])
    peaks = np.flatnonzero((explained[1:-1] > explained[:-2]) & (explained[1:-1] > explained[2:])) + 1
    best = peaks[np.argsort(-explained[peaks])][:_MOST_RHYTHMS]
    return [(float(1.0 / frequency[k]), float(explained[k])) for k in best]


def repeating(
    u: FloatArray, value: FloatArray, weight: FloatArray, name: str, period: float
) -> tuple[FloatArray, FloatArray]:
    """Knots over one period and values there of the wave near a period that explains most, with its mean."""
    cell, total, heft = _cells(u, value, weight, _CELLS[name])
    near = 1.0 / period + np.linspace(-0.5, 0.5, 41) / max(float(np.ptp(u)), period)
    frequency = float(near[np.argmax([_explained(cell, total, heft, f) for f in near])])
    size = _wave(cell, total, heft, frequency)
    knots = np.asarray(np.linspace(0.0, 1.0 / frequency, _PHASES + 1), dtype=np.float64)
    return knots, _waves(knots, frequency) @ size


def _cells(
    u: FloatArray, value: FloatArray, weight: FloatArray, width: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where values are, their weighted sums there and the weights' sums; cells of that width."""
    place = np.round(u / width).astype(np.int64)
    at_cell, cell = np.unique(place, return_inverse=True)
    total, heft = (np.bincount(cell, w).astype(np.float64) for w in (weight * value, weight))
    return np.asarray(at_cell * width, dtype=np.float64), total, heft


def _waves(u: FloatArray, frequency: float) -> FloatArray:
    turn = 2.0 * np.pi * frequency * u
    return np.column_stack([np.ones(len(u)), np.cos(turn), np.sin(turn)])


def _wave(cell: FloatArray, total: FloatArray, heft: FloatArray, frequency: float) -> FloatArray:
    """The wave of a frequency that fits best: its mean, cosine and sine."""
    waves = _waves(cell, frequency)
    normal = waves.T @ (heft[:, None] * waves) + 1e-3 * heft.sum() * np.diag([0.0, 1.0, 1.0])
    return np.asarray(np.linalg.solve(normal, waves.T @ total))


def _explained(cell: FloatArray, total: FloatArray, heft: FloatArray, frequency: float) -> float:
    """How much of the weighted squares the best wave of a frequency explains."""
    there = _waves(cell, frequency) @ _wave(cell, total, heft, frequency)
    return float((2.0 * there * total - heft * there**2).sum())


def steps_of(range_m: FloatArray) -> tuple[float, float] | None:
    """The lattice that ranges stand on, (one of its points, its step) in m; None where they stand on none that is
    coarser than a few centimetres."""
    place = np.round(range_m / _FINEST_M).astype(np.int64)
    if len(place) == 0 or place.min() < 0:
        return None
    count = np.bincount(place).astype(np.float64)
    n = 1 << int(np.ceil(np.log2(16 * len(count))))
    waves = np.fft.rfft(count, n) / len(range_m)
    frequency = np.fft.rfftfreq(n, _FINEST_M)
    agree = np.abs(waves)
    agree[(frequency < 1.0 / _LONGEST_M) | (frequency > 0.25 / _FINEST_M)] = 0.0
    if agree.max() < _ON_STEPS:
        return None
    first = int(np.flatnonzero(agree > _ALIKE * agree.max())[0])
    best = first + int(agree[first : first + 16].argmax())  # the slowest of the rhythms, where it is clearest
    step_m = float(1.0 / frequency[best])
    phase = float(np.angle(np.exp(2j * np.pi * range_m / step_m).mean())) / (2.0 * np.pi)
    first_m = (phase % 1.0) * step_m
    for _ in range(_REFINED):  # to the last digit: half a lattice off at the far end is none
        number = np.round((range_m - first_m) / step_m)
        near = np.abs(range_m - first_m - number * step_m) < 0.25 * step_m
        if np.ptp(number[near]) > 0.0:
            step_m, first_m = np.polyfit(number[near], range_m[near], 1)
    return float(first_m), float(step_m)


def levels(name: str, shown: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What turns the distribution of a feature's shown values into that of the measured ones, level by level; both of
    `Sights.feature`, AREA and PEAK by their ln, WIDTH in ns. Knots are of the covariate `name`."""
    is_ln = name.endswith("_log10")
    x, y = (np.sort(np.exp(value) if is_ln else value) for value in (shown, measured))
    values, count = np.unique(np.round(x, 6), return_counts=True)
    if len(values) > (_MOST_LEVELS if name == "peak_log10" else _LEVELS):
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, _LEVELS + 1)))
        place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
        count = np.bincount(place, minlength=len(edges) - 1)
        values = np.bincount(place, x, len(edges) - 1) / np.maximum(count, 1)
        values, count = values[count > 0], count[count > 0]
    below = np.append(0.0, np.cumsum(count)) / count.sum()
    sums = np.interp(below, np.arange(len(y) + 1) / len(y), np.append(0.0, np.cumsum(y)))
    there = np.diff(sums) / np.maximum(np.diff(below) * len(y), 1e-12)
    sure = count / (count + _FEW)
    if not is_ln:
        return values, sure * (there - values)
    return np.log10(values), sure * np.log(np.maximum(there, 1e-9) / values)
