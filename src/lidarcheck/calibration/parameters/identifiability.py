"""Which parameters the data leave open or cannot tell apart, and what else is to be said of a fit, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.parameters.fitted import FitParameter, Fitted
from lidarcheck.calibration.parameters.problem import Problem
from lidarcheck.calibration.parameters.slopes import Slopes
from lidarcheck.inference.optimiser import INDISTINCT, spectrum

__all__ = ["confounded", "open_parameters", "warnings_of"]


_ALIKE = 0.05
"""Where so little of a parameter's own effect is left beside the others', they are hard to tell apart."""
_TAKES_PART = 0.15
"""A parameter with a smaller part in a direction, a unit vector, is no member of it."""


def warnings_of(problem: Problem, slopes: Slopes, parameters: Sequence[Fitted]) -> tuple[str, ...]:
    """What changes nothing, what cannot be told apart, and what ends at its bound, in words."""
    return (*_unfitted(problem), *confounded(problem, slopes), *_at_bounds(problem, parameters))


def open_parameters(problem: Problem, slopes: Slopes) -> npt.NDArray[np.bool_]:
    """Which parameters take part in a direction that the data leave open, shape (n_free,)."""
    values, vectors, scale = spectrum(slopes.information)
    directions = vectors[:, values <= INDISTINCT]
    return np.asarray((np.abs(directions) > _TAKES_PART).any(axis=1) & (scale > 0.0))


def _unfitted(problem: Problem) -> list[str]:
    return [
        f"{one.name} changes nothing on these frames; it stays at {one.start:g}"
        for one in problem.free
        if one.name in problem.dead
    ]


def _at_bounds(problem: Problem, parameters: Sequence[Fitted]) -> list[str]:
    found = []
    for one, fitted in zip(problem.free, parameters, strict=True):
        if fitted.status == "fitted" and fitted.value in (one.low, one.high):
            found.append(f"{one.name} ends at its bound {fitted.value:g}: the data ask for more than it may be")
    return found


def confounded(problem: Problem, slopes: Slopes) -> list[str]:
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
            found.append(
                f"{_listed(names)} cannot {_both_or_all(names)} be fitted: {together}; fix one, as --fix {names[0]}"
            )
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


def _both_or_all(names: Sequence[str]) -> str:
    return "both" if len(names) == 2 else "all"
