"""From where a fit stands towards the measurement: the rounds' descent, whole numbers, and the last fit's equations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.parameters.fit_data import FitReference
from lidarcheck.calibration.parameters.problem import Problem, point_at, residual
from lidarcheck.calibration.parameters.slopes import Slopes, slopes_at
from lidarcheck.inference import optimiser
from lidarcheck.inference.optimiser import Point, identified_step

__all__ = ["descend", "polished"]

Progress = Callable[[str], object]

_CHANCE = 1.5
"""A step that gains less for each parameter, in squared standard deviations, follows noise; the last fit takes it."""
_LONGEST = 1.5
"""The longest step of a logarithm: a factor of 4.5 is as far as slopes can be trusted."""
_MOST_TRIES, _SHORTER = 4, 0.4
"""Steps that are tried in one direction, each shorter by this factor, until one leads nearer."""
_LEAST_GAIN = 1.0
"""What a step must gain, in squared standard deviations, so that another one is worth its simulations."""
_POLISH = 3
"""Newton's steps of the last fit, which begins where the rounds end."""


class _Descent:
    """Towards the measurement in all free parameters, whole ones rounded on the way. `progress` hears of each step."""

    worth_doubling = float("inf")

    def __init__(self, problem: Problem, reference: FitReference, steps: int, progress: Progress) -> None:
        self.problem, self.reference = problem, reference
        self._most, self._done, self._progress = steps, 0, progress

    def look(self, now: Point, step: FloatArray) -> Point | None:
        """See `Objective.look`; what is kept is the residual."""
        return point_at(self.problem, self.reference, self.problem.within(now.x + step), step)

    def steps(self, now: Point) -> Iterator[FloatArray]:
        """The step that slopes ask for, then shorter ones; none where it promises no more than noise."""
        self._done += 1
        self._progress(f"step {self._done} of at most {self._most}")
        slopes = slopes_at(self.problem, self.reference, now.x)
        right = slopes.weights.T @ now.shown
        step = identified_step(slopes.information, right)
        if right @ step < _CHANCE * len(now.x):
            return
        step = _limited(self.problem, step)
        for _ in range(_MOST_TRIES):
            yield _settled(self.problem, slopes, now, step)
            step = _SHORTER * step

    def settled(self, before: Point, now: Point) -> bool:
        """Where no step leads nearer, or by less than one standard error of one parameter."""
        return now is before or before.distance - now.distance < _LEAST_GAIN


def descend(problem: Problem, reference: FitReference, x: FloatArray, *, steps: int, progress: Progress) -> FloatArray:
    """Some steps towards the measurement, each of them taken only if it brings the model nearer."""
    start = point_at(problem, reference, problem.within(x), np.zeros(len(x)))
    assert start is not None, "the fit stands where there is a sensor"
    end = optimiser.descend(_Descent(problem, reference, steps, progress), start, steps)
    return _whole_steps(problem, reference, end.x)


def _whole_steps(problem: Problem, reference: FitReference, x: FloatArray) -> FloatArray:
    """Whole parameters one by one, as long as that brings the model nearer: slopes differ from number to number."""
    off = residual(problem, reference, x)
    best = np.inf if off is None else reference.metric.inner(off, off)
    for j in np.flatnonzero([one.whole and one.name not in problem.dead for one in problem.free]):
        for way in (-1.0, 1.0):
            while True:
                trial = x.copy()
                trial[j] += way
                there = residual(problem, reference, problem.within(trial))
                far = np.inf if there is None else reference.metric.inner(there, there)
                if far >= best or problem.within(trial)[j] == x[j]:
                    break
                x, best = trial, far
    return x


def _limited(problem: Problem, step: FloatArray) -> FloatArray:
    """No step leads farther than slopes can be trusted."""
    wide = [max(4.0, 4.0 * problem.steps.get(one.name, 1.0)) for one in problem.free]
    most = np.array([_LONGEST if o.logarithmic else w for o, w in zip(problem.free, wide, strict=True)])
    return np.asarray(np.clip(step, -most, most))


def _settled(problem: Problem, slopes: Slopes, now: Point, step: FloatArray) -> FloatArray:
    """The step with whole parameters rounded, the others where they then fit best."""
    whole = np.array([one.whole for one in problem.free])
    if not whole.any() or whole.all():
        return step
    inner = ~whole
    moved = np.where(whole, np.rint(now.x + step) - now.x, 0.0)
    rest = slopes.weights.T @ now.shown - slopes.information @ moved
    best = identified_step(slopes.information[np.ix_(inner, inner)], rest[inner])
    length, asked = float(np.linalg.norm(best)), float(np.linalg.norm(step[inner]))
    moved[inner] = best * min(asked / max(length, 1e-12), 1.0)
    return moved


class _Equations:
    """The equations of the fit with slopes as they are, to be solved in the `moving` parameters."""

    worth_doubling = float("inf")

    def __init__(self, problem: Problem, reference: FitReference, slopes: Slopes, seeds: int) -> None:
        self.problem, self.reference, self.slopes, self.seeds = problem, reference, slopes, seeds
        self.moving = problem.active() & ~np.array([one.whole for one in problem.free])

    def at(self, x: FloatArray, step: FloatArray) -> Point | None:
        """The residual at a point, and how far the equations are from being solved, in squared standard errors."""
        found = point_at(self.problem, self.reference, x, step, self.seeds)
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


def polished(
    problem: Problem, reference: FitReference, slopes: Slopes, x: FloatArray, seeds: int
) -> tuple[FloatArray, FloatArray]:
    """Newton's steps on the equations of the fit, whole parameters as they are, and the residual there, with so many
    seeds."""
    equations = _Equations(problem, reference, slopes, seeds)
    start = equations.at(x, np.zeros(len(x)))
    assert start is not None, "the fit stands where there is a sensor"
    end = optimiser.descend(equations, start, _POLISH if equations.moving.any() else 0)
    return end.x, end.shown
