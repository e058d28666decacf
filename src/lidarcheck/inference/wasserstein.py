"""The gap between measured and simulated echoes, on frames that no fit has seen, by a distance that no fit used.

Per beam the features are compared as distributions: in each stratum (a material, an amplitude, a patch of the field
of view ...) the 1-Wasserstein distance of measured and simulated residuals, in the model's own standard deviations,
and the differences in how often surfaces are detected and other echoes appear. The gap is their mean over strata,
features and ways to stratify.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.cases.frame import Frame
from lidarcheck.inference.intervals import ENDS, Gap, Interval
from lidarcheck.inference.kind_distances import apart_by_kind, named_by_kind, unlike_echoes
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.observed.beam_table import BeamTable, beams_of
from lidarcheck.inference.observed.coarse import amplitude_tells
from lidarcheck.inference.observed.kernels import areas_between
from lidarcheck.inference.observed.observations import FEATURES, Observations, observations_of
from lidarcheck.inference.observed.strata import RANGE_EDGES_M, divisions, fine_divisions, range_bin
from lidarcheck.inference.observed.summaries import Expected, expectation
from lidarcheck.inference.simulations import observed
from lidarcheck.inference.usual_ranges import height_errors_m
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces
from lidarcheck.workers import Shared, WorkerPool
from lidarcheck.workers.threads import mapped

__all__ = [
    "EXPECTATION_SEEDS", "FIRST_EXPECTATION", "FIRST_GAP", "FIRST_GAP_FLOOR", "GAP_FLOORS", "GAP_SEEDS", "PARTS",
    "Scale", "by_chance", "excesses", "gap_of", "left_by",
]  # fmt: skip


PARTS = (*FEATURES, "detected", "other echoes")
EXPECTATION_SEEDS = 6
"""Simulations of which each beam's expectation is the mean."""
GAP_SEEDS, GAP_FLOORS = 4, 6
"""Simulations that stand for a model, and those that tell how far its own are apart."""
FIRST_EXPECTATION, FIRST_GAP, FIRST_GAP_FLOOR, _FIRST_EXCESS, _FIRST_EXCESS_FLOOR = 9000, 9100, 9200, 9300, 9400
"""Where the seeds of each begin: no fit uses any of them, and no two share one."""
_RESAMPLED = 16
"""Draws of all beams anew, of which an interval's ends are quantiles."""
_CLIP = 12.0
"""A residual counts at most so many standard deviations: a single false echo moves no mean."""
_STRATA = ("material", "amplitude", "layer", "point", "edge", "field of view")
_RATE_SPREAD = 0.05
"""One other echo in twenty beams weighs as much as a shift by a standard deviation."""


@dataclass(frozen=True)
class Scale:
    """Some frames with all that measuring the gap takes: beams, what the case's model expects, the strata."""

    frames: tuple[Frame, ...]
    beams: BeamTable
    expected: Expected
    strata: tuple[IndexArray, ...]
    seed: int
    surfaces: tuple[Surfaces, ...]
    features: tuple[int, ...] = (0, 1, 2, 3)
    """Those of `FEATURES` that are compared."""

    @classmethod
    def of(cls, frames: Sequence[Frame], model: Model, seed: int) -> Self:
        """The scale of some frames, in the spreads of a model."""
        beams = beams_of([f.ideal for f in frames], model)
        surfaces = tuple(Surfaces(f.ideal) for f in frames)
        runs = mapped(
            lambda k: observed(frames, surfaces, beams, model, (seed << 16) + FIRST_EXPECTATION + k),
            range(EXPECTATION_SEEDS),
        )
        return cls.on(frames, surfaces, beams, runs, model, seed)

    @classmethod
    def on(
        cls,
        frames: Sequence[Frame],
        surfaces: Sequence[Surfaces],
        beams: BeamTable,
        runs: Sequence[Observations],
        model: Model,
        seed: int,
    ) -> Self:
        """The scale of some beams of the frames, of which `runs` say what the model shows with some seeds."""
        expected = expectation(beams, runs)
        found = [*divisions(beams, expected.log_area, {}), *fine_divisions(beams)]
        strata = tuple(d.bin for d in found if d.covariate in _STRATA)
        compared = tuple(j for j in range(4) if j != FEATURES.index("area") or amplitude_tells(frames, model))
        return cls(tuple(frames), beams, expected, strata, seed, tuple(surfaces), compared)

    @functools.cached_property
    def shared(self) -> Shared[Scale]:
        """The scale for the tasks of a worker pool."""
        return Shared(self)

    def __getstate__(self) -> dict[str, object]:
        """Without what is kept only to save time."""
        return {name: value for name, value in self.__dict__.items() if name != "shared"}

    @functools.cached_property
    def measured(self) -> Observations:
        """What was measured."""
        return observations_of(self.beams, [f.measured for f in self.frames])

    def simulated(self, model: Model, first: int, count: int, nuisance: Nuisance | None = None) -> list[Observations]:
        """What a model shows, with seeds of its own."""
        nuisance = nuisance or Nuisance()
        run, posed = nuisance.posed(nuisance.model(model), self.surfaces)
        seeds = range(first, first + count)
        return mapped(lambda k: observed(self.frames, posed, self.beams, run, (self.seed << 16) + k), seeds)

    def excess(self, model: Model, nuisance: Nuisance | None = None) -> tuple[float, float]:
        """The gap that a model leaves beyond its own noise, and that noise's standard deviation."""
        beyond, noise = self.excess_by_part(model, nuisance)
        return float(beyond.mean()), float(noise.mean(axis=1).std(ddof=1))

    def excess_by_part(
        self, model: Model, nuisance: Nuisance | None = None, weight: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """The same for each of `PARTS`, shape (n_parts,), and some draws of the noise, shape (n_draws, n_parts).
        `weight` (n_beams,): how much each beam counts, all alike where None.

        A measurement that is nearer than the model's own simulations are to each other differs from it too: that model
        scatters more than the sensor.
        """
        shown = self.simulated(model, _FIRST_EXCESS, GAP_SEEDS, nuisance)
        others = self.simulated(model, _FIRST_EXCESS_FLOOR, GAP_FLOORS, nuisance)
        noise = np.array([self.distance(other, shown, weight) for other in others])
        return np.abs(self.distance(self.measured, shown, weight) - noise.mean(axis=0)), noise

    def distance(
        self, one: Observations, others: Sequence[Observations], weight: FloatArray | None = None
    ) -> FloatArray:
        """The parts of the gap in the order of `PARTS`, between one measurement and some simulations."""
        return np.asarray(self.distances(one, others, [np.ones(len(self.beams)) if weight is None else weight])[0])

    def distances(self, one: Observations, others: Sequence[Observations], weights: Sequence[FloatArray]) -> FloatArray:
        """The same for several weights of the beams, shape (n_weights, n_parts).

        The ranges of the one are put right by a usual error of the sensor's height, which no model says.
        """
        longer_m = height_errors_m(self.beams, self.expected.spread[:, 0], one, others[0])
        one = replace(one, feature=one.feature - np.outer(longer_m, np.arange(len(FEATURES)) == 0))
        parts = np.zeros((len(weights), len(PARTS)))
        parts[:, :4] = self._shifts(one, others, weights)
        cells = [range_bin(each.extra_m) for each in (one, *others)]
        for stratum in self.strata:
            parts[:, 4] += [self._losses(stratum, one, others, weight) for weight in weights]
            parts[:, 5] += self._strays(stratum, (one, *others), cells, weights)
        parts /= max(len(self.strata), 1)
        total = np.array([weight.sum() for weight in weights])
        unlike = unlike_echoes(self.beams, one, others, weights)
        parts[:, 5] += unlike / np.maximum(total, 1e-9) / _RATE_SPREAD
        return parts

    def _shifts(self, one: Observations, others: Sequence[Observations], weights: Sequence[FloatArray]) -> FloatArray:
        """The 1-Wasserstein distances of the four features, in standard deviations: means over the bins of each way to
        make strata, summed over these; (n_weights, 4)."""
        mine = np.flatnonzero(self.expected.known & one.detected)
        theirs = [np.flatnonzero(self.expected.known & other.detected) for other in others]
        row, count = np.concatenate([mine, *theirs]), len(mine)
        found = np.zeros((len(weights), 4))
        for j in self.features:
            own = self._standard(one, mine, j)
            value = np.concatenate([own, *(self._standard(o, t, j) for o, t in zip(others, theirs, strict=True))])
            ascending = np.argsort(value)
            beam, ordered = row[ascending], (value[ascending], ascending < count)
            for stratum in self.strata:
                found[:, j] += _apart_in(stratum, beam, *ordered, weights)
        return found

    def _standard(self, observations: Observations, rows: IndexArray, feature: int) -> FloatArray:
        off = (observations.feature[rows, feature] - self.expected.mean[rows, feature]) / self.expected.spread[
            rows, feature
        ]
        return np.asarray(np.clip(off, -_CLIP, _CLIP))

    def _losses(
        self, stratum: IndexArray, one: Observations, others: Sequence[Observations], weight: FloatArray
    ) -> float:
        """Mean difference of the detection probability, in its own standard deviations of a single beam."""
        hit = (self.beams.distance_m > 0.0) & (stratum >= 0)
        bins = int(stratum.max()) + 1
        count = np.bincount(stratum[hit], weight[hit], bins)
        safe = np.maximum(count, 1e-9)
        p = np.bincount(stratum[hit], (weight * one.detected)[hit], bins) / safe
        q = sum(np.bincount(stratum[hit], (weight * o.detected)[hit], bins) for o in others) / safe / len(others)
        spread = np.sqrt(np.maximum(q * (1.0 - q), 0.0025))
        return float((count * np.abs(p - q) / spread).sum() / max(count.sum(), 1e-9))

    def _strays(
        self,
        stratum: IndexArray,
        samples: Sequence[Observations],
        cells: Sequence[IndexArray],
        weights: Sequence[FloatArray],
    ) -> list[float]:
        """Mean over strata of the differences in the rate of other echoes between the first of the samples and the
        others, summed over bins of their range, which `cells` are; one for each of the beams' weights."""
        used = stratum >= 0
        bins, ranges = int(stratum.max()) + 1, len(RANGE_EDGES_M)
        placed = []
        for sample, cell in zip(samples, cells, strict=True):
            mine = used[sample.extra_beam]
            beam = sample.extra_beam[mine]
            placed.append((beam, stratum[beam] * ranges + cell[mine]))
        found = []
        for weight in weights:
            count = np.bincount(stratum[used], weight[used], bins)
            own, *rates = (np.bincount(place, weight[beam], bins * ranges).astype(np.float64) for beam, place in placed)
            difference = np.abs(own - sum(rates) / len(rates))
            # A bin in which one echo in five beams is other has a spread of its own.
            found.append(float(difference.reshape(bins, ranges).sum() / max(count.sum(), 1e-9) / _RATE_SPREAD))
        return found


def _apart_in(
    stratum: IndexArray, beam: IndexArray, value: FloatArray, first: BoolArray, weights: Sequence[FloatArray]
) -> list[float]:
    """Mean over the bins of a stratum of the 1-Wasserstein distances between the `first` values and the others; one for
    each of the beams' weights. `value`, ascending, is of the beams `beam`."""
    scratch = np.empty((5, int(stratum.max()) + 1))
    found = []
    for weight in weights:
        areas_between(value, beam, first, stratum, weight, scratch)
        share, apart = scratch[0], scratch[4]
        found.append(float((share * apart).sum() / max(share.sum(), 1e-9)))
    return found


GapProgress = Callable[[int, int, float], object]
"""Told (stages done, of how many with the floor, the last one's gap above its own model's noise)."""


def excesses(scale: Scale, models: Sequence[Model], pool: WorkerPool | None = None) -> list[tuple[float, float]]:
    """`Scale.excess` of each model."""
    return [*(pool or WorkerPool()).map(Scale.excess, ((scale.shared, model) for model in models))]


def left_by(scale: Scale, models: Sequence[Model], pool: WorkerPool | None = None) -> list[float]:
    """The gap beyond the noise that each of some models leaves which differ by little, as `gap_of` counts it; the noise
    of all is the last one's."""
    own = scale.simulated(models[-1], FIRST_GAP_FLOOR, GAP_FLOORS)
    tasks = ((scale.shared, model, FIRST_GAP, GAP_SEEDS) for model in models)
    shown = [*(pool or WorkerPool()).map(Scale.simulated, tasks)]
    noise = np.mean([scale.distance(other, shown[-1]) for other in own], axis=0)
    return [float(np.abs(scale.distance(scale.measured, one) - noise).mean()) for one in shown]


def gap_of(
    scale: Scale,
    stages: Sequence[tuple[str, Model]],
    on_progress: GapProgress | None = None,
    pool: WorkerPool | None = None,
) -> Gap:
    """The gap before, with each effect in turn, and after; `stages` begins with the case's model, ("", model).

    The floor is what two simulations of the last model are apart, and by how much, more or less, another one would be,
    each part on its own: what a perfect model is expected to leave. What a stage's own model makes by chance counts as
    much as the last one's: an effect that strikes at random adds noise to the model, which is no gap. Intervals are 5 %
    to 95 % quantiles over beams drawn anew with replacement.
    """
    found: list[FloatArray] = []
    chance: list[FloatArray] = []
    kinds: list[FloatArray] = []
    for apart, own, by_kind in (pool or WorkerPool()).map(_apart, ((scale.shared, model) for _, model in stages)):
        found.append(apart)
        chance.append(own)
        kinds.append(by_kind)
        if on_progress is not None:
            on_progress(len(found), len(stages) + 1, float(np.abs(apart[0] - own.mean(axis=0)).mean()))
    noise = chance[-1].mean(axis=0)
    # A measurement that is nearer than a model's own simulations are to each other differs from it too.
    parts = [noise + np.abs(one - own.mean(axis=0)) for one, own in zip(found, chance, strict=True)]
    totals = [_interval(one[0].mean(), [drawn.mean() for drawn in one[1:]]) for one in parts]
    lowest = noise + by_chance(chance[-1])
    drawn = chance[-1].mean(axis=1) + (lowest - noise).mean()
    floor = _interval(float(lowest.mean()), list(drawn), centred=True)
    by_feature = {
        name: (float(parts[0][0, j]), float(parts[-1][0, j]), float(lowest[j])) for j, name in enumerate(PARTS)
    }
    waterfall = tuple((name, total) for (name, _), total in zip(stages[1:], totals[1:], strict=True))
    again = np.abs(chance[-1] - noise).mean(axis=1) - by_chance(chance[-1]).mean()
    span = _closed_span(parts[0].mean(axis=1), parts[-1].mean(axis=1), floor.value, again)
    named = named_by_kind(kinds[0][0], *kinds[-1])
    return Gap(totals[0], totals[-1], floor, by_feature, waterfall, span, by_kind=named)


def _closed_span(before: FloatArray, after: FloatArray, floor: float, again: FloatArray) -> tuple[float, float]:
    """The ends of the 90 % interval of the share of the gap above the floor that closes, cut off at -1 and 1.

    `before` and `after` (1 + drawn,): the gap as it is and with beams drawn anew, the same ones in both. `again`
    (n_floors,): by how much more or less another measurement would differ from the last model if that were the truth.
    Where a gap before is no larger than the floor, whatever closes is chance, and the share may be anything.
    """
    before, after = (one[0] + one[1:] - one[1:].mean() for one in (before, after))
    above = np.repeat(before - floor, len(again))
    closed = (np.repeat(before - after, len(again)) - np.tile(again, len(before))) / np.where(above > 0.0, above, 1.0)
    ends = (np.where(above > 0.0, closed, nothing) for nothing in (-np.inf, np.inf))
    low, high = (float(np.quantile(one, at, method="nearest")) for one, at in zip(ends, ENDS, strict=True))
    return max(low, -1.0), min(high, 1.0)


def by_chance(own: FloatArray) -> FloatArray:
    """How far one more draw is expected to be from the mean of some draws (n, n_parts), to either side; (n_parts,)."""
    n = len(own)
    # Draws are nearer to their own mean than another one is.
    return np.asarray(np.abs(own - own.mean(axis=0)).mean(axis=0) * np.sqrt((n + 1.0) / (n - 1.0)))


def _apart(scale: Scale, model: Model) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The parts of the gap between the measurement and a model, as it is and with beams drawn anew, and those between
    the model's own simulations; shapes (1 + drawn, n_parts) and (n_floors, n_parts). Last both of the other echoes by
    their kinds, the second as a mean, (2, n_kinds, 3)."""
    shown = scale.simulated(model, FIRST_GAP, GAP_SEEDS)
    others = scale.simulated(model, FIRST_GAP_FLOOR, GAP_FLOORS)
    chance = np.array([scale.distance(other, shown) for other in others])
    kinds = [apart_by_kind(scale.beams, one, shown) for one in (scale.measured, *others)]
    by_kind = np.array([kinds[0], np.mean(kinds[1:], axis=0)])
    return scale.distances(scale.measured, shown, _drawn_anew(scale)), chance, by_kind


def _drawn_anew(scale: Scale) -> list[FloatArray]:
    """How often each beam counts: once, and as drawn with replacement, so many times."""
    rng = np.random.default_rng(np.random.SeedSequence([scale.seed & 0xFFFFFFFF, 5]))
    # Whole columns are drawn: what shakes or moves in the sweep moves a column at once.
    column = scale.beams.column
    columns = column.max() + 1
    drawn = [rng.multinomial(columns, np.full(columns, 1.0 / columns)) for _ in range(_RESAMPLED)]
    return [np.ones(len(scale.beams)), *(times[column].astype(float) for times in drawn)]


def _interval(value: float, draws: Sequence[float], *, centred: bool = False) -> Interval:
    """The spread of the draws about the value; resampling itself adds noise, which only the spread may keep."""
    low, high = np.quantile(draws, ENDS)
    middle = float(np.mean(draws)) if not centred else value
    return Interval(float(value), float(max(value + low - middle, 0.0)), float(value + high - middle))
