"""What the gate speaks of: a KPI's reference, a run's sample, a verdict and its evidence. And the error budget."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

__all__ = [
    "ERROR_BUDGET",
    "FIRST_SEEDS",
    "FULL_SEEDS",
    "GATE_LEVEL",
    "NULL_LEVELS",
    "PAIRED_SEEDS",
    "KpiEvidence",
    "KpiVerdict",
    "Reference",
    "Sample",
    "error_share",
    "mean_sd",
    "null_quantiles",
    "null_rank",
    "worst",
]

ERROR_BUDGET = 1e-3
PAIRED_SEEDS, FIRST_SEEDS, FULL_SEEDS = 8, 16, 64
NULL_LEVELS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
GATE_LEVEL = NULL_LEVELS.index(0.95)
_REFERENCES = 2
_LOOKS = 4  # paired, full, noise, limit


class KpiVerdict(StrEnum):
    """What a comparison says of one KPI, in the order of weight."""

    IDENTICAL = "identical"
    EQUIVALENT = "equivalent"
    CHANGED = "changed"
    IMPROVED = "improved"
    INDETERMINATE = "indeterminate"
    REGRESSED = "regressed"
    MISSING = "missing"

    @property
    def fails(self) -> bool:
        """Whether it fails a run."""
        return self in (KpiVerdict.INDETERMINATE, KpiVerdict.REGRESSED, KpiVerdict.MISSING)


def worst(verdicts: Sequence[KpiVerdict]) -> KpiVerdict:
    """The one that weighs most; IDENTICAL of none."""
    order = list(KpiVerdict)
    return max(verdicts, key=order.index, default=KpiVerdict.IDENTICAL)


@dataclass(frozen=True, slots=True)
class Reference:
    """What a golden knows of one KPI.

    `mean`, `sd` over the `seeds` seeds that gave a value, of `drawn` that were run; `paired`: of the first 8;
    `trials`: per seed, for proportions; `null`: for distances, order statistics of the per-seed distances at
    `NULL_LEVELS`.
    """

    mean: float
    sd: float
    seeds: int
    drawn: int
    paired: tuple[float, ...]
    trials: float = 0.0
    null: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Sample:
    """What a run measured of one KPI: a value per fresh seed (nan where there is none) and per paired seed.

    `known`: in place of fresh values, what a golden knows of the seeds that it was made of, where the run has shown
    that its model is still that one.
    """

    fresh: tuple[float, ...]
    paired: tuple[float, ...] = ()
    trials: float = 0.0
    known: Reference | None = None

    @property
    def finite(self) -> tuple[float, ...]:
        """The fresh values that are numbers."""
        return tuple(value for value in self.fresh if math.isfinite(value))

    @property
    def drawn(self) -> int:
        """How many seeds were run."""
        return self.known.drawn if self.known else len(self.fresh)

    @property
    def seeds(self) -> int:
        """How many of them gave a value."""
        return self.known.seeds if self.known else len(self.finite)

    @property
    def mean_sd(self) -> tuple[float, float]:
        """Mean and standard deviation of those values."""
        return (self.known.mean, self.known.sd) if self.known else mean_sd(self.finite)


@dataclass(frozen=True, slots=True)
class KpiEvidence:
    """A comparison with one reference, in the KPI's unit.

    `delta`: new - old mean; `margin`: t·SE, what chance alone explains (nan where counts decide); `seeds`: fresh seeds
    that gave a value; `smallest`: the smallest change that 64 seeds would catch with 95 % power; `paired_delta`,
    `paired_margin`: the same for the paired seeds (nan where they prove nothing); `note`: what decided.
    """

    verdict: KpiVerdict
    delta: float
    margin: float
    smallest: float
    seeds: int
    paired_delta: float = math.nan
    paired_margin: float = math.nan
    note: str = ""


def error_share(kpis: int) -> float:
    """The error that one test may make, given the number of KPIs in the whole suite."""
    return ERROR_BUDGET / (max(kpis, 1) * _REFERENCES * _LOOKS)


def null_quantiles(distances: Sequence[float]) -> tuple[float, ...]:
    """The order statistics of the finite distances at `NULL_LEVELS`; empty if there are none."""
    ordered = sorted(value for value in distances if math.isfinite(value))
    return tuple(ordered[math.ceil(level * len(ordered)) - 1] for level in NULL_LEVELS) if ordered else ()


def null_rank(reference: Reference) -> tuple[int, int]:
    """(rank from the top of the order statistic at the gate's level, number of null values)."""
    return reference.seeds - math.ceil(NULL_LEVELS[GATE_LEVEL] * reference.seeds) + 1, reference.seeds


def mean_sd(values: Sequence[float]) -> tuple[float, float]:
    """Mean and standard deviation; nan of none, and a deviation of 0 of one."""
    array = np.asarray(values, dtype=np.float64)
    if array.size < 2:
        return (float(array.mean()) if array.size else math.nan), 0.0
    return float(array.mean()), float(array.std(ddof=1))
