"""Some hundred summaries of what scans show: each a number that is about standard normal where nothing is missing.

A summary is a feature (was the surface detected, its echo's range, AREA, PEAK, WIDTH, their spreads, other echoes)
over a bin of a covariate. Measured and simulated scans go through the same sums, so that whatever biases them biases
both.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.explain.beams import Beams
from lidarcheck.explain.covariates import Division, divisions, fine_divisions
from lidarcheck.explain.expected import CLIP, SCATTERS, SPREAD_CLIP, Expected, expectation
from lidarcheck.explain.sights import FEATURES, Sights
from lidarcheck.explain.strays import stray_summaries
from lidarcheck.explain.summary import Summary

__all__ = ["Expected", "Summaries", "Summary", "compressed", "expectation"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

_LINEAR = 4.0
"""Up to about so many standard deviations a summary counts as it is, beyond by the logarithm of its size."""
_STATISTICS = (
    *FEATURES,
    "range scatter along columns",
    "range scatter along layers",
    "area scatter",
    "width scatter",
    "detected",
)
_MEANS = (0, 1, 2, 3, 8)
_SCATTER_OVER = ("all", "range", "amplitude", "material", "point", "frame", "edge")
"""Covariates over which scatter is looked at; the means go over all."""
_EXTRAS = ("echoes in front", "echoes behind", "echoes without a surface")


def compressed(z: FloatArray) -> FloatArray:
    """c asinh(z / c): near zero z itself, far off its logarithm, so that a form that is wrong by a fifth stays near."""
    return np.asarray(_LINEAR * np.arcsinh(z / _LINEAR))


class _Sums(NamedTuple):
    """Beams by bins as a sparse matrix of ones, and the bins' names."""

    matrix: object
    bins: tuple[tuple[str, str], ...]


class Summaries:
    """Turns the sights of frames into summaries, relative to what a model shows of the same frames."""

    def __init__(
        self, beams: Beams, base: Sequence[Sights], fresh: Iterable[Sights], materials: Mapping[int, str]
    ) -> None:
        """`base`: what the model shows with some seeds, of which each beam's expectation is taken; `fresh`: with
        others, of which the summaries' own means and spreads are taken."""
        self.beams = beams
        self.expected = expectation(beams, base)
        log_area = np.where(self.expected.known, self.expected.mean[:, 1], np.nan)
        coarse = divisions(beams, log_area, materials)
        self._coarse = _sums(coarse, len(beams))
        self._scattered = _sums([d for d in coarse if d.covariate in _SCATTER_OVER], len(beams))
        self._fine = _sums(fine_divisions(beams), len(beams))
        self._columns = _lines(beams)
        self._pose = _pose_weights(beams, self.expected)
        self._named = [
            _named([_STATISTICS[j] for j in _MEANS], self._coarse),
            _named(_STATISTICS[4:8], self._scattered),
            _named(("range", "area", "detected"), self._fine),
            _named(_EXTRAS, self._coarse),
        ]
        self._strips = next(d for d in coarse if d.covariate == "point")
        raw = [self._sum(sights) for sights in fresh]
        self.names = raw[0][1]
        values = np.array([z for z, _ in raw])
        self._centre = values.mean(axis=0)
        counted = np.array([name.feature in (*_EXTRAS, "other echoes") for name in self.names])
        # Counts of rare echoes are Poisson; one more than expected is no surprise where none was seen.
        least = np.where(counted, np.sqrt(np.maximum(self._centre, 0.0) + 1.0), 1.0)
        self._scale = np.maximum(least, values.std(axis=0))
        self.fresh = np.array([compressed((z - self._centre) / self._scale) for z in values])

    def __len__(self) -> int:
        return len(self.names)

    def plain(self, sights: Sights) -> FloatArray:
        """The summaries in standard deviations from the model's mean, shape (n_summaries,)."""
        return np.asarray((self._sum(sights)[0] - self._centre) / self._scale)

    def of(self, sights: Sights) -> FloatArray:
        """The compressed summaries, shape (n_summaries,)."""
        return compressed(self.plain(sights))

    def _sum(self, sights: Sights) -> tuple[FloatArray, list[Summary]]:
        value, weight = _statistics(sights, self.expected)
        parts = [
            (_means(value[:, _MEANS], weight[:, _MEANS], self._coarse), self._named[0]),
            (_means(value[:, 4:8], weight[:, 4:8], self._scattered), self._named[1]),
            (_means(value[:, [0, 1, 8]], weight[:, [0, 1, 8]], self._fine), self._named[2]),
            self._posed(value[:, 0], weight[:, 0]),
            self._column_spreads(sights, value, weight),
            self._extra_counts(sights),
            stray_summaries(self.beams, sights),
        ]
        values = np.concatenate([part[0] for part in parts])
        return values, [name for part in parts for name in part[1]]

    def _posed(self, value: FloatArray, weight: FloatArray) -> tuple[FloatArray, list[Summary]]:
        """Range residuals along the slope of the surfaces: where the beams look beside where they should."""
        found, names = [], []
        for axis, name in enumerate(("elevation", "azimuth")):
            w = self._pose[:, axis]
            part, square = value * w, weight * w * w
            for bins, label, texts in (
                (self._strips.bin, "point", self._strips.names),
                (self.beams.frame, "frame", tuple(str(i) for i in range(int(self.beams.frame.max()) + 1))),
            ):
                total = np.bincount(bins, part, len(texts)) / np.sqrt(np.bincount(bins, square, len(texts)) + 1e-3)
                found.append(total)
                names += [Summary(f"range along {name}", label, text) for text in texts]
            column = self._columns
            t = np.bincount(column, part) / np.sqrt(np.bincount(column, square) + 1e-3)
            found.append(np.array([_unevenness(t)]))
            names.append(Summary(f"range along {name}", "from column to column", "spread"))
        return np.concatenate(found), names

    def _column_spreads(
        self, sights: Sights, value: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, list[Summary]]:
        found, names = [], []
        for j, name in ((0, "range"), (1, "area"), (8, "detected")):
            total = np.bincount(self._columns, value[:, j])
            t = total / np.sqrt(np.bincount(self._columns, weight[:, j]) + 1.0)
            found.append(_unevenness(t))
            names.append(Summary(name, "from column to column", "spread"))
        lone = sights.extra_side < 0
        count = np.bincount(self._columns[sights.extra_beam[lone]], minlength=int(self._columns.max()) + 1)
        found.append(float((count**2 - count).sum() / np.sqrt(len(count) + count.sum() ** 2 / len(count))))
        names.append(Summary("other echoes", "from column to column", "spread"))
        return np.array(found), names

    def _extra_counts(self, sights: Sights) -> tuple[FloatArray, list[Summary]]:
        """Numbers of other echoes in front of, behind and without a surface, by the beam's covariates."""
        counts = np.zeros((len(self.beams), len(_EXTRAS)))
        lone = sights.extra_side < 0
        beam, range_m = sights.extra_beam[lone], sights.extra_m[lone]
        distance = self.beams.distance_m[beam]
        kind = np.where(distance == 0.0, 2, np.where(range_m < distance, 0, 1))
        np.add.at(counts, (beam, kind), 1.0)
        total = self._coarse.matrix @ counts  # type: ignore[operator]
        return total.T.ravel(), self._named[3]


def _named(features: Sequence[str], sums: _Sums) -> list[Summary]:
    """The summaries of some features over all bins."""
    return [Summary(feature, *where) for feature in features for where in sums.bins]


def _means(value: FloatArray, weight: FloatArray, sums: _Sums) -> FloatArray:
    """Standardised sums over the bins of values with variances `weight`, shapes (n, features); feature by feature."""
    total = sums.matrix @ value  # type: ignore[operator]
    noise = np.sqrt(np.maximum(sums.matrix @ weight, 1.0))  # type: ignore[operator]
    return np.asarray((total / noise).T.ravel())


def _statistics(sights: Sights, expected: Expected) -> tuple[FloatArray, FloatArray]:
    """Per beam the statistics that are summed up, and the variance that each has by chance; shapes (n, 9)."""
    valid = sights.detected & expected.known
    u = np.clip((sights.feature - expected.mean) / expected.spread, -CLIP, CLIP)
    value = np.zeros((len(u), len(_STATISTICS)))
    weight = np.zeros_like(value)
    value[valid, :4] = u[valid]
    weight[valid, :4] = 1.0
    for j, (feature, partner) in enumerate(SCATTERS, start=4):
        mine, other = expected.partner[partner]
        both = valid[mine] & valid[other]
        square = np.minimum(0.5 * (u[mine, feature] - u[other, feature]) ** 2, SPREAD_CLIP)
        value[mine, j] = np.where(both, (square - expected.square_mean[j - 4]) / expected.square_spread[j - 4], 0.0)
        weight[mine, j] = both
    # A beam beside an edge may stray onto another surface, or past its own; what it loses says little of losses.
    p, sure = expected.probability, ~expected.at_edge
    value[:, 8] = np.where(sure, sights.detected - p, 0.0)
    weight[:, 8] = np.where(sure, p * (1.0 - p), 0.0)
    return value, weight


def _sums(found: Sequence[Division], n: int) -> _Sums:
    from scipy.sparse import csr_matrix

    rows: list[IndexArray] = []
    columns: list[IndexArray] = []
    bins: list[tuple[str, str]] = []
    for division in found:
        used = np.flatnonzero(division.bin >= 0)
        rows.append(division.bin[used] + len(bins))
        columns.append(used)
        bins += [(division.covariate, name) for name in division.names]
    r, c = np.concatenate(rows), np.concatenate(columns)
    return _Sums(csr_matrix((np.ones(len(r)), (r, c)), shape=(len(bins), n)), tuple(bins))


def _lines(beams: Beams) -> IndexArray:
    """The (frame, point) column of each beam: what is swept at one moment."""
    _, column = np.unique(beams.frame * 1024 + beams.point, return_inverse=True)
    return np.asarray(column, dtype=np.int64)


def _pose_weights(beams: Beams, expected: Expected) -> FloatArray:
    """Change of the range with the two angles in units of its spread, of order one; shape (n, 2)."""
    weight = beams.slope_m_per_deg / expected.spread[:, :1]
    scale = np.sqrt((weight**2).mean(axis=0)) + 1e-9
    return np.asarray(np.clip(weight / scale, -5.0, 5.0))


def _unevenness(t: FloatArray) -> float:
    """By how much standardised sums of lines spread more than by chance, in standard deviations of that."""
    return float((np.minimum(t**2, 25.0) - 1.0).sum() / np.sqrt(2.0 * len(t)))
