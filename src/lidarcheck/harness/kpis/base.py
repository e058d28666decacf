"""What a kind of KPI is, and the statistics that kinds are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.harness.kpis.selection import KpiInput
from lidarcheck.harness.kpis.spec import Direction, GateKind

__all__ = [
    "KpiKind",
    "distance_kind",
    "proportion_kind",
    "quantile",
    "share",
    "slope",
    "spread_between",
    "standard_deviation",
]

Needs = Literal["beams", "surface", "edge"]
"""What a kind must find in its selection: any beam, one that meets a surface, one beside surfaces at two ranges."""


@dataclass(frozen=True, slots=True)
class KpiKind:
    """One kind of KPI: either `value`, a number per seed, or `sample`, whose distribution's distance is taken.

    `trials`: of a proportion. `needs`: without it in the selection the kind means nothing. `of_number`: it is of one
    echo number, which the scenario names. `of_place`: it rests on the surface points, not on ranges alone. `meaning`:
    one line for help and documentation. `of_feature`: it is of a feature that the scenario names, whose unit it has;
    `column`: the feature that the sensor must report for it, empty where it needs none.
    """

    meaning: str
    unit: str
    direction: Direction = "target"
    gate: GateKind = "mean"
    value: Callable[[KpiInput], float] | None = None
    trials: Callable[[KpiInput], int] | None = None
    sample: Callable[[KpiInput], FloatArray] | None = None
    needs: Needs = "surface"
    of_number: bool = False
    of_place: bool = False
    of_feature: bool = False
    column: str = ""


def distance_kind(meaning: str, unit: str, sample: Callable[[KpiInput], FloatArray]) -> KpiKind:
    """The distance of a feature's distribution from the golden's."""
    return KpiKind(f"1-Wasserstein distance of the {meaning} distribution", unit, "lower", "distance", sample=sample)


def proportion_kind(
    meaning: str, part: Callable[[KpiInput], int], whole: Callable[[KpiInput], int], *, needs: Needs = "surface"
) -> KpiKind:
    """The share of beams that something is true of; the whole are the trials of a binomial draw."""
    return KpiKind(
        meaning, "1", gate="proportion", value=lambda seen: share(part(seen), whole(seen)), trials=whole, needs=needs
    )


def share(part: float, whole: float) -> float:
    """Part over whole; NaN where there is no whole."""
    return part / whole if whole else float("nan")


def standard_deviation(values: npt.NDArray[Any]) -> float:
    """With n - 1; NaN for fewer than two values."""
    return float(values.std(ddof=1)) if len(values) > 1 else float("nan")


def quantile(values: FloatArray, level: float) -> float:
    """Linear between the values; NaN without any."""
    return float(np.quantile(values, level)) if len(values) else float("nan")


def slope(x: npt.NDArray[Any], y: FloatArray) -> float:
    """Of the straight line of least squares, y over x; NaN for fewer than three points, or where all x are equal."""
    if len(x) < 3 or x.min() == x.max():
        return float("nan")
    off = x - x.mean()
    return float((off * (y - y.mean())).sum() / (off * off).sum())


def spread_between(values: FloatArray, group: npt.NDArray[Any]) -> float:
    """Standard deviation between groups' true means, what scatters within them taken off; 0 where chance explains all.

    The analysis-of-variance estimator of a one-way random model (Searle, Casella and McCulloch, Variance Components,
    1992, ch. 3), cut at 0. NaN for fewer than two groups, or where no group has two values.
    """
    _, index, count = np.unique(group, return_inverse=True, return_counts=True)
    n, k = len(values), len(count)
    if k < 2 or n <= k:
        return float("nan")
    means = np.bincount(index, weights=values) / count
    within = float(((values - means[index]) ** 2).sum()) / (n - k)
    between = float((count * (means - values.mean()) ** 2).sum()) / (k - 1)
    size = (n - float((count**2).sum()) / n) / (k - 1)
    return float(np.sqrt(max((between - within) / size, 0.0)))
