"""How far the fitted parameters may be off: intervals from the scatter of columns of beams, and what cannot be told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.calibration.parameters.bench import FitReference
from lidarcheck.calibration.parameters.descent import Problem, Slopes, point_at, residual, slopes_at
from lidarcheck.calibration.parameters.parameters import FitParameter
from lidarcheck.inference.optimiser import INDISTINCT, Point, descend, identified_step, spectrum

__all__ = ["Estimate", "Fitted", "estimate"]

FloatArray = npt.NDArray[np.float64]

LEVEL = 0.90
"""An interval holds the true value nine times out of ten."""
SEEDS = 8
_PAIRS = 2
_ALIKE = 0.05
_TAKES_PART = 0.15
_MISFIT = 1.1
_WHOLE_TRIED = 4
_WORSE = 4.0
"""A whole number is not refused where model and measurement are farther apart by less, in squared standard errors."""
_POLISH = 3
_REACHES, _NEARLY = 6, 0.35
"""An interval's end is moved at most so often, until what is left to its refusal is less."""


@dataclass(frozen=True)
class Fitted:
    """A parameter as fitted. `low`, `high`: its 90 % interval, the whole of its bounds where `told` says that the data
    leave it open. `told`: "fitted", "no effect" or "not identified"."""

    name: str
    unit: str
    start: float
    value: float
    low: float
    high: float
    told: str = "fitted"


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
    x, off = _polished(problem, reference, slopes, x)
    score, misfit = _score_covariance(problem, reference, slopes, x, off)
    spread = _spread(slopes, score)
    loose = _loose(problem, slopes)
    test = _Test(problem, reference, slopes, score, x)
    parameters = tuple(
        _fitted(test, j, float(spread[j]), _told(problem, one, float(x[j]), bool(loose[j])))
        for j, one in enumerate(problem.free)
    )
    whole = [one.whole and p.told == "fitted" for one, p in zip(problem.free, parameters, strict=True)]
    end = np.array([one.to_x(p.value) for one, p in zip(problem.free, parameters, strict=True)])
    warnings = (*_unfitted(problem), *_confounded(problem, slopes), *_at_bounds(problem, parameters))
    if misfit > 1.0:
        warnings += (f"the model does not show all that was measured; intervals are wider by {misfit:.1f} for that",)
    sure = (spread > 0.0) & ~loose
    moved = float(np.max(np.abs(end - start)[sure] / spread[sure], initial=0.0))
    moved = float("inf") if (np.rint(end) != np.rint(start))[whole].any() else moved
    return Estimate(end, parameters, warnings, misfit, _correlation(slopes), moved)


class _Equations:
    """The equations of the fit with slopes as they are, to be solved in the `moving` parameters."""

    worth_doubling = float("inf")

    def __init__(self, problem: Problem, reference: FitReference, slopes: Slopes) -> None:
        self.problem, self.reference, self.slopes = problem, reference, slopes
        self.moving = problem.active() & ~np.array([one.whole for one in problem.free])

    def at(self, x: FloatArray, step: FloatArray) -> Point | None:
        """The residual at a point, and how far the equations are from being solved, in squared standard errors."""
        found = point_at(self.problem, self.reference, x, step, SEEDS)
        if found is None:
            return None
        return replace(found, distance=float(self._right(found) @ self._solution(found)))

    def look(self, now: Point, step: FloatArray) -> Point | None:
        """See `Objective.look`."""
        return self.at(self.problem.within(now.x + step), step)

    def steps(self, now: Point) -> Iterator[FloatArray]:
        """Newton's step, whole parameters as they are."""
        step = np.zeros(len(now.x))
        step[self.moving] = self._solution(now)
        yield step

    def settled(self, before: Point, now: Point) -> bool:
        """Where they are solved no better."""
        return now is before

    def _right(self, now: Point) -> FloatArray:
        return np.asarray((self.slopes.weights.T @ now.shown)[self.moving])

    def _solution(self, now: Point) -> FloatArray:
        information = self.slopes.information[np.ix_(self.moving, self.moving)]
        return identified_step(information, self._right(now))


def _polished(
    problem: Problem, reference: FitReference, slopes: Slopes, x: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Newton's steps on the equations of the fit, whole parameters as they are, and what is left there."""
    equations = _Equations(problem, reference, slopes)
    start = equations.at(x, np.zeros(len(x)))
    assert start is not None, "the fit stands where there is a sensor"
    end = descend(equations, start, _POLISH if equations.moving.any() else 0)
    return end.x, end.shown


def _score_covariance(
    problem: Problem, reference: FitReference, slopes: Slopes, x: FloatArray, off: FloatArray
) -> tuple[tuple[FloatArray, FloatArray], float]:
    """The covariance of the equations, as the model's noise has it and as the measured columns scatter; the misfit."""
    shown = problem.bench.by_cluster(reference, problem.model(x), "fit", SEEDS)
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


def _quantile() -> float:
    from scipy.special import ndtri

    return float(ndtri(0.5 + 0.5 * LEVEL))


def _told(problem: Problem, one: FitParameter, x: float, loose: bool) -> str:
    """What is to be said of a parameter; one that does nothing any more where it ended is open, too."""
    if one.name in problem.dead:
        return "no effect" if np.isclose(x, one.to_x(one.start)) else "not identified"
    return "not identified" if loose else "fitted"


def _fitted(test: _Test, j: int, spread: float, told: str) -> Fitted:
    one, x = test.problem.free[j], float(test.x[j])
    value = one.start if told == "no effect" else one.to_value(x)
    low, high = one.low, one.high
    if told == "fitted" and one.whole:
        value, low, high = (float(number) for number in _whole_range(test, j))
    elif told == "fitted":
        value = float(f"{value:.6g}")
        low, high = (one.to_value(x + way * _reach(test, j, spread, way)) for way in (-1.0, 1.0))
    return Fitted(one.name, one.unit, one.start, value, low, high, told)


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
    most, x = _quantile(), float(test.x[j])
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
        gained = max(most + way * before - left, 0.25)
        reach *= min(max((most + way * before) / gained, 1.2), 3.0)
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


def _loose(problem: Problem, slopes: Slopes) -> npt.NDArray[np.bool_]:
    """Which parameters take part in a direction that the data leave open, shape (n_free,)."""
    values, vectors, scale = spectrum(slopes.information)
    open_ = vectors[:, values <= INDISTINCT]
    return np.asarray((np.abs(open_) > _TAKES_PART).any(axis=1) & (scale > 0.0))


def _correlation(slopes: Slopes) -> FloatArray:
    """Correlations of the fitted parameters; 0 for those that were not fitted."""
    n = len(slopes.information)
    inverse = np.column_stack([identified_step(slopes.information, row) for row in np.eye(n)])
    spread = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    return np.asarray(np.clip(inverse / np.outer(spread, spread), -1.0, 1.0))


def _unfitted(problem: Problem) -> list[str]:
    return [
        f"{one.name} changes nothing on these frames; it stays at {one.start:g}"
        for one in problem.free
        if one.name in problem.dead
    ]


def _at_bounds(problem: Problem, parameters: Sequence[Fitted]) -> list[str]:
    found = []
    for one, fitted in zip(problem.free, parameters, strict=True):
        if fitted.told == "fitted" and fitted.value in (one.low, one.high):
            found.append(f"{one.name} ends at its bound {fitted.value:g}: the data ask for more than it may be")
    return found


def _confounded(problem: Problem, slopes: Slopes) -> list[str]:
    """The groups of parameters whose effects are the same, or nearly, in words."""
    values, vectors, scale = spectrum(slopes.information)
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        members = [j for j in np.argsort(-np.abs(vector)) if abs(vector[j]) > _TAKES_PART and scale[j] > 0.0]
        if value > _ALIKE or len(members) < 2:
            continue
        names = [problem.free[j].name for j in members]
        together = _together([problem.free[j] for j in members], vector[members])
        if value <= INDISTINCT:
            found.append(f"{_listed(names)} cannot {_all(names)} be fitted: {together}; fix one, as --fix {names[0]}")
        else:
            found.append(f"{_listed(names)} are hard to tell apart: nearly {together}; their intervals say how far")
    return found


def _together(members: Sequence[FitParameter], vector: FloatArray) -> str:
    """What alone shows of parameters that can be moved together, along `vector`, without a change."""
    if not all(one.logarithmic for one in members):
        return "only a combination of them shows"
    if len(members) == 2:
        return "only their product shows" if vector[0] * vector[1] < 0.0 else "only their ratio shows"
    alone = min(np.count_nonzero(vector > 0.0), np.count_nonzero(vector < 0.0)) == 1
    return "only their products show" if alone else "only products and ratios of them show"


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _all(names: Sequence[str]) -> str:
    return "both" if len(names) == 2 else "all"
