"""KPIs of all exchanges at once, from what the units hold: shapes (n_draws,), the observed one first.

A unit's rows weigh (mean of both sides' counts)/(own side's count), so that a unit carries the same weight whichever
side it is on, and lost echoes do not hide a feature that moved. F and G, the two sides' distribution functions, then
always add up to the same, and F - G is a sum over the units with the exchange's signs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray

__all__ = [
    "Mixed",
    "blooming_draws",
    "difference_draws",
    "means_apart",
    "mixed",
    "moments_draws",
    "ratio_draws",
    "scatter_draws",
    "scatters_apart",
]

_NO_MASS = 1e-12
"""Of a bin that a side has nothing in, rounding leaves less."""
_NO_SCATTER = 1e-12
"""A variance so small beside the mean square is what rounding leaves of none."""


@dataclass(frozen=True)
class Mixed:
    """Two sides' distributions in every exchange: `value` (k,), where the bins lie; `pooled` (k,), F + G; `apart`
    (n_draws, k), F - G."""

    value: FloatArray
    pooled: FloatArray
    apart: FloatArray

    def side(self, sign: float) -> FloatArray:
        """F (1) or G (-1) in every exchange, shape (n_draws, k)."""
        return 0.5 * (self.pooled + sign * self.apart)

    def quantiles(self, sign: float, level: float) -> FloatArray:
        """The lowest value at which F (1) or G (-1) reaches the level, shape (n_draws,)."""
        # Rounding must not put the level behind a step that just reaches it.
        return np.asarray(self.value[np.argmax(self.side(sign) >= level - 1e-12, axis=1)])

    def medians_apart(self) -> FloatArray:
        """Median of measured minus median of simulated."""
        return self.quantiles(1.0, 0.5) - self.quantiles(-1.0, 0.5)

    def percentiles_apart(self, shares: Sequence[float]) -> list[FloatArray]:
        """For each share where the mid-distribution function of measured reaches it, minus that of simulated."""
        with np.errstate(over="ignore", invalid="ignore"):  # values may be as large as numbers can be
            m, s = (self._middles(sign, shares) for sign in (1.0, -1.0))
            return [one - other for one, other in zip(m, s, strict=True)]

    def _middles(self, sign: float, shares: Sequence[float]) -> list[FloatArray]:
        function = self.side(sign)
        mass = np.diff(function, axis=1, prepend=0.0)
        middle, own = function - 0.5 * mass, mass > _NO_MASS
        draw, last, found = np.arange(len(own)), own.shape[1] - 1, []
        for share in shares:
            reached, short = own & (middle >= share), own & (middle < share)
            above, below = np.argmax(reached, axis=1), last - np.argmax(short[:, ::-1], axis=1)
            # Beyond the middles of the outermost values nothing lies between.
            any_above, any_below = reached[draw, above], short[draw, below]
            above, below = np.where(any_above, above, below), np.where(any_below, below, above)
            low, high = middle[draw, below], middle[draw, above]
            part = np.where(high > low, (share - low) / np.where(high > low, high - low, 1.0), 0.0)
            found.append(self.value[below] + part * (self.value[above] - self.value[below]))
        return found

    def distances(self, js_edges: FloatArray) -> dict[str, FloatArray]:
        """The KPIs of one feature, by name; `js_edges`: the borders between the bins of `js`."""
        step, apart = np.diff(self.value), self.apart[:, :-1]
        with np.errstate(over="ignore", invalid="ignore"):  # values may be as large as numbers can be
            return {
                "dvm_bias": -(apart @ step),
                "dvm_scatter": scatter_draws(self),
                "wasserstein": np.abs(apart) @ step,
                "ks": np.abs(self.apart).max(axis=1),
                "energy": np.sqrt(2.0 * (apart**2 @ step)),
                "js": self._js(js_edges),
            }

    def _js(self, edges: FloatArray) -> FloatArray:
        upto = np.asarray(np.searchsorted(self.value, edges, "left"), dtype=np.int64)
        p, q = (self._shares(sign, upto) for sign in (1.0, -1.0))
        return np.clip(_entropy_bits(0.5 * (p + q)) - 0.5 * (_entropy_bits(p) + _entropy_bits(q)), 0.0, 1.0)

    def _shares(self, sign: float, upto: IndexArray) -> FloatArray:
        function = self.side(sign)
        n = len(function)
        at = np.concatenate([np.zeros((n, 1)), function], axis=1)[:, upto]
        return np.diff(np.concatenate([np.zeros((n, 1)), at, np.ones((n, 1))], axis=1), axis=1)


def _entropy_bits(p: FloatArray) -> FloatArray:
    some = np.maximum(p, 0.0)
    return np.asarray(-np.sum(some * elementary.log2(np.where(some > 0.0, some, 1.0)), axis=1))


def mixed(value: FloatArray, counts: FloatArray, signs: FloatArray) -> Mixed | None:
    """The distributions of all exchanges; `counts` (2, units, k). None where no unit has rows on both sides."""
    weight, share = _weights(counts.sum(axis=2))
    if not weight.any():
        return None
    function = np.cumsum(counts * (share * weight)[:, :, None], axis=2) / weight.sum()
    return Mixed(value, function.sum(axis=(0, 1)), signs @ (function[0] - function[1]))


def _weights(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A unit's weight (units,), 0 where a side has no row, and each side's per row of it (2, units)."""
    both = (rows > 0.0).all(axis=0)
    return np.where(both, rows.mean(axis=0), 0.0), 1.0 / np.maximum(rows, 1.0)


def scatter_draws(two: Mixed) -> FloatArray:
    """`dvm_scatter`: the area between F and G once each is moved to its own mean."""
    sides = [np.diff(two.side(sign), axis=1, prepend=0.0) for sign in (1.0, -1.0)]
    found = np.empty(len(two.apart))
    for i, (f, g) in enumerate(zip(*sides, strict=True)):
        place = np.concatenate([two.value - f @ two.value, two.value - g @ two.value])
        # Two ascending runs: the stable sort merges them in linear time.
        order = np.argsort(place, kind="stable")
        apart = np.cumsum(np.concatenate([f, -g])[order])
        found[i] = np.abs(apart[:-1]) @ np.diff(place[order])
    return found


def difference_draws(hits: FloatArray, trials: FloatArray | None, signs: FloatArray) -> FloatArray:
    """Measured minus simulated count, or share where `trials` are given; both (2, units). Counts are not weighted."""
    if trials is None:
        return np.asarray(signs @ (hits[0] - hits[1]))
    m, s = _both_sides(hits, signs)
    of_m, of_s = _both_sides(trials, signs)
    return _ratio(m, of_m) - _ratio(s, of_s)


def _both_sides(sums: FloatArray, signs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sums (2, units, ...) of each side in every exchange, (n_draws, ...)."""
    kept, given = 0.5 * (1.0 + signs), 0.5 * (1.0 - signs)
    own, other = (np.tensordot(kept, side, axes=1) for side in sums)
    from_own, from_other = (np.tensordot(given, side, axes=1) for side in sums)
    return own + from_other, other + from_own


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    some = below > 0.0
    return np.where(some, above / np.where(some, below, 1.0), np.nan)


def ratio_draws(above: FloatArray, below: FloatArray, signs: FloatArray) -> FloatArray:
    """Difference of the ratios of two means; each (2, units, 2): number of rows, and their sum."""
    (m, s), (of_m, of_s) = (_means(side, signs) for side in (above, below))
    return _ratio(m, of_m) - _ratio(s, of_s)


def _means(sums: FloatArray, signs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weighted means of both sides in every exchange; `sums` (2, units, 1 + k): rows, then sums; (n_draws[, k])."""
    weight, share = _weights(sums[:, :, 0])
    with np.errstate(invalid="ignore"):
        mean = np.squeeze(sums[:, :, 1:] * (share * weight)[:, :, None] / weight.sum(), axis=2)
    return _both_sides(mean, signs)


def means_apart(sums: FloatArray, signs: FloatArray) -> FloatArray:
    """Difference of the means; (2, units, 2): number of rows, and their sum."""
    m, s = _means(sums, signs)
    return m - s


def scatters_apart(sums: FloatArray, signs: FloatArray) -> FloatArray:
    """Difference of the standard deviations; (2, units, 3): number of rows, their sum, and that of their squares."""
    means, squares = _means(sums[:, :, :2], signs), _means(sums[:, :, [0, 2]], signs)
    variances = [square - mean**2 for square, mean in zip(squares, means, strict=True)]
    m, s = (np.sqrt(np.where(v > _NO_SCATTER * q, v, 0.0 * q)) for v, q in zip(variances, squares, strict=True))
    return np.asarray(m - s)


def moments_draws(ghost: FloatArray, target: FloatArray, signs: FloatArray) -> FloatArray:
    """Difference of the ratios of RMS distances from the own centroid; (2, units, 5): rows, sums of x, y, z and r²."""
    sizes = []
    for sums in (ghost, target):
        weight, share = _weights(sums[:, :, 0])
        with np.errstate(invalid="ignore"):
            scaled = sums[:, :, 1:] * (share * weight)[:, :, None] / weight.sum()
        sizes.append(
            [np.sqrt(np.maximum(s[:, 3] - (s[:, :3] ** 2).sum(axis=1), 0.0)) for s in _both_sides(scaled, signs)]
        )
    (m, s), (of_m, of_s) = sizes
    return _ratio(m, of_m) - _ratio(s, of_s)


def blooming_draws(sums: FloatArray, signs: FloatArray) -> FloatArray:
    """RMS of log10(measured/simulated) mean AREA over the offsets; (2, units, offsets, 2): rows, and their AREA."""
    weight, share = _weights(sums[..., 0].sum(axis=2))
    (m, s) = _both_sides(sums * (share * weight)[:, :, None, None], signs)
    m_mean, s_mean = (_ratio(side[..., 1], side[..., 0]) for side in (m, s))
    both = (m_mean > 0.0) & (s_mean > 0.0)
    log = elementary.log10(np.where(both, m_mean, 1.0) / np.where(both, s_mean, 1.0))
    return np.sqrt(_ratio((log**2).sum(axis=1), both.sum(axis=1).astype(np.float64)))
