"""The descent that every fit uses: damped Gauss-Newton on random simulations.

What is made small is r' C^-1 r, r the measurement less what a model shows. A step solves the normal equations
J' C^-1 J s = J' C^-1 r, damped as K. Levenberg (1944) and D. Marquardt (1963) do, or cut off where the data tell
nothing apart (J. Nocedal and S. Wright, Numerical Optimization, chapter 10). Two things are special to simulations with
common random numbers, and the reason why `scipy.optimize.least_squares` does not serve: slopes are noise where single
beams flip, so that they are taken over wide differences and corrected rather than taken anew (C. Broyden, 1965); and a
step that leads nearer is doubled while it still does, since slopes far from the measurement promise too much.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.inference.metric import Metric
from lidarcheck.workers.threads import mapped

__all__ = [
    "INDISTINCT",
    "Objective",
    "Point",
    "Shows",
    "broyden",
    "damped_step",
    "descend",
    "identified_step",
    "jacobian_at",
    "normal_equations",
    "spectrum",
    "without_flips",
]

Shows = Callable[..., FloatArray | None]
"""What a model shows at a point with so many seeds, (seeds, n_summaries); None where no sensor has such numbers."""

FLIPS = 0.7
"""So much a summary changes, in standard deviations, when single beams' echoes come out otherwise: no slope."""
INDISTINCT = 0.004
"""Where so little of a parameter's own effect is left beside the others', data cannot tell them apart."""
_DOUBLINGS = 3
"""How often a step may be doubled: eight times the length that slopes ask for."""
_LEAST_CURVATURE = 0.5
"""Squared standard deviations per squared step: a direction that shows less drowns in noise."""
_LONGEST_STEP = 7.0
"""Of one number, in its own steps: slopes say nothing farther off."""
_SEEN = 3.0
"""Standard deviations of any summary from which a difference is more than flips, so that no longer one is tried."""
_LENGTHS = (1.0, -1.0, 4.0, 16.0)
"""Differences over which a slope is taken, in steps, one after the other until something is seen."""


@dataclass(frozen=True)
class Point:
    """Where a descent stands: `x` (n_free,) on the fit's scales, what the objective keeps of its simulation there, the
    distance, and the step that led there."""

    x: FloatArray
    shown: FloatArray
    distance: float
    step: FloatArray


class Objective(Protocol):
    """What is made small, and by which steps."""

    worth_doubling: float
    """A step that makes the distance less by more than this part is tried twice as long; infinite: none is."""

    def look(self, now: Point, step: FloatArray) -> Point | None:
        """What is there a step from a point, within bounds; None where no sensor has such numbers."""

    def steps(self, now: Point) -> Iterable[FloatArray]:
        """The steps to try from a point, each only if those before it lead no nearer; none: it is not worth one."""

    def settled(self, before: Point, now: Point) -> bool:
        """Whether the descent ends after a round, which stayed where it was if `now` is `before`."""


def descend(objective: Objective, start: Point, rounds: int) -> Point:
    """Where at most so many steps lead, each of them taken only if it leads nearer."""
    now = start
    for _ in range(rounds):
        before, now = now, _nearer(objective, now)
        if objective.settled(before, now):
            break
    return now


def _nearer(objective: Objective, now: Point) -> Point:
    """A step on, or the same point where no step leads nearer."""
    for step in objective.steps(now):
        found = objective.look(now, step)
        if found is not None and found.distance < now.distance:
            much = now.distance - found.distance > objective.worth_doubling * now.distance
            return _farther(objective, now, found) if much else found
    return now


def _farther(objective: Objective, now: Point, found: Point) -> Point:
    """The step that led nearer, doubled while that leads nearer still."""
    for _ in range(_DOUBLINGS):
        longer = objective.look(now, 2.0 * found.step)
        if longer is None or longer.distance >= found.distance:
            break
        found = longer
    return found


def normal_equations(metric: Metric, jacobian: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J' C^-1 J and J' C^-1 r, for `jacobian` (n_summaries, n_free) and `residual` (n_summaries,)."""
    weighted = metric.times(jacobian)
    return jacobian.T @ weighted, weighted.T @ residual


def damped_step(curvature: FloatArray, slope: FloatArray, damping: float) -> FloatArray:
    """The step with each number's curvature enlarged by a part; directions in which it drowns in noise stay short."""
    diagonal = np.maximum(np.diag(curvature), 0.0)
    damped = 0.5 * (curvature + curvature.T) + np.diag(damping * diagonal + _LEAST_CURVATURE)
    values, vectors = np.linalg.eigh(damped)
    values = np.maximum(values, _LEAST_CURVATURE)
    return np.asarray(np.clip(vectors @ ((vectors.T @ slope) / values), -_LONGEST_STEP, _LONGEST_STEP))


def identified_step(information: FloatArray, right: FloatArray) -> FloatArray:
    """The step with nothing along directions that the data cannot tell apart, and nothing of what has no effect."""
    values, vectors, scale = spectrum(information)
    keep = values > INDISTINCT
    inverse = np.where(keep, 1.0 / np.where(keep, values, 1.0), 0.0)
    return np.asarray(scale * (vectors @ (inverse * (vectors.T @ (scale * right)))))


def spectrum(information: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Eigenvalues and vectors of the information with each parameter's own as the unit, and these units, 0 for none."""
    diagonal = np.diag(information)
    alive = diagonal > 0.0
    scale = np.where(alive, 1.0 / np.sqrt(np.where(alive, diagonal, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    return values, vectors, scale


def jacobian_at(shows: Shows, at: FloatArray, shown: FloatArray, lengths: Sequence[float] = _LENGTHS) -> FloatArray:
    """Change of the summaries per step with the first seed, shape (n_summaries, n_free).

    One beam that flips makes small steps useless: where a step changes little, a longer one is taken, and what is no
    larger than such flips is taken for chance. `shown`: what is shown `at` the point itself.
    """
    columns = mapped(lambda j: _column(shows, at, shown, j, lengths), range(len(at)))
    return np.array(columns).T.reshape(shown.shape[1], len(at)).copy()


def _column(shows: Shows, at: FloatArray, shown: FloatArray, j: int, lengths: Sequence[float]) -> FloatArray:
    """Change of the summaries per step of the j-th number, shape (n_summaries,)."""
    found = np.zeros(shown.shape[1])
    for length in lengths:
        there = at.copy()
        there[j] += length
        other = shows(there, 1)
        if other is None:
            continue
        change = other[0] - shown[0]
        found = without_flips(change) / length
        if np.abs(change).max(initial=0.0) > _SEEN:
            break
    return found


def broyden(jacobian: FloatArray, step: FloatArray, change: FloatArray) -> FloatArray:
    """The Jacobian corrected by what a step has really changed, shape (n_summaries, n_free)."""
    missed = without_flips(change - jacobian @ step)
    return jacobian + np.outer(missed, step) / max(float(step @ step), 1e-12)


def without_flips(change: FloatArray, sizes: FloatArray | None = None) -> FloatArray:
    """A change without what single beams make that flip. `sizes`: the change in standard deviations, where it is not
    in these itself; same shape."""
    return np.where(np.abs(change if sizes is None else sizes) > FLIPS, change, 0.0)
