"""Gauss-Newton on statistics with common random numbers: slopes by wide differences, steps that are taken if they help.

Slopes are taken twice, with two sets of seeds. A product of both is free of the noise that single beams' flips leave
in each; with one set alone slopes would look steeper, and intervals narrower, than they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from lidarcheck.calibration.parameters.bench import FitData, FitReference
from lidarcheck.calibration.parameters.parameters import FitParameter, with_values
from lidarcheck.errors import UsageError
from lidarcheck.inference import optimiser
from lidarcheck.inference.optimiser import Point, identified_step, without_flips
from lidarcheck.model.spec import Model

__all__ = ["Problem", "Slopes", "descend", "point_at", "residual", "slopes_at"]

FloatArray = npt.NDArray[np.float64]
Told = Callable[[str], object]

SEEDS = 3
"""Simulations whose mean stands for what a model shows, while a round is under way."""
_CLEAR, _FAR = 15.0, 150.0
"""A difference is wide enough from so many standard deviations of all statistics on, and too wide beyond."""
_NOTHING = 5.0
"""What shows no more over the widest difference is taken for no effect; only for such a one is it that wide."""
_OWN = 1000
_CHANCE = 1.5
"""A step that gains less for each parameter, in squared standard deviations, follows noise; the last fit takes it."""
_LONGEST = 1.5
"""The longest step of a logarithm: a factor of 4.5 is as far as slopes can be trusted."""
_MOST_TRIES, _SHORTER = 4, 0.4
"""Steps that are tried in one direction, each shorter by this factor, until one leads nearer."""
_LEAST_GAIN = 1.0
"""What a step must gain, in squared standard deviations, so that another one is worth its simulations."""


@dataclass
class Problem:
    """What is fitted to what. `steps`: how wide a difference of each parameter is, on its scale; kept from round to
    round. `dead`: parameters that change nothing on these data."""

    bench: FitData
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
        return self.within(self.start() + np.array([_first_step(one) for one in self.free]))

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
        found = self.bench.totals(reference, there.values())
        self._shown |= dict.fromkeys(new) | dict(zip(there, found, strict=True))

    def _sensor(self, x: FloatArray) -> Model | None:
        """The model at a point; None where no sensor has such numbers."""
        try:
            return self.model(x)
        except UsageError:
            return None


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
        for end in _ends(problem, x, j, problem.steps.get(one.name, _first_step(one)))
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
    step = problem.steps.get(one.name, _first_step(one))
    tried: dict[float, tuple[FloatArray, float]] = {}
    while step not in tried:
        tried[step] = _difference(problem, reference, x, j, step, sets)
        seen = tried[step][1]
        if seen < _CLEAR:
            step = max(step, min(3.0 * step, _widest(one) if seen < _NOTHING else 4.0 * _first_step(one)))
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


def _first_step(one: FitParameter) -> float:
    return 1.0 if one.whole else 0.1 if one.logarithmic else 0.25


def _narrowest(one: FitParameter) -> float:
    return 1.0 if one.whole else 1e-3


def _widest(one: FitParameter) -> float:
    low, high = one.ends
    return min(9.0 if one.whole else 1.0 if one.logarithmic else 20.0, 0.5 * (high - low))


def residual(problem: Problem, reference: FitReference, x: FloatArray, seeds: int = SEEDS) -> FloatArray | None:
    """Measured less what the model shows on average; None where no sensor has such numbers."""
    problem.look(reference, [(x, k) for k in range(seeds)])
    shown = [problem.shows(reference, x, k) for k in range(seeds)]
    if shown[0] is None:
        return None
    return np.asarray(reference.measured - np.mean([s for s in shown if s is not None], axis=0))


class _Descent:
    """Towards the measurement in all free parameters, whole ones rounded on the way. `told`: hears of each step."""

    worth_doubling = float("inf")

    def __init__(self, problem: Problem, reference: FitReference, steps: int, told: Told) -> None:
        self.problem, self.reference = problem, reference
        self._most, self._done, self._told = steps, 0, told

    def look(self, now: Point, step: FloatArray) -> Point | None:
        """See `Objective.look`; what is kept is the residual."""
        return point_at(self.problem, self.reference, self.problem.within(now.x + step), step)

    def steps(self, now: Point) -> Iterator[FloatArray]:
        """The step that slopes ask for, then shorter ones; none where it promises no more than noise."""
        self._done += 1
        self._told(f"step {self._done} of at most {self._most}")
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


def point_at(
    problem: Problem, reference: FitReference, x: FloatArray, step: FloatArray, seeds: int = SEEDS
) -> Point | None:
    """A point of a descent with its residual; None where no sensor has such numbers."""
    off = residual(problem, reference, x, seeds)
    return None if off is None else Point(x, off, reference.metric.square(off), step)


def descend(problem: Problem, reference: FitReference, x: FloatArray, *, steps: int, told: Told) -> FloatArray:
    """Some steps towards the measurement, each of them taken only if it brings the model nearer."""
    start = point_at(problem, reference, problem.within(x), np.zeros(len(x)))
    assert start is not None, "the fit stands where there is a sensor"
    end = optimiser.descend(_Descent(problem, reference, steps, told), start, steps)
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
