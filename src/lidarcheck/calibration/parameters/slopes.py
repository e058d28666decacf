"""Slopes of the statistics, by wide differences with common random numbers.

They are taken twice, with two sets of seeds. A product of both is free of the noise that single beams' flips leave in
each; with one set alone slopes would look steeper, and intervals narrower, than they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.parameters.fit_data import FitReference
from lidarcheck.calibration.parameters.fitted import FitParameter
from lidarcheck.calibration.parameters.problem import Problem, first_step
from lidarcheck.inference.optimiser import without_flips

__all__ = ["Slopes", "slopes_at"]


_CLEAR, _FAR = 15.0, 150.0
"""A difference is wide enough from so many standard deviations of all statistics on, and too wide beyond."""
_NOTHING = 5.0
"""What shows no more over the widest difference is taken for no effect; only for such a one is it that wide."""
_OWN = 1000
"""Where the seeds of slopes begin, apart from those of residuals."""


@dataclass(frozen=True)
class Slopes:
    """Slopes of the statistics, (n_statistics, n_free), and what follows: the weights of the statistics in the
    equations of the fit (same shape), and the slope of these equations (n_free, n_free), which is the information."""

    slope: FloatArray
    weights: FloatArray
    information: FloatArray


def slopes_at(problem: Problem, reference: FitReference, x: FloatArray, *, pairs: int = 1) -> Slopes:
    """Slopes at a point; `pairs`: seeds of each of the two sets. Finds out which parameters change nothing."""
    # Seeds that residuals do not use: noise in the weights must not meet its own in what they weigh.
    sets = [range(_OWN, _OWN + pairs), range(_OWN + pairs, _OWN + 2 * pairs)]
    found = np.zeros((2, len(reference.measured), len(problem.free)))
    problem.look(reference, _first_ends(problem, x, [k for seeds in sets for k in seeds]))
    for j, one in enumerate(problem.free):
        if one.name not in problem.dead:
            found[:, :, j] = _slope(problem, reference, x, j, sets)
    clear = [without_flips(part, part * _width(problem, reference)) for part in found]
    metric = reference.metric
    information = 0.5 * (clear[0].T @ metric.times(found[1]) + clear[1].T @ metric.times(found[0]))
    weights = metric.times(0.5 * (clear[0] + clear[1]))
    return Slopes(found.mean(axis=0), weights, 0.5 * (information + information.T))


def _first_ends(problem: Problem, x: FloatArray, seeds: Sequence[int]) -> list[tuple[FloatArray, int]]:
    """Where the slopes begin to look along each parameter: the more at once, the more can work on it."""
    ends = [
        end
        for j, one in enumerate(problem.free)
        if one.name not in problem.dead
        for end in _ends(problem, x, j, problem.steps.get(one.name, first_step(one)))
    ]
    return [(end, k) for end in ends for k in seeds]


def _width(problem: Problem, reference: FitReference) -> FloatArray:
    """Turns slopes into differences in standard deviations of each statistic, (n_statistics, n_free)."""
    width = np.array([problem.steps.get(one.name, 1.0) for one in problem.free])
    return np.asarray(width / reference.metric.spread[:, None])


def _slope(
    problem: Problem, reference: FitReference, x: FloatArray, j: int, sets: Sequence[Sequence[int]]
) -> FloatArray:
    """The slope along one parameter with each set of seeds, (2, n_statistics)."""
    one = problem.free[j]
    step = problem.steps.get(one.name, first_step(one))
    tried: dict[float, tuple[FloatArray, float]] = {}
    while step not in tried:
        tried[step] = _difference(problem, reference, x, j, step, sets)
        seen = tried[step][1]
        if seen < _CLEAR:
            step = max(step, min(3.0 * step, _widest(one) if seen < _NOTHING else 4.0 * first_step(one)))
        elif seen > _FAR:
            step = max(step / 3.0, _narrowest(one))
    clear = [s for s, (_, seen) in tried.items() if seen >= _CLEAR]
    step = min(clear) if clear else max(tried)
    problem.steps[one.name] = step
    if tried[step][1] < _NOTHING:
        problem.dead.add(one.name)
        return np.zeros((2, len(reference.measured)))
    return tried[step][0]


def _difference(
    problem: Problem, reference: FitReference, x: FloatArray, j: int, step: float, sets: Sequence[Sequence[int]]
) -> tuple[FloatArray, float]:
    """Slopes over a central difference, and how large it is in standard deviations, by the product of both sets."""
    ends = _ends(problem, x, j, step)
    width = ends[1][j] - ends[0][j]
    if width <= 0.0:
        return np.zeros((2, len(reference.measured))), 0.0
    problem.look(reference, [(end, k) for end in ends for seeds in sets for k in seeds])
    rows = []
    for seeds in sets:
        changes = [_change(problem, reference, ends, k) for k in seeds]
        rows.append(np.mean([c for c in changes if c is not None] or [np.zeros(len(reference.measured))], axis=0))
    seen = np.sqrt(max(reference.metric.inner(rows[0], rows[1]), 0.0))
    return np.array(rows) / width, float(seen)


def _ends(problem: Problem, x: FloatArray, j: int, step: float) -> list[FloatArray]:
    """The points a step below and above along one parameter, within its bounds."""
    ends = []
    for sign in (-1.0, 1.0):
        there = x.copy()
        there[j] += sign * step
        ends.append(problem.within(there))
    return ends


def _change(problem: Problem, reference: FitReference, ends: Sequence[FloatArray], k: int) -> FloatArray | None:
    low, high = (problem.shows(reference, end, k) for end in ends)
    return None if low is None or high is None else high - low


def _narrowest(one: FitParameter) -> float:
    return 1.0 if one.whole else 1e-3


def _widest(one: FitParameter) -> float:
    low, high = one.ends
    return min(9.0 if one.whole else 1.0 if one.logarithmic else 20.0, 0.5 * (high - low))
