"""The gap between measured and simulated echoes, on frames that no fit has seen, by a distance that no fit used.

Per beam the features are compared as distributions: in each stratum (a material, an amplitude, a patch of the field
of view ...) the 1-Wasserstein distance of measured and simulated residuals, in the model's own standard deviations,
and the differences in how often surfaces are detected and other echoes appear. The gap is their mean over strata,
features and ways to stratify.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.explain.beams import Beams, beams_of
from lidarcheck.explain.covariates import RANGE_EDGES_M, divisions, fine_divisions
from lidarcheck.explain.explanation import Gap, Interval
from lidarcheck.explain.lab import Frame
from lidarcheck.explain.nuisances import Nuisance
from lidarcheck.explain.sights import FEATURES, Sights, sights_of
from lidarcheck.explain.summaries import Expected, expectation
from lidarcheck.model.chain import simulate
from lidarcheck.model.spec import Model

__all__ = ["Scale", "gap_of"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

PARTS = (*FEATURES, "detected", "other echoes")
_BASE_SEEDS = 6
_SEEDS = 4
_RESAMPLED = 16
_CLIP = 12.0
_STRATA = ("material", "amplitude", "layer", "point", "edge", "field of view")
_RATE_SPREAD = 0.05
"""One other echo in twenty beams weighs as much as a shift by a standard deviation."""


@dataclass(frozen=True)
class Scale:
    """The verify frames with all that measuring the gap takes: beams, what the case's model expects, the strata."""

    frames: tuple[Frame, ...]
    beams: Beams
    expected: Expected
    strata: tuple[IndexArray, ...]
    seed: int

    @classmethod
    def of(cls, frames: Sequence[Frame], model: Model, seed: int) -> Scale:
        """The scale of some frames, in the spreads of a model."""
        beams = beams_of([f.ideal for f in frames], model)
        runs = [_sights(frames, beams, model, seed, 9000 + k) for k in range(_BASE_SEEDS)]
        expected = expectation(beams, runs)
        log_area = np.where(expected.known, expected.mean[:, 1], np.nan)
        found = [*divisions(beams, log_area, {}), *fine_divisions(beams)]
        strata = tuple(d.bin for d in found if d.covariate in _STRATA)
        return cls(tuple(frames), beams, expected, strata, seed)

    def measured(self) -> Sights:
        """What was measured."""
        return sights_of(self.beams, [f.measured for f in self.frames])

    def simulated(self, model: Model, first: int, count: int, nuisance: Nuisance | None = None) -> list[Sights]:
        """What a model shows, with seeds of its own."""
        run = model if nuisance is None else nuisance.model(model)
        frames = self.frames
        if nuisance is not None and not nuisance.still:
            ideals = nuisance.ideals([f.ideal for f in frames], model)
            frames = tuple(Frame(f.number, i, f.measured, f.time_s) for f, i in zip(frames, ideals, strict=True))
        return [_sights(frames, self.beams, run, self.seed, first + k) for k in range(count)]

    def distance(self, one: Sights, others: Sequence[Sights], weight: FloatArray | None = None) -> FloatArray:
        """The parts of the gap in the order of `PARTS`, between one measurement and some simulations."""
        weight = np.ones(len(self.beams)) if weight is None else weight
        parts = np.zeros(len(PARTS))
        for stratum in self.strata:
            parts[:4] += self._shifts(stratum, one, others, weight)
            parts[4] += self._losses(stratum, one, others, weight)
            parts[5] += self._strays(stratum, one, others, weight)
        return np.asarray(parts / max(len(self.strata), 1))

    def _shifts(self, stratum: IndexArray, one: Sights, others: Sequence[Sights], weight: FloatArray) -> FloatArray:
        """Mean over strata of the 1-Wasserstein distances of the four features, in standard deviations."""
        known = self.expected.known & (stratum >= 0)
        mine = known & one.detected
        theirs = [known & other.detected for other in others]
        bins = int(stratum.max()) + 1
        share = np.bincount(stratum[mine], weight[mine], bins)
        found = np.zeros(4)
        for j in range(4):
            a = self._standard(one, mine, j)
            b = np.concatenate([self._standard(o, t, j) for o, t in zip(others, theirs, strict=True)])
            place = np.concatenate([stratum[t] for t in theirs])
            heft = np.concatenate([weight[t] for t in theirs])
            found[j] = (share * _wasserstein(a, stratum[mine], weight[mine], b, place, heft, bins)).sum()
        return np.asarray(found / max(share.sum(), 1e-9))

    def _standard(self, sights: Sights, rows: npt.NDArray[np.bool_], feature: int) -> FloatArray:
        off = (sights.feature[rows, feature] - self.expected.mean[rows, feature]) / self.expected.spread[rows, feature]
        return np.asarray(np.clip(off, -_CLIP, _CLIP))

    def _losses(self, stratum: IndexArray, one: Sights, others: Sequence[Sights], weight: FloatArray) -> float:
        """Mean difference of the detection probability, in its own standard deviations of a single beam."""
        hit = (self.beams.distance_m > 0.0) & (stratum >= 0)
        bins = int(stratum.max()) + 1
        count = np.bincount(stratum[hit], weight[hit], bins)
        safe = np.maximum(count, 1e-9)
        p = np.bincount(stratum[hit], (weight * one.detected)[hit], bins) / safe
        q = sum(np.bincount(stratum[hit], (weight * o.detected)[hit], bins) for o in others) / safe / len(others)
        spread = np.sqrt(np.maximum(q * (1.0 - q), 0.0025))
        return float((count * np.abs(p - q) / spread).sum() / max(count.sum(), 1e-9))

    def _strays(self, stratum: IndexArray, one: Sights, others: Sequence[Sights], weight: FloatArray) -> float:
        """Mean over strata of the differences in the rate of other echoes, summed over bins of their range."""
        used = stratum >= 0
        bins, cells = int(stratum.max()) + 1, len(RANGE_EDGES_M)
        count = np.bincount(stratum[used], weight[used], bins)

        def rates(sights: Sights) -> FloatArray:
            mine = used[sights.extra_beam]
            beam = sights.extra_beam[mine]
            cell = np.searchsorted(np.asarray(RANGE_EDGES_M), sights.extra_m[mine], side="right") - 1
            return np.bincount(stratum[beam] * cells + cell, weight[beam], bins * cells).astype(np.float64)

        difference = np.abs(rates(one) - sum(rates(o) for o in others) / len(others)).reshape(bins, cells)
        # A bin in which one echo in five beams is other has a spread of its own.
        return float(difference.sum() / max(count.sum(), 1e-9) / _RATE_SPREAD)


def _sights(frames: Sequence[Frame], beams: Beams, model: Model, seed: int, k: int) -> Sights:
    scans = [simulate(f.ideal, model, seed=(seed << 16) + k, frame=f.number, threads=1) for f in frames]
    return sights_of(beams, scans)


def _wasserstein(
    a: FloatArray, a_bin: IndexArray, a_weight: FloatArray, b: FloatArray, b_bin: IndexArray, b_weight: FloatArray,
    bins: int,
) -> FloatArray:  # fmt: skip
    """1-Wasserstein distance of weighted samples in each bin, (bins,): the area between distribution functions."""
    total_a, total_b = np.bincount(a_bin, a_weight, bins), np.bincount(b_bin, b_weight, bins)
    value, place = np.concatenate([a, b]), np.concatenate([a_bin, b_bin])
    step = np.concatenate([a_weight / np.maximum(total_a, 1e-9)[a_bin], -b_weight / np.maximum(total_b, 1e-9)[b_bin]])
    order = np.lexsort((value, place))
    value, place, step = value[order], place[order], step[order]
    gap = np.diff(value)
    same = place[1:] == place[:-1]
    # Within a bin the steps of both samples sum to 0, so one running sum serves all bins whose samples are both there.
    both = (total_a > 0.0) & (total_b > 0.0)
    step = np.where(both[place], step, 0.0)
    height = np.abs(np.cumsum(step)[:-1])
    return np.bincount(place[1:], np.where(same & both[place[1:]], height * gap, 0.0), bins).astype(np.float64)


Told = Callable[[int, int], object]


def gap_of(scale: Scale, stages: Sequence[tuple[str, Model]], told: Told | None = None) -> Gap:
    """The gap before, with each effect in turn, and after; `stages` begins with the case's model, ("", model).

    The floor is what two simulations of the last model are apart. Intervals are 5 % to 95 % quantiles over beams drawn
    anew with replacement.
    """
    measured = scale.measured()
    rng = np.random.default_rng(np.random.SeedSequence([scale.seed & 0xFFFFFFFF, 5]))
    # Whole columns are drawn: what shakes or moves in the sweep moves a column at once.
    column = np.unique(scale.beams.frame * 1024 + scale.beams.point, return_inverse=True)[1]
    weights = [
        rng.multinomial(column.max() + 1, np.full(column.max() + 1, 1.0 / (column.max() + 1)))[column].astype(float)
        for _ in range(_RESAMPLED)
    ]
    totals, parts = [], []
    for i, (_, model) in enumerate(stages):
        shown = scale.simulated(model, 9100, _SEEDS)
        found = scale.distance(measured, shown)
        totals.append(_interval(found.mean(), [scale.distance(measured, shown, w).mean() for w in weights]))
        parts.append(found)
        if told is not None:
            told(i + 1, len(stages) + 1)
    last = scale.simulated(stages[-1][1], 9100, _SEEDS)
    others = scale.simulated(stages[-1][1], 9200, 6)
    floors = np.array([scale.distance(other, last) for other in others])
    floor = _interval(float(floors.mean()), list(floors.mean(axis=1)), centred=True)
    by_feature = {
        name: (float(parts[0][j]), float(parts[-1][j]), float(floors[:, j].mean())) for j, name in enumerate(PARTS)
    }
    waterfall = tuple((name, total) for (name, _), total in zip(stages[1:], totals[1:], strict=True))
    return Gap(totals[0], totals[-1], floor, by_feature, waterfall)


def _interval(value: float, draws: Sequence[float], *, centred: bool = False) -> Interval:
    """The spread of the draws about the value; resampling itself adds noise, which only the spread may keep."""
    low, high = np.quantile(draws, [0.05, 0.95])
    middle = float(np.mean(draws)) if not centred else value
    return Interval(float(value), float(max(value + low - middle, 0.0)), float(value + high - middle))
