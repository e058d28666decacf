"""The loss law: the threshold that explains which shots were lost, from what the other repeats say of each ray.

Each shot is foretold by the others of its ray: their amplitudes and losses give the signal's likelihood, and this the
chance of the shot, Phi((S - T)/w). The threshold T, and the width w where amplitudes do not tell it, make what happened
likeliest. There is no lapse: what no weakness explains is no matter of the threshold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtr

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.ideals.repeats.response import Response

__all__ = ["Lost", "fitted_threshold"]

_PLACES = 72
_MOST_HITS = 10_000
_BY_90 = 1.353
"""By so much the logarithm of the likelihood falls at the ends of a 90 % interval."""
_LAPSE = 0.005
"""Chance of a loss or of an echo that nothing explains: keeps one leaf in the wind from deciding the threshold."""


@dataclass(frozen=True)
class Lost:
    """Rays near the threshold: `fired`, `hits` (rays,); a row each hit: its `ray`, `amplitude`, `low` and `high`."""

    fired: IndexArray
    hits: IndexArray
    ray: IndexArray
    amplitude: FloatArray
    low: FloatArray
    high: FloatArray


def fitted_threshold(
    lost: Lost, response: Response, start: float, *, width: float | None = None
) -> tuple[float, float, float, float] | None:
    """Threshold, the ends of its 90 % interval, and the width; None where too few shots tell them.

    `width`: None where sigma(S) is known, else where its search begins.
    """
    lost = _thinned(lost)
    few = int((lost.fired - lost.hits).sum())
    if few < 10 or len(lost.ray) < 100:
        return None
    sd = float(response.amplitude_sd(np.array([start]))[0]) if width is None else width
    grid = np.linspace(max(start - 8.0 * sd, 1e-3 * sd), start + 12.0 * sd, _PLACES)
    own = (
        response.amplitude_sd(grid)
        if width is None
        else np.full(_PLACES, 0.25 * float(np.median(lost.high - lost.low)))
    )
    of_hit = _log_density(lost, grid, own)
    of_ray = np.zeros((len(lost.fired), _PLACES))
    np.add.at(of_ray, lost.ray, of_hit)

    def score(threshold: float, wide: float | None) -> float:
        spread = own if wide is None else np.full(_PLACES, wide)
        return _score(lost, of_hit, of_ray, (grid - threshold) / spread)

    places = np.linspace(max(start - 5.0 * sd, 0.0), start + 5.0 * sd, 25)
    widths = [None] if width is None else list(width * np.geomspace(0.1, 4.0, 9))
    table = np.array([[score(float(t), w) for t in places] for w in widths])
    row, best = np.unravel_index(int(np.argmax(table)), table.shape)
    step = places[1] - places[0]
    fine = np.linspace(max(places[best] - step, 0.0), places[best] + step, 21)
    values = np.array([score(float(t), widths[row]) for t in fine])
    top = int(np.argmax(values))
    every = np.concatenate([places, fine])
    scores = np.concatenate([table[row], values])
    likely = every[scores > values[top] - _BY_90]
    return float(fine[top]), float(likely.min()), float(likely.max()), float(widths[row] or sd)


def _thinned(lost: Lost) -> Lost:
    """At most so many hits, of rays taken evenly."""
    over = len(lost.ray) // _MOST_HITS + 1
    if over == 1:
        return lost
    kept = np.arange(len(lost.fired)) % over == 0
    number = np.cumsum(kept) - 1
    rows = kept[lost.ray]
    return Lost(
        lost.fired[kept], lost.hits[kept], number[lost.ray[rows]], lost.amplitude[rows], lost.low[rows], lost.high[rows]
    )


def _log_density(lost: Lost, grid: FloatArray, sd: FloatArray) -> FloatArray:
    """Of each hit at each signal, shape (hits, places)."""
    low, high = (lost.low[:, None] - grid) / sd, (lost.high[:, None] - grid) / sd
    stepped = (lost.high > lost.low)[:, None]
    inside = np.log(np.maximum(ndtr(high) - ndtr(low), 1e-200))
    plain = -0.5 * ((lost.amplitude[:, None] - grid) / sd) ** 2 - np.log(sd)
    return np.where(stepped, inside, plain)


def _score(lost: Lost, of_hit: FloatArray, of_ray: FloatArray, margin: FloatArray) -> float:
    """The logarithm of the likelihood of every shot, each foretold by the others of its ray.

    Only by others that would show the surface without it, so that what is foretold does not choose who is asked.
    """
    seen, missed = log_ndtr(margin), log_ndtr(-margin)
    misses = (lost.fired - lost.hits).astype(np.float64)
    enough = 2 * lost.hits > lost.fired - 1
    of_misses = np.flatnonzero((misses > 0) & enough)
    others = of_ray[of_misses] + (misses[of_misses] - 1.0)[:, None] * missed
    total = float((misses[of_misses] * _foretold(others, missed)).sum())
    left = lost.hits[lost.ray] - 1
    asked = 2 * left > lost.fired[lost.ray] - 1
    rows = np.flatnonzero(asked)
    others = of_ray[lost.ray[rows]] - of_hit[rows] + misses[lost.ray[rows], None] * missed
    return total + float(_foretold(others, seen).sum())


def _foretold(others: FloatArray, of_shot: FloatArray) -> FloatArray:
    weight = np.exp(others - others.max(axis=1, keepdims=True))
    chance = (weight * np.exp(of_shot)).sum(axis=1) / weight.sum(axis=1)
    return np.asarray(np.log((1.0 - 2.0 * _LAPSE) * chance + _LAPSE))
