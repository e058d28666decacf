"""How far model and measurement are apart, by a distance that no fit uses, with seeds that no fit sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.parameters.fit_data import FitData, seed_of
from lidarcheck.inference.observed.observations import FEATURES, Observations
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model
from lidarcheck.workers import Shared, WorkerPool

__all__ = ["Distance", "Validation"]


_SEEDS = 4
"""Simulations of which a distance on what is held out is the mean; on the fitted side one is enough to look at."""
_FIRST, _FIRST_FLOOR = 9500, 9600
"""Where their seeds begin, and those of the second of two runs: no fit and no gap uses any of them."""
_SIGMAS = 2.0
"""Standard errors by which one distance must be less than another to be nearer beyond chance."""


@dataclass(frozen=True)
class Distance:
    """The mean distance over some simulations, each with a seed of its own; `draws` (n_seeds,): one by one.

    The mean over strata, features and ways to stratify of 1-Wasserstein distances, in standard deviations of a beam;
    see `lidarcheck.inference.wasserstein`.
    """

    draws: tuple[float, ...]

    @property
    def value(self) -> float:
        """Their mean."""
        return float(np.mean(self.draws))

    def nearer_than(self, other: Distance) -> bool:
        """Whether it is less by more than chance; the seeds are the same, so that the differences count."""
        less = np.array(other.draws) - np.array(self.draws)
        return bool(less.mean() > _SIGMAS * less.std(ddof=1) / np.sqrt(len(less)))


@dataclass(frozen=True)
class _Side:
    """One side of the split on the scale of the start's model."""

    scale: Scale
    measured: Observations
    weight: FloatArray
    pool: WorkerPool

    @cached_property
    def shared(self) -> Shared[_Side]:
        return Shared(replace(self, pool=WorkerPool()))

    @classmethod
    def of(cls, data: FitData, model: Model) -> _Side:
        scale = Scale.of(data.frames, model, seed_of(data.seed, "held out") >> 24)
        return cls(scale, scale.measured, data.used.astype(np.float64), data.pool)

    def distance(self, model: Model, seeds: int) -> Distance:
        return Distance(tuple(self.pool.map(_Side.far, ((self.shared, model, _FIRST + k) for k in range(seeds)))))

    def far(self, model: Model, k: int) -> float:
        """With one seed."""
        return self._between(self.measured, self.scale.simulated(model, k, 1)[0])

    def _between(self, one: Observations, other: Observations) -> float:
        return float(self.scale.distance(one, [other], self.weight).mean())

    def floor(self, model: Model) -> float:
        """The distance of two runs of one model."""
        others = self.scale.simulated(model, _FIRST_FLOOR, 2)
        shown = self.scale.simulated(model, _FIRST, 2)
        return float(np.mean([self._between(a, b) for a, b in zip(others, shown, strict=True)]))


@dataclass(frozen=True)
class Validation:
    """Both sides of the split, each with its distance."""

    fitted: _Side
    held_out: _Side

    @classmethod
    def of(cls, fit: FitData, held_out: FitData, model: Model) -> Validation:
        """The sides of a split, on the scale of a model."""
        return cls(_Side.of(fit, model), _Side.of(held_out, model))

    def on_fitted(self, model: Model) -> Distance:
        """On the beams that are fitted."""
        return self.fitted.distance(model, 1)

    def on_held_out(self, model: Model) -> Distance:
        """On the beams that are held out."""
        return self.held_out.distance(model, _SEEDS)

    def floor(self, model: Model) -> float:
        """What two runs of a model are apart on the beams that are held out."""
        return self.held_out.floor(model)

    def samples(self, before: Model, after: Model) -> Mapping[str, Mapping[str, FloatArray]]:
        """The features of the surfaces' echoes on what is held out: measured, and as both models show them."""
        side = self.held_out
        shown = {
            "real": side.measured,
            "simulated before": side.scale.simulated(before, _FIRST, 1)[0],
            "simulated after": side.scale.simulated(after, _FIRST, 1)[0],
        }
        rows = {name: one.detected & (side.weight > 0.0) for name, one in shown.items()}
        values = {
            feature: {name: one.feature[rows[name], j] for name, one in shown.items()}
            for j, feature in enumerate(FEATURES)
        }
        for feature in ("area", "peak"):
            values[feature] = {name: np.exp(value) for name, value in values[feature].items()}
        return values
