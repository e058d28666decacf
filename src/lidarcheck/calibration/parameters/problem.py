"""What is fitted to what, and what the model shows at any point of the fit's scales."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.parameters.fit_data import FitData, FitReference
from lidarcheck.calibration.parameters.fitted import FitParameter
from lidarcheck.calibration.parameters.parameters import with_values
from lidarcheck.errors import UsageError
from lidarcheck.inference.optimiser import Point
from lidarcheck.model.spec import Model

__all__ = ["Problem", "first_step", "point_at", "residual"]


SEEDS = 3
"""Simulations whose mean stands for what a model shows, while a round is under way."""


@dataclass
class Problem:
    """What is fitted to what. `steps`: how wide a difference of each parameter is, on its scale; kept from round to
    round. `dead`: parameters that change nothing on these data."""

    data: FitData
    base: Model
    free: tuple[FitParameter, ...]
    steps: dict[str, float] = field(default_factory=dict)
    dead: set[str] = field(default_factory=set)
    _shown: dict[tuple[bytes, int], FloatArray | None] = field(default_factory=dict)
    _of: FitReference | None = None

    def model(self, x: FloatArray) -> Model:
        """The model at a point of the fit's scales."""
        return with_values(self.base, self.values(x))

    def values(self, x: FloatArray) -> Mapping[str, float]:
        """The parameters' values there, by name."""
        return {one.name: one.to_value(float(at)) for one, at in zip(self.free, x, strict=True)}

    def start(self) -> FloatArray:
        """Where the fit begins."""
        return np.array([one.to_x(one.start) for one in self.free])

    def nearby(self) -> FloatArray:
        """A point beside the start where every free parameter does something."""
        return self.within(self.start() + np.array([first_step(one) for one in self.free]))

    def within(self, x: FloatArray) -> FloatArray:
        """The nearest point within the bounds, whole where it has to be."""
        return np.array([one.to_x(one.to_value(float(at))) for one, at in zip(self.free, x, strict=True)])

    def active(self) -> npt.NDArray[np.bool_]:
        """Which parameters the data tell something about, shape (n_free,)."""
        return np.array([one.name not in self.dead for one in self.free])

    def revive(self) -> None:
        """Parameters that changed nothing may do so where the others stand now."""
        for name in self.dead:
            self.steps.pop(name, None)
        self.dead.clear()

    def shows(self, reference: FitReference, x: FloatArray, k: int) -> FloatArray | None:
        """The statistics with the k-th seed of the fit; None where no sensor has such numbers."""
        self.look(reference, [(x, k)])
        return self._shown[x.tobytes(), k]

    def look(self, reference: FitReference, asked: Iterable[tuple[FloatArray, int]]) -> None:
        """Find all at once what will be asked for at some points, each with one of the seeds."""
        if self._of is not reference:
            self._of, self._shown = reference, {}
        new = {(x.tobytes(), k): (x, k) for x, k in asked if (x.tobytes(), k) not in self._shown}
        sensors = {key: (self._sensor(x), "fit", k) for key, (x, k) in new.items()}
        there = {key: (model, purpose, k) for key, (model, purpose, k) in sensors.items() if model is not None}
        found = self.data.totals(reference, there.values())
        self._shown |= dict.fromkeys(new) | dict(zip(there, found, strict=True))

    def _sensor(self, x: FloatArray) -> Model | None:
        """The model at a point; None where no sensor has such numbers."""
        try:
            return self.model(x)
        except UsageError:
            return None


def first_step(one: FitParameter) -> float:
    """How wide a difference of a parameter is at first, on its scale: 1, a tenth of it, or a quarter of its size."""
    return 1.0 if one.whole else 0.1 if one.logarithmic else 0.25


def residual(problem: Problem, reference: FitReference, x: FloatArray, seeds: int = SEEDS) -> FloatArray | None:
    """Measured less what the model shows on average; None where no sensor has such numbers."""
    problem.look(reference, [(x, k) for k in range(seeds)])
    shown = [problem.shows(reference, x, k) for k in range(seeds)]
    if shown[0] is None:
        return None
    return np.asarray(reference.measured - np.mean([s for s in shown if s is not None], axis=0))


def point_at(
    problem: Problem, reference: FitReference, x: FloatArray, step: FloatArray, seeds: int = SEEDS
) -> Point | None:
    """A point of a descent with its residual; None where no sensor has such numbers."""
    off = residual(problem, reference, x, seeds)
    return None if off is None else Point(x, off, reference.metric.square(off), step)
