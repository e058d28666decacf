"""What the empirical terms share: piecewise-linear functions of what is known of a pulse, an echo or a beam.

They are additive models of at most two covariates (Hastie and Tibshirani, *Generalized Additive Models*, 1990), with
linear splines for the smooth parts, so that what was fitted can be read off a model file knot by knot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect, choice_parameter, list_parameter
from lidarcheck.effects.empirical.covariates import COVARIATES, ECHO_COVARIATES
from lidarcheck.errors import UsageError
from lidarcheck.sensor import Sensor, SpadArray

__all__ = [
    "NOT_COUNTED",
    "Additive",
    "Column",
    "Term",
    "beyond_parameter",
    "covariate_parameter",
    "knots_parameter",
    "uncounted",
    "values_parameter",
]

NOT_COUNTED = "it reports no PEAK, AREA and WIDTH"
"""Why terms of what a SPAD array counts mean nothing for another detector."""

Column = Callable[[str], FloatArray]
"""A covariate's values by its name, NaN where it is not known."""

_KNOT_LIMIT = 2.2e9
"""Beyond every range, angle and beam, and beyond the largest number that a material may have."""


def covariate_parameter(meaning: str, *, echo: bool = True, example: str | None = None) -> Any:
    """Declare which covariate a function is of; `echo`: what only an echo has is one too."""
    return choice_parameter(ECHO_COVARIATES if echo else COVARIATES, meaning=meaning, example=example)


def knots_parameter(meaning: str, *, example: tuple[float, ...] = ()) -> Any:
    """Declare where a function has its values."""
    limit = _KNOT_LIMIT
    return list_parameter("", low=-limit, high=limit, ascending=True, meaning=meaning, example=example)


def values_parameter(unit: str, limit: float, meaning: str, *, example: tuple[float, ...] = ()) -> Any:
    """Declare the values of a function at its knots, from -limit to limit."""
    return list_parameter(unit, low=-limit, high=limit, meaning=meaning, example=example)


def beyond_parameter() -> Any:
    """Declare how f goes on outside of its knots."""
    return choice_parameter(("constant", "repeats"), meaning="how f goes on beyond its knots", option=True)


@dataclass(frozen=True, slots=True)
class Term:
    """A function of one covariate: `values` at `knots`, shapes (n,) with n >= 1, the knots ascending.

    Linear between the knots and constant outside, or, if it `repeats`, the same over and over, with the distance of the
    last knot from the first as its period; of materials, whose numbers have no order, the value of that very number and
    0 for all others. 0 where the covariate is not known.
    """

    covariate: str
    knots: tuple[float, ...]
    values: tuple[float, ...]
    repeats: bool = False

    def at(self, covariate: FloatArray) -> FloatArray:
        """The function there, same shape."""
        knots, values = np.array(self.knots), np.array(self.values)
        if self.covariate == "material_id":
            place = np.minimum(np.searchsorted(knots, covariate), len(knots) - 1)
            return np.where(knots[place] == covariate, values[place], 0.0)
        if self.repeats:
            covariate = knots[0] + np.mod(covariate - knots[0], knots[-1] - knots[0])
        return np.where(np.isnan(covariate), 0.0, np.interp(covariate, knots, values))


def uncounted(sensor: Sensor) -> str:
    """Why terms of what a SPAD array counts mean nothing for a sensor; empty where it counts."""
    return "" if isinstance(sensor, SpadArray) else NOT_COUNTED


class Additive(Effect):
    """An empirical term: f(u) + g(v) from the fields `covariate`, `knots`, `values` and those with `_2` behind them.

    f repeats beyond its knots where a field `beyond` says so.
    """

    empirical = True
    suffixes: ClassVar[tuple[str, ...]] = ("", "_2")
    """What stands behind the fields' names, a suffix a function."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for suffix in self.suffixes:
            self._check(suffix)
        first = self.term("")
        if first is not None and first.repeats and (len(first.knots) < 2 or first.covariate == "material_id"):
            what = "a material's number" if first.covariate == "material_id" else "a single knot"
            raise UsageError(f"{self.name}: {what} has no period to repeat", fix="leave beyond out, or give two knots")

    def term(self, suffix: str) -> Term | None:
        """The function whose fields have this suffix; None where the model has none."""
        covariate, knots, values = (getattr(self, f"{part}{suffix}") for part in ("covariate", "knots", "values"))
        repeats = not suffix and getattr(self, "beyond", None) == "repeats"
        return Term(covariate, knots, values, repeats) if knots else None

    def is_zero(self) -> bool:
        """Whether all functions are 0 everywhere."""
        terms = (self.term(suffix) for suffix in self.suffixes)
        return not any(any(term.values) for term in terms if term is not None)

    def total(self, column: Column, n: int, suffixes: tuple[str, ...] = ("", "_2")) -> FloatArray:
        """The sum of the functions with these suffixes, shape (n,)."""
        terms = [term for suffix in suffixes if (term := self.term(suffix)) is not None]
        return np.asarray(sum((term.at(column(term.covariate)) for term in terms), np.zeros(n)))

    def _check(self, suffix: str) -> None:
        """Refuse a function that is said in part."""
        names = tuple(f"{part}{suffix}" for part in ("covariate", "knots", "values"))
        given = [name for name in names if getattr(self, name)]
        lacking = [name for name in names if not getattr(self, name)]
        if given and lacking:
            raise UsageError(
                f"{self.name}: {given[0]} stands without {' and '.join(lacking)}",
                fix=f"give {', '.join(names)} together, or none of them",
            )
        knots, values = len(getattr(self, names[1])), len(getattr(self, names[2]))
        if knots != values:
            raise UsageError(
                f"{self.name}: {names[2]} has {values} numbers for {knots} knots", fix="give each knot a value"
            )
