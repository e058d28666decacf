"""Some hundred summaries of what scans show: each a number that is about standard normal where nothing is missing.

A summary is a feature (was the surface detected, its echo's range, AREA, PEAK, WIDTH, their spreads, other echoes)
over a bin of a covariate. Measured and simulated scans go through the same sums, so that whatever biases them biases
both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.explain.beams import SIDES, Beams
from lidarcheck.explain.covariates import RANGE_EDGES_M, Division, binned, divisions, fine_divisions
from lidarcheck.explain.sights import FEATURES, Sights

__all__ = ["Expected", "Summaries", "Summary", "compressed", "expectation"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

_CLIP = 6.0
"""A residual counts at most so many standard deviations: single strays do not move a mean."""
_SPREAD_CLIP = 16.0
_LINEAR = 4.0
"""Up to about so many standard deviations a summary counts as it is, beyond by the logarithm of its size."""
_STRAY = 0.15
"""The part of the beams along an edge that a usual error of the pose leads to the other side."""
_GAP_EDGES_M = (-1000.0, -50.0, -20.0, -10.0, -5.0, -2.0, 2.0, 4.0, 7.0, 12.0, 20.0, 50.0)
_RATIO_EDGES = (1.2, 1.5, 1.8, 1.95, 2.05, 2.15, 2.4, 3.0)
_MATCH_OFFSETS = (1.0, 3.0, 6.0, 11.0, 21.0, 41.0, 81.0)
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


class Summary(NamedTuple):
    """What one summary is of: a feature, the covariate, the bin's name."""

    feature: str
    covariate: str
    bin: str


def compressed(z: FloatArray) -> FloatArray:
    """c asinh(z / c): near zero z itself, far off its logarithm, so that a form that is wrong by a fifth stays near."""
    return np.asarray(_LINEAR * np.arcsinh(z / _LINEAR))


@dataclass(frozen=True)
class Expected:
    """What the model shows: detection probability (n,), mean and spread of each feature (n, 4); known (n,).

    `partner`: pairs of neighbours on one surface, along the column and along the layer, whose differences show
    scatter whatever the mean does; `at_sky` (n,): beams beside which there is nothing; `square_mean`, `square_spread` (4,): of the scatter statistics.
    """

    probability: FloatArray
    mean: FloatArray
    spread: FloatArray
    known: npt.NDArray[np.bool_]
    square_mean: FloatArray
    square_spread: FloatArray
    at_sky: npt.NDArray[np.bool_]
    partner: tuple[tuple[IndexArray, IndexArray], tuple[IndexArray, IndexArray]]


class _Sums(NamedTuple):
    """Beams by bins as a sparse matrix of ones, and the bins' names."""

    matrix: object
    bins: tuple[tuple[str, str], ...]


class Summaries:
    """Turns the sights of frames into summaries, relative to what a model shows of the same frames."""

    def __init__(
        self, beams: Beams, base: Sequence[Sights], fresh: Sequence[Sights], materials: Mapping[int, str]
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
            self._means(value[:, _MEANS], weight[:, _MEANS], self._coarse, [_STATISTICS[j] for j in _MEANS]),
            self._means(value[:, 4:8], weight[:, 4:8], self._scattered, _STATISTICS[4:8]),
            self._means(value[:, [0, 1, 8]], weight[:, [0, 1, 8]], self._fine, ("range", "area", "detected")),
            self._posed(value[:, 0], weight[:, 0]),
            self._column_spreads(value, weight),
            self._extra_counts(sights),
            _extra_places(self.beams, sights),
        ]
        values = np.concatenate([part[0] for part in parts])
        return values, [name for part in parts for name in part[1]]

    def _means(
        self, value: FloatArray, weight: FloatArray, sums: _Sums, names: Sequence[str]
    ) -> tuple[FloatArray, list[Summary]]:
        total = sums.matrix @ value  # type: ignore[operator]
        noise = np.sqrt(np.maximum(sums.matrix @ weight, 1.0))  # type: ignore[operator]
        z = total / noise
        return z.T.ravel(), [Summary(name, *where) for name in names for where in sums.bins]

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

    def _column_spreads(self, value: FloatArray, weight: FloatArray) -> tuple[FloatArray, list[Summary]]:
        found, names = [], []
        for j, name in ((0, "range"), (1, "area"), (8, "detected")):
            total = np.bincount(self._columns, value[:, j])
            t = total / np.sqrt(np.bincount(self._columns, weight[:, j]) + 1.0)
            found.append(_unevenness(t))
            names.append(Summary(name, "from column to column", "spread"))
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
        names = [Summary(name, *where) for name in _EXTRAS for where in self._coarse.bins]
        return total.T.ravel(), names


def expectation(beams: Beams, base: Sequence[Sights]) -> Expected:
    seen = np.array([s.detected for s in base])
    values = np.array([s.feature for s in base])
    count = seen.sum(axis=0)
    known = count >= 2
    mean = np.where(known[:, None], values.sum(axis=0) / np.maximum(count, 1)[:, None], 0.0)
    off = np.where(seen[..., None] & known[None, :, None], values - mean, 0.0)
    free = np.maximum(count - 1, 1)[:, None]
    own = (off**2).sum(axis=0) / free
    spread = _smooth_spread(mean[:, 1], own, known, np.maximum(count - 1, 0))
    probability = np.where(beams.distance_m > 0.0, (count + 0.5) / (len(base) + 1.0), 0.0)
    partner = (_partners(beams, 0), _partners(beams, 1))
    square_mean, square_spread = _scatter(off / spread, seen & known[None, :], partner)
    at_sky = (beams.neighbour_m == 0.0).any(axis=1)
    return Expected(probability, mean, spread, known, square_mean, square_spread, at_sky, partner)


def _scatter(
    u: FloatArray,
    valid: npt.NDArray[np.bool_],
    partner: tuple[tuple[IndexArray, IndexArray], tuple[IndexArray, IndexArray]],
) -> tuple[FloatArray, FloatArray]:
    """Mean and spread of the scatter statistics under the model."""
    centre, width = np.empty(4), np.empty(4)
    u = np.clip(u, -_CLIP, _CLIP)
    for j, (feature, axis) in enumerate(((0, 0), (0, 1), (1, 0), (3, 0))):
        mine, other = partner[axis]
        both = valid[:, mine] & valid[:, other]
        square = np.minimum(0.5 * (u[:, mine, feature] - u[:, other, feature]) ** 2, _SPREAD_CLIP)[both]
        centre[j], width[j] = (square.mean(), square.std() + 1e-3) if len(square) else (1.0, 1.0)
    return centre, width


def _partners(beams: Beams, axis: int) -> tuple[IndexArray, IndexArray]:
    """Beams and their neighbours above (axis 0) or to the left (axis 1) on the same surface."""
    own, beside = beams.distance_m, beams.neighbour_m[:, 2 * axis]
    mine = np.flatnonzero((own > 0.0) & (beside > 0.0) & (np.abs(beside - own) < 0.06 * own))
    sort = np.lexsort((beams.layer, beams.point, beams.frame) if axis == 0 else (beams.point, beams.layer, beams.frame))
    following = np.empty(len(beams), dtype=np.int64)
    following[sort[:-1]] = sort[1:]
    following[sort[-1]] = sort[-1]
    return mine, following[mine]


_LEAST_SPREAD = (0.004, 0.01, 0.01, 0.3)
"""Ranges are reported in steps of 1 cm, widths in steps of 1 ns: a residual cannot be known better."""


def _smooth_spread(
    log_area: FloatArray, variance: FloatArray, known: npt.NDArray[np.bool_], free: IndexArray
) -> FloatArray:
    """Spread of each feature as a function of the amplitude, from beams alike; shape (n, 4)."""
    edges = np.quantile(log_area[known], np.linspace(0.0, 1.0, 41)[1:-1]) if known.any() else np.zeros(0)
    place = np.searchsorted(edges, log_area)
    weight = np.bincount(place[known], free[known], len(edges) + 1)
    spread = np.empty_like(variance)
    for j, least in enumerate(_LEAST_SPREAD):
        total = np.bincount(place[known], (variance[:, j] * free)[known], len(edges) + 1)
        spread[:, j] = np.sqrt(total / np.maximum(weight, 1.0) + least**2)[place]
    return spread


def _statistics(sights: Sights, expected: Expected) -> tuple[FloatArray, FloatArray]:
    """Per beam the statistics that are summed up, and the variance that each has by chance; shapes (n, 9)."""
    valid = sights.detected & expected.known
    u = np.clip((sights.feature - expected.mean) / expected.spread, -_CLIP, _CLIP)
    value = np.zeros((len(u), len(_STATISTICS)))
    weight = np.zeros_like(value)
    value[valid, :4] = u[valid]
    weight[valid, :4] = 1.0
    for j, (feature, partner) in enumerate(((0, 0), (0, 1), (1, 0), (3, 0)), start=4):
        mine, other = expected.partner[partner]
        both = valid[mine] & valid[other]
        square = np.minimum(0.5 * (u[mine, feature] - u[other, feature]) ** 2, _SPREAD_CLIP)
        value[mine, j] = np.where(both, (square - expected.square_mean[j - 4]) / expected.square_spread[j - 4], 0.0)
        weight[mine, j] = both
    # A beam that strayed onto its neighbour's surface, or may stray past its own into the sky, says nothing of losses.
    p, sure = expected.probability, ~sights.strayed & ~expected.at_sky
    value[:, 8] = np.where(sure, sights.detected - p, 0.0)
    weight[:, 8] = np.where(sure, p * (1.0 - p), 0.0)
    return value, weight


def _sums(found: Sequence[Division], n: int) -> _Sums:
    from scipy.sparse import csr_matrix

    rows, columns, bins = [], [], []
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
    return np.clip(weight / scale, -5.0, 5.0)


def _unevenness(t: FloatArray) -> float:
    """By how much standardised sums of lines spread more than by chance, in standard deviations of that."""
    return float((np.minimum(t**2, 25.0) - 1.0).sum() / np.sqrt(2.0 * len(t)))


def _extra_places(beams: Beams, sights: Sights) -> tuple[FloatArray, list[Summary]]:
    """Where the other echoes lie: in range, behind their surface, at a neighbour's or a bright target's range."""
    lone = sights.extra_side < 0
    beam, range_m = sights.extra_beam[lone], sights.extra_m[lone]
    own = beams.distance_m[beam]
    gap = np.where(own > 0.0, range_m - own, np.nan)
    retro = np.where(beams.retro[beam], range_m / np.maximum(own, 1e-9), np.nan)
    strong = (beams.signal[beam] >= 3.0) & ~beams.retro[beam]
    ratio = np.where(strong, range_m / np.maximum(own, 1e-9), np.nan)
    parts = [
        _histogram("range", range_m, RANGE_EDGES_M, "m"),
        _histogram("behind their surface", gap, _GAP_EDGES_M, "m"),
        _histogram("over their retro-reflector's range", retro, _RATIO_EDGES, "times"),
        _histogram("over their surface's range", ratio, _RATIO_EDGES, "times"),
        _beside(beams, sights),
        *(_at_bright(beams, sights, side) for side in range(4)),
        _strengths(sights),
    ]
    return np.concatenate([p[0] for p in parts]), [name for p in parts for name in p[1]]


def _histogram(
    covariate: str, value: FloatArray, edges: Sequence[float], unit: str
) -> tuple[FloatArray, list[Summary]]:
    place = np.searchsorted(np.asarray(edges), value[~np.isnan(value)], side="right") - 1
    counts = np.bincount(place[place >= 0], minlength=len(edges)).astype(np.float64)
    ends = [*edges[1:], np.inf]
    names = [f"{a:g}-{b:g} {unit}" for a, b in zip(edges, ends, strict=True)]
    return counts, [Summary("other echoes", covariate, name) for name in names]


def _beside(beams: Beams, sights: Sights) -> tuple[FloatArray, list[Summary]]:
    """Echoes at the range of what a neighbouring beam meets: besides the own surface's echo, or in its place.

    In its place they come from a pose that is off by a part of a beam, all along an edge at once: such counts are
    measured by the number of beams along such edges.
    """
    found = sights.extra_side >= 0
    beam, side = sights.extra_beam[found], sights.extra_side[found]
    lost = ~sights.detected[beam]
    nearer = sights.extra_m[found] < beams.distance_m[beam]
    own, beside = beams.distance_m[:, None], beams.neighbour_m
    differs = (beside > 0.0) & (np.abs(own - beside) > 1.0 + 0.03 * np.maximum(own, beside))
    counts, names = [], []
    for i, name in enumerate(SIDES):
        for where, text in ((nearer, "nearer"), (~nearer, "farther")):
            mine = where & (side == i)
            counts.append(float((mine & ~lost).sum()))
            names.append(Summary("other echoes", "at a neighbour's range", f"{name}, {text}, besides its own"))
            edge = differs[:, i] & ((beside[:, i] < beams.distance_m) == (text == "nearer"))
            counts.append(float((mine & lost).sum()) / np.sqrt(1.0 + (_STRAY * edge.sum()) ** 2))
            names.append(Summary("other echoes", "at a neighbour's range", f"{name}, {text}, for its own"))
    return np.array(counts), names


def _at_bright(beams: Beams, sights: Sights, side: int) -> tuple[FloatArray, list[Summary]]:
    """Echoes at the range of the next bright target along the column or the layer, by how far it lies."""
    beam = sights.extra_beam
    match = (beams.bright[beam, side] > 0) & (np.abs(sights.extra_m - beams.bright_m[beam, side]) < 2.5)
    match &= (sights.extra_side < 0) | sights.detected[beam]
    offset = np.where(match, beams.bright[beam, side], np.nan)
    return _histogram(f"at a bright target's range {SIDES[side]}", offset, _MATCH_OFFSETS, "beams off")


def _strengths(sights: Sights) -> tuple[FloatArray, list[Summary]]:
    """How strong the other echoes are, over range; a mean that counts as much as the number behind it."""
    lone = sights.extra_side < 0
    place = np.searchsorted(np.asarray(RANGE_EDGES_M), sights.extra_m[lone], side="right") - 1
    n = len(RANGE_EDGES_M)
    count = np.bincount(place, minlength=n)
    z = np.bincount(place, (sights.extra_area[lone] - 4.8) / 0.6, n) / np.sqrt(np.maximum(count, 1))
    return z, [Summary("strength of other echoes", "range", binned_name(i)) for i in range(n)]


def binned_name(i: int) -> str:
    """The name of a range bin."""
    ends = (*RANGE_EDGES_M[1:], np.inf)
    return f"{RANGE_EDGES_M[i]:g}-{ends[i]:g} m"
