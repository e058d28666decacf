"""How far the fitted parameters may be off: intervals from the scatter of columns of beams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.parameters.descent import polished
from lidarcheck.calibration.parameters.fit_data import FitReference
from lidarcheck.calibration.parameters.fitted import FitParameter, Fitted
from lidarcheck.calibration.parameters.identifiability import open_parameters, warnings_of
from lidarcheck.calibration.parameters.problem import Problem, residual
from lidarcheck.calibration.parameters.slopes import Slopes, slopes_at
from lidarcheck.inference.intervals import HALF_WIDTH
from lidarcheck.inference.optimiser import identified_step

__all__ = ["Estimate", "estimate"]


SEEDS = 8
"""Simulations whose mean stands for what a model shows in the last fit; their noise stands in the intervals."""
_PAIRS = 2
"""Seeds of each of the two sets of which the last fit takes slopes."""
_MISFIT = 1.1
"""From so many times the distance that chance makes, the model does not show what was measured."""
_WHOLE_TRIED = 4
"""How many whole numbers are tried to either side."""
_WORSE = 4.0
"""A whole number is not refused where model and measurement are farther apart by less, in squared standard errors."""
_REACHES, _NEARLY = 6, 0.35
"""An interval's end is moved at most so often, until what is left to its refusal is less, in standard errors."""
_LEAST_GROWTH, _LEAST_FACTOR, _MOST_FACTOR = 0.25, 1.2, 3.0
"""How far it is moved at once: as if the refusal grew by at least so much on the way, and between these factors."""


@dataclass(frozen=True)
class Estimate:
    """Where the fit ends: the point `x`, each parameter, warnings in words, and by how much intervals are widened
    because the model does not show what was measured (1 where it does). `moved`: by how many standard errors the point
    moved at most; where that is much, slopes were taken too far away."""

    x: FloatArray
    parameters: tuple[Fitted, ...]
    warnings: tuple[str, ...]
    misfit: float
    correlation: FloatArray
    moved: float


def estimate(problem: Problem, reference: FitReference, x: FloatArray) -> Estimate:
    """Solve the equations of the fit near `x` with more seeds, and find the intervals."""
    slopes = slopes_at(problem, reference, x, pairs=_PAIRS)
    start = x
    x, off = polished(problem, reference, slopes, x, SEEDS)
    score, misfit = _score_covariance(problem, reference, slopes, x, off)
    spread = _spread(slopes, score)
    loose = open_parameters(problem, slopes)
    test = _Test(problem, reference, slopes, score, x)
    parameters = tuple(
        _fitted(test, j, float(spread[j]), _status(problem, one, float(x[j]), bool(loose[j])))
        for j, one in enumerate(problem.free)
    )
    whole = [one.whole and p.status == "fitted" for one, p in zip(problem.free, parameters, strict=True)]
    end = np.array([one.to_x(p.value) for one, p in zip(problem.free, parameters, strict=True)])
    warnings = warnings_of(problem, slopes, parameters)
    if misfit > 1.0:
        warnings += (f"the model does not show all that was measured; intervals are wider by {misfit:.1f} for that",)
    sure = (spread > 0.0) & ~loose
    moved = float(np.max(np.abs(end - start)[sure] / spread[sure], initial=0.0))
    moved = float("inf") if (np.rint(end) != np.rint(start))[whole].any() else moved
    return Estimate(end, parameters, warnings, misfit, _correlation(slopes), moved)


def _score_covariance(
    problem: Problem, reference: FitReference, slopes: Slopes, x: FloatArray, off: FloatArray
) -> tuple[tuple[FloatArray, FloatArray], float]:
    """The covariance of the equations, as the model's noise has it and as the measured columns scatter; the misfit."""
    shown = problem.data.by_cluster(reference, problem.model(x), "fit", SEEDS)
    middle = shown.mean(axis=0)
    # These seeds did not teach the metric, which therefore treats them as it treats a measurement.
    shown = (shown - middle) * np.sqrt(SEEDS / (SEEDS - 1.0))
    more = 1.0 + 1.0 / SEEDS
    expected = more * float(np.mean([reference.metric.inner(total, total) for total in shown.sum(axis=1)]))
    noise = shown @ slopes.weights
    modelled = more * np.einsum("kci,kcj->ij", noise, noise) / SEEDS
    parts = (reference.measured_parts - middle) @ slopes.weights
    empirical = (parts - parts.mean(axis=0)).T @ (parts - parts.mean(axis=0))
    misfit = float(np.sqrt(reference.metric.inner(off, off) / max(expected, 1e-9)))
    misfit = misfit if misfit > _MISFIT else 1.0
    return (modelled * misfit**2, empirical), misfit


def _spread(slopes: Slopes, scores: Sequence[FloatArray]) -> FloatArray:
    """Standard error of each parameter: the larger of the two."""
    n = len(slopes.information)
    inverse = np.column_stack([identified_step(slopes.information, row) for row in np.eye(n)])
    found = [np.sqrt(np.maximum(np.diag(inverse @ score @ inverse.T), 0.0)) for score in scores]
    return np.asarray(np.max(found, axis=0))


def _status(problem: Problem, one: FitParameter, x: float, loose: bool) -> str:
    """What is to be said of a parameter; one that does nothing any more where it ended is open, too."""
    if one.name in problem.dead:
        return "no effect" if np.isclose(x, one.to_x(one.start)) else "not identified"
    return "not identified" if loose else "fitted"


def _fitted(test: _Test, j: int, spread: float, status: str) -> Fitted:
    one, x = test.problem.free[j], float(test.x[j])
    value = one.start if status == "no effect" else one.to_value(x)
    low, high = one.low, one.high
    if status == "fitted" and one.whole:
        value, low, high = (float(number) for number in _whole_range(test, j))
    elif status == "fitted":
        value = float(f"{value:.6g}")
        low, high = (one.to_value(x + way * _reach(test, j, spread, way)) for way in (-1.0, 1.0))
    return Fitted(one.name, one.unit, one.start, value, low, high, status)


@dataclass(frozen=True)
class _Test:
    """What the data say against values of one parameter when the others are fitted to each."""

    problem: Problem
    reference: FitReference
    slopes: Slopes
    scores: Sequence[FloatArray]
    x: FloatArray

    def refusal(self, j: int, at: float) -> float:
        """The score left at a value, in its standard errors; above 0 where the data ask for more. inf: no sensor."""
        there, lean = self._beside(j, at)
        off = residual(self.problem, self.reference, there, SEEDS)
        if off is None:
            return float("inf")
        variance = max(float(lean @ score @ lean) for score in self.scores)
        return float(lean @ (self.slopes.weights.T @ off) / np.sqrt(max(variance, 1e-12)))

    def distance(self, j: int, at: float) -> float:
        """How far the model is from the measurement at a value, in units of chance; the others as they are, or moved
        along where that is nearer."""
        alone = self.x.copy()
        alone[j] = at
        found = [residual(self.problem, self.reference, x, SEEDS) for x in (alone, self._beside(j, at)[0])]
        return min(float("inf") if off is None else self.reference.metric.inner(off, off) for off in found)

    def _beside(self, j: int, at: float) -> tuple[FloatArray, FloatArray]:
        """Where the other parameters go, as slopes have it, when one is at a value; and the change of all with it."""
        others = self.problem.active() & ~np.array([one.whole for one in self.problem.free])
        others[j] = False
        information, there = self.slopes.information, self.x.copy()
        lean = np.zeros(len(there))
        lean[j] = 1.0
        if others.any():
            lean[others] = -identified_step(information[np.ix_(others, others)], information[others, j])
        there += lean * (at - self.x[j])
        return self.problem.within(there), lean


def _reach(test: _Test, j: int, spread: float, way: float) -> float:
    """How far the interval reaches to one side: to where the data refuse the value, which slopes alone may misjudge; to
    the bound where they do not."""
    most, x = HALF_WIDTH, float(test.x[j])
    reach, before = most * spread, test.refusal(j, x)
    farthest = abs((test.problem.free[j].ends[1] if way > 0.0 else test.problem.free[j].ends[0]) - x)
    if farthest == 0.0:
        return 0.0
    for _ in range(_REACHES):
        reach = min(reach, farthest)
        left = most + way * test.refusal(j, x + way * reach)  # 0 where the value is just refused
        if left < _NEARLY or reach == farthest:
            break
        # As far again as the refusal grows on the way; where it hardly grows, much farther.
        gained = max(most + way * before - left, _LEAST_GROWTH)
        reach *= min(max((most + way * before) / gained, _LEAST_FACTOR), _MOST_FACTOR)
    else:
        return farthest
    return reach


def _whole_range(test: _Test, j: int) -> tuple[int, int, int]:
    """The whole number that fits best, and the lowest and highest that are hardly worse.

    By the whole distance of model and measurement, since the next number may show otherwise than slopes say.
    """
    one, start = test.problem.free[j], round(test.x[j])
    off = {start: test.distance(j, start)}
    for way in (-1, 1):
        number = start + way
        while one.low <= number <= one.high and abs(number - start) <= _WHOLE_TRIED:
            off[number] = test.distance(j, number)
            if off[number] > off[number - way] + _WORSE:
                break
            number += way
    best = min(off, key=lambda number: off[number])
    kept = [number for number, far in off.items() if far <= off[best] + _WORSE]
    return best, min(kept), max(kept)


def _correlation(slopes: Slopes) -> FloatArray:
    """Correlations of the fitted parameters; 0 for those that were not fitted."""
    n = len(slopes.information)
    inverse = np.column_stack([identified_step(slopes.information, row) for row in np.eye(n)])
    spread = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    return np.asarray(np.clip(inverse / np.outer(spread, spread), -1.0, 1.0))
