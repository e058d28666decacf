"""Distances between two samples of one feature: how far apart two distributions lie.

All take the measured and the simulated sample, of any two sizes, compare the step functions of their empirical
distributions F and G (nothing is interpolated) and are symmetric. A distance with an empty sample on either side is
NaN, "nothing was compared", also when both are empty: a comparison of nothing must not look like a perfect one. Equal
samples give 0, also constant ones and single values.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError

__all__ = ["Steps", "energy", "js", "ks", "ordered", "shared_edges", "steps", "wasserstein"]

MOST_BINS = 100
TAIL = 0.001


class Steps(NamedTuple):
    """Two empirical distribution functions on the values where either steps; shapes (k,)."""

    value: FloatArray
    measured: FloatArray
    simulated: FloatArray


def ordered(values: npt.ArrayLike) -> FloatArray:
    """The sample in ascending order, shape (n,), without a copy when it already is.

    `UsageError`: not one column, or a value that is not finite.
    """
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 1:
        raise UsageError(f"a sample has shape {sample.shape}", fix="give one column of numbers")
    if np.any(~(sample[1:] >= sample[:-1])):
        sample = np.sort(sample)
    # NaN sorts last and the infinities to the ends, so that the ends tell.
    if sample.size and not (np.isfinite(sample[0]) and np.isfinite(sample[-1])):
        raise UsageError("a sample holds a value that is not finite", fix="leave out NaN and infinite values")
    return sample


def steps(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> Steps:
    """F and G of two samples that are not empty, at every value that occurs in either."""
    m, s = ordered(measured), ordered(simulated)
    pooled = _pooled(m, s)
    last_of_run = np.append(pooled[1:] != pooled[:-1], True)
    value = pooled[last_of_run]
    return Steps(value, np.searchsorted(m, value, "right") / m.size, np.searchsorted(s, value, "right") / s.size)


def wasserstein(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> float:
    """1-Wasserstein distance ∫|F − G| dx, in the feature's unit.

    The area validation metric (AVM) of Oberkampf and Roy is the same number. Samples of shapes (n,) and (m,).
    """
    if not _both(measured, simulated):
        return float("nan")
    at = steps(measured, simulated)
    return float((np.abs(at.measured - at.simulated)[:-1] * np.diff(at.value)).sum())


def ks(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> float:
    """Two-sample Kolmogorov–Smirnov statistic max |F − G|, 0 … 1. Samples of shapes (n,) and (m,)."""
    if not _both(measured, simulated):
        return float("nan")
    at = steps(measured, simulated)
    return float(np.max(np.abs(at.measured - at.simulated)))


def energy(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> float:
    """Energy distance √(2 ∫(F − G)² dx), in the square root of the feature's unit.

    The definition of `scipy.stats.energy_distance`: √(2 E|X − Y| − E|X − X'| − E|Y − Y'|) (Székely and Rizzo 2013);
    some texts leave out the root. Samples of shapes (n,) and (m,).
    """
    if not _both(measured, simulated):
        return float("nan")
    at = steps(measured, simulated)
    return float(np.sqrt(2.0 * (((at.measured - at.simulated) ** 2)[:-1] * np.diff(at.value)).sum()))


def js(measured: npt.ArrayLike, simulated: npt.ArrayLike, *, edges: npt.ArrayLike | None = None) -> float:
    """Jensen–Shannon divergence [bits], 0 … 1, on bins that both samples share.

    `edges`: the ascending borders between the bins, shape (k,), for k + 1 bins of which the two outer ones are open,
    so that no value falls outside; a value on a border belongs to the bin above. Default: `shared_edges`. This is the
    divergence; the square of `scipy.spatial.distance.jensenshannon(…, base=2)`. Samples of shapes (n,) and (m,).
    """
    if not _both(measured, simulated):
        return float("nan")
    m, s = ordered(measured), ordered(simulated)
    borders = shared_edges(m, s) if edges is None else ordered(edges)
    p, q = _shares(m, borders), _shares(s, borders)
    divergence = _entropy_bits(0.5 * (p + q)) - 0.5 * (_entropy_bits(p) + _entropy_bits(q))
    return float(min(max(divergence, 0.0), 1.0))


def shared_edges(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> FloatArray:
    """Borders between the default bins of `js`, shape (k,), from the pooled sample, both not empty.

    With n the size of the smaller sample there are at most 2·n^⅓ bins (Rice's rule), no fewer than 2 and no more than
    100: more would make two samples of one distribution look apart. Few distinct values get a bin each. Else the bins
    are equally wide over the central 99.8 % of the pooled sample, a whole number wide and centred on whole numbers
    where all values are whole; the outer bins hold the tails.
    """
    m, s = ordered(measured), ordered(simulated)
    most = int(np.clip(2.0 * elementary.power(min(m.size, s.size), 1.0 / 3.0), 2, MOST_BINS))
    pooled = _pooled(m, s)
    distinct = pooled[np.append(True, pooled[1:] != pooled[:-1])]
    if distinct.size <= most:
        return np.asarray(0.5 * (distinct[1:] + distinct[:-1]), dtype=np.float64)
    low, high = (float(x) for x in np.quantile(pooled, [TAIL, 1.0 - TAIL], method="nearest"))
    if high == low:
        # Nearly everything is one value: it gets the middle bin.
        below, above = distinct[distinct < low], distinct[distinct > high]
        borders = [0.5 * (near + low) for near in (*below[-1:], *above[:1])]
        return np.array(borders)
    if np.all(distinct == np.rint(distinct)):
        width = float(np.ceil((high - low + 1.0) / most))
        return np.arange(low - 0.5, high + 0.5 + width, width, dtype=np.float64)
    width = (high - low) / most
    # Off the data by an odd part of a bin: a border on a value that rounding moves would split equal values.
    return np.asarray(low + width * (np.arange(most + 2) - 0.381966), dtype=np.float64)


def _both(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> bool:
    return np.size(measured) > 0 and np.size(simulated) > 0


def _pooled(m: FloatArray, s: FloatArray) -> FloatArray:
    # Two ascending runs: the stable sort merges them in linear time.
    return np.sort(np.concatenate([m, s]), kind="stable")


def _shares(sample: FloatArray, borders: FloatArray) -> FloatArray:
    """Share of an ascending sample in each bin, shape (k + 1,)."""
    upto = np.concatenate([[0], np.searchsorted(sample, borders, "left"), [sample.size]])
    return np.diff(upto) / sample.size


def _entropy_bits(p: FloatArray) -> float:
    some = p[p > 0.0]
    return float(-(some * elementary.log2(some)).sum())
