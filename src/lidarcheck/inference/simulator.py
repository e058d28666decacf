"""Frames and their case's model: what was measured, and what any model shows, in the same summaries."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.cases.frame import Frame
from lidarcheck.errors import InputError
from lidarcheck.inference.covariance import metrics, nuisances, shuffled
from lidarcheck.inference.metric import Metric
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.observed.beam_table import BeamTable, beams_of
from lidarcheck.inference.observed.coarse import amplitude_tells
from lidarcheck.inference.observed.edges import runs_along, runs_past, with_beams_of
from lidarcheck.inference.observed.observations import Observations, observations_of
from lidarcheck.inference.observed.summaries import Summaries, compressed
from lidarcheck.inference.simulations import Simulations
from lidarcheck.model.spec import Model
from lidarcheck.scan import Scan
from lidarcheck.workers import Shared
from lidarcheck.workers.threads import mapped

__all__ = ["Simulator"]


EXPECTATION_SEEDS = 8
"""Simulations of which each beam's expectation is the mean."""
FLOOR_SEEDS, FLOOR_DRAWS = 20, 120
"""Simulations from which draws of the noise are mixed beam by beam, and these draws."""
CHECK_DRAWS = 48
"""Draws that do not teach the metric: they tell how far it errs on data that it does not know."""
_FIRST_EXPECTATION, _FIRST_FLOOR = 1000, 2000
"""Their seeds, apart from those of fits, which begin at 0."""
_SEEDS_OF_RANDOM = 4
"""Seeds of a model that strikes at random: two tell little of its mean."""
_VARIES = 0.04
"""Mean logarithm of the variance, beyond that of the case's own model, from which on a model strikes at random."""
EDGE_ERROR = 0.4
"""How often, as a standard deviation, a run of beams at an edge meets what its neighbours do: a usual error of the pose
is a tenth to a fifth of a beam."""


class Simulator:
    """Some frames with a model: simulates other models on them and measures how far they are from the measurement."""

    def __init__(self, frames: Sequence[Frame], model: Model, seed: int, *, seeds: int = 2) -> None:
        self.frames = tuple(frames)
        self.model = model
        self.seed = seed
        self.seeds = seeds
        self._simulations = Simulations(frames, seed)
        self.beams: BeamTable = beams_of([f.ideal for f in frames], model)
        if not len(self.beams):
            what = "no beam can be judged: each meets an edge, or nobody knows what"
            fix = "is it the ideal scan of the sensor that measured?"
            raise InputError(what, file=frames[0].ideal.file or None, fix=fix)
        names = {i: m.name for i, m in model.materials.items()}
        base = mapped(lambda k: self.observations(model, _FIRST_EXPECTATION + k), range(EXPECTATION_SEEDS))
        drawn = mapped(lambda k: self.observations(model, _FIRST_FLOOR + k), range(FLOOR_SEEDS))
        fresh = shuffled(self.beams, drawn, range(self.seed, self.seed + FLOOR_DRAWS))
        # Every frame of a case has ideal scans of one origin.
        origin = frames[0].origin
        self.summaries = Summaries(
            self.beams,
            base,
            fresh,
            names,
            location=origin.judges_location,
            rates=origin.judges_rates,
            amplitude=amplitude_tells(frames, model),
        )
        self.measured_observations = observations_of(self.beams, [f.measured for f in frames])
        self.measured_plain = self.summaries.plain(self.measured_observations)
        self.measured = compressed(self.measured_plain)
        # Half of the draws teach the metric; the others tell how far it errs on data that it does not know.
        self.floor, self.check = self.summaries.fresh[CHECK_DRAWS:], self.summaries.fresh[:CHECK_DRAWS]
        self._paired: dict[int, FloatArray] = {}
        self._simulations.keep_own(model, seeds)
        self.edges = self.edges_beside(base)
        self.metric, self.bare = metrics(self.floor, self.edges, nuisances(self))
        kinds = [(name.feature, name.covariate) for name in self.summaries.names]
        self._kind = np.unique(np.array([" by ".join(kind) for kind in kinds]), return_inverse=True)[1]
        zero = np.zeros((1, len(self.measured)))
        self.floor_distance = float(np.mean([self.distance(zero, draw) for draw in self.check]))

    def edges_beside(self, simulated: Sequence[Observations], *, deep: bool = False) -> FloatArray:
        """What each run of beams that sees past an edge, and not so in simulations, or the other way round, does to the
        measured summaries, as a usual error of the pose; shape (n_summaries, runs). `deep`: see `edges.runs_past`."""
        return self._of_runs(runs_past(self.beams, self.measured_observations, simulated, deep=deep), simulated[0])

    def along_edges(self, model: Model, seed: int, nuisance: Nuisance | None = None) -> Metric:
        """The metric for which a model shows the same whatever part of a beam an edge is off by."""
        shown = self.observations(model, seed, nuisance)
        edges = self._of_runs(runs_along(self.beams), shown)
        return self.metric.widened(edges)

    def _of_runs(self, runs: Sequence[IndexArray], shown: Observations) -> FloatArray:
        """What each run of beams does to the measured summaries, against what is shown, as a usual error of the pose;
        shape (n_summaries, runs)."""
        columns = [np.zeros((len(self.measured), 0))]
        for run in runs:
            without = with_beams_of(self.measured_observations, shown, run)
            columns.append(EDGE_ERROR * (self.measured - self.summaries.of(without))[:, None])
        return np.concatenate(columns, axis=1)

    @functools.cached_property
    def shared(self) -> Shared[Simulator]:
        """The simulator for the tasks of a worker pool."""
        return Shared(self)

    def __getstate__(self) -> dict[str, object]:
        """Without what is kept only to save time."""
        return {name: value for name, value in self.__dict__.items() if name != "shared"}

    def scans(self, model: Model, seed: int, nuisance: Nuisance | None = None) -> list[Scan]:
        """What the model shows of every frame, with random numbers of its own."""
        return self._simulations.scans(model, seed, nuisance)

    def observations(self, model: Model, seed: int, nuisance: Nuisance | None = None) -> Observations:
        """What the model shows of each beam."""
        return observations_of(self.beams, self.scans(model, seed, nuisance))

    def shows(self, model: Model, seeds: int | None = None, nuisance: Nuisance | None = None) -> FloatArray:
        """The model's summaries, a row a seed, shape (seeds, n_summaries); the seeds are the same for every model.

        What chance does to the case's own model with a seed is taken off, since it does nearly the same to a model
        that differs a little. Of a model that strikes at random two seeds tell little: without `seeds` it gets more.
        """
        rows = mapped(lambda k: self._shown(model, k, nuisance), range(seeds or self.seeds))
        if seeds is None and self.varies(np.array(rows)):
            rows += mapped(lambda k: self._shown(model, k, nuisance), range(len(rows), _SEEDS_OF_RANDOM))
        return np.array(rows)

    def _shown(self, model: Model, seed: int, nuisance: Nuisance | None) -> FloatArray:
        return self.summaries.of(self.observations(model, seed, nuisance)) - self._chance(seed)

    def plain_base(self, k: int) -> FloatArray:
        """The summaries of the case's own model with a seed, not compressed."""
        if k not in self._paired:
            self._paired[k] = self.summaries.plain(self.observations(self.model, k))
        return self._paired[k]

    def _chance(self, k: int) -> FloatArray:
        return compressed(self.plain_base(k))

    def distance(self, shown: FloatArray, measured: FloatArray | None = None, metric: Metric | None = None) -> float:
        """How far a model's summaries, a row a seed, are from the measured ones, without the noise of the seeds.

        The mean over pairs of seeds of r_i' C^-1 r_j: the noise of two seeds is independent and falls out. Where the
        model itself varies more from seed to seed than C says (see `_own_variance`), as one that strikes at random
        does, residuals count by that, and its logarithm is added, as the likelihood has it. `metric`: the one that
        forgives nuisances by default.
        """
        metric = metric or self.metric
        r = (self.measured if measured is None else measured) - np.atleast_2d(shown)
        n = len(r)
        if n == 1:
            return metric.square(r[0])
        variance = self._own_variance(np.atleast_2d(shown))
        r = r / np.sqrt(variance)
        total = metric.square(r.sum(axis=0)) - sum(metric.square(row) for row in r)
        return float(total / (n * (n - 1)) + np.sum(np.log(variance)))

    def varies(self, shown: FloatArray) -> bool:
        """Whether a model's summaries vary of themselves, as those of one that strikes at random do."""
        return len(shown) > 1 and float(np.mean(np.log(self._own_variance(shown)))) > _VARIES

    def _own_variance(self, shown: FloatArray) -> FloatArray:
        """By how much a model's summaries vary more than those of the case's own model, at least 1, (n_summaries,).

        The mean over summaries of a kind, since few seeds tell little of one. The seeds of the case's own model, which
        were taken off, add a variance of 1 where they have become independent; that is not the model's own.
        """
        spread = np.var(shown, axis=0, ddof=1)
        mean = np.bincount(self._kind, spread) / np.bincount(self._kind)
        return np.asarray(np.maximum(mean - 1.0, 1.0)[self._kind])
