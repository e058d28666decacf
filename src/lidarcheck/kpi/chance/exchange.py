"""Exchanging the two sides unit by unit: the signs of the exchanges, and what stands out from their values.

Where the two sides are alike, whichever is called measured is chance, unit by unit. So the sides are exchanged in half
of the units, drawn anew each time, and a KPI is held against what it then is (a permutation test; Good, *Permutation,
Parametric and Bootstrap Tests of Hypotheses*, 2005). Units are whole, since one lost packet or a shake moves many beams
at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = ["EXCHANGES", "FEWEST_UNITS", "LEVEL", "Drawn", "Judgement", "judge", "signs_of"]

EXCHANGES = 499
"""Beside the observed one: the 95 % are then the 475th of 500."""
FEWEST_UNITS = 8
"""Units that must hold rows of a KPI: 2^8 exchanges, of which the observed and its mirror image are 0.8 %."""
LEVEL = 0.95
_SEED = 0
_CONSTANT = 1e-9
"""Draws whose spread is this small beside their size differ by rounding alone."""


class Drawn(NamedTuple):
    """A KPI as observed, and in each exchange: `values`, shape (n_draws,), the observed one first.

    `units`: those that hold enough of its rows; `why`: why it cannot be judged whatever the exchanges give, else empty.
    """

    kpi: str
    of: str
    values: FloatArray
    units: int
    why: str = ""


@dataclass(frozen=True)
class Judgement:
    """What chance gives for one KPI.

    `chance`: the 95th percentile of the magnitude over the exchanges, NaN where none is defined; `score`: by how many
    of their standard deviations the observed value lies above their mean, NaN where not judged; `not_judged`: why, in
    words, empty where it is.
    """

    kpi: str
    of: str
    chance: float
    score: float
    stands_out: bool
    not_judged: str


def signs_of(units: int) -> FloatArray:
    """Exchanges of so many units: 1 as it is, -1 exchanged; shape (n_draws, units), the first the observed one.

    499 drawn ones besides, or all there are where these are fewer.
    """
    if units < 64 and 2**units <= EXCHANGES:
        flips = (np.arange(2**units)[:, None] >> np.arange(units)) & 1
    else:
        raw = np.random.Philox(key=_SEED).random_raw(EXCHANGES * units)
        flips = np.zeros((EXCHANGES + 1, units), dtype=np.int64)
        flips[1:] = (raw >> np.uint64(63)).astype(np.int64).reshape(EXCHANGES, units)
    return np.asarray(1.0 - 2.0 * flips)


def judge(drawn: list[Drawn], unit_words: str) -> tuple[list[Judgement], float]:
    """Which KPIs stand out, with the level of the whole family; and the score that one must exceed, NaN without any.

    `unit_words`: what a unit is called, in the plural. A difference counts by its magnitude. Scores are compared with
    what the largest of all judged KPIs reaches in an exchange (max-T; Westfall and Young, 1993).
    """
    size = [np.abs(one.values) for one in drawn]
    why = [_why_not(one, values, unit_words) for one, values in zip(drawn, size, strict=True)]
    scores = [np.full(0, np.nan) if w else (v - v.mean()) / v.std() for v, w in zip(size, why, strict=True)]
    judged = [score for score in scores if score.size]
    limit = _percentile(np.max(judged, axis=0)) if judged else float("nan")
    return [
        Judgement(
            one.kpi,
            one.of,
            _percentile(values) if np.isfinite(values).all() else float("nan"),
            float(score[0]) if score.size else float("nan"),
            bool(score.size and score[0] > limit),
            reason,
        )
        for one, values, score, reason in zip(drawn, size, scores, why, strict=True)
    ], limit


def _why_not(one: Drawn, values: FloatArray, unit_words: str) -> str:
    if one.why:
        return one.why
    if not np.isfinite(values[0]):
        return "it is not defined here"
    if one.units < FEWEST_UNITS:
        words = unit_words if one.units != 1 else unit_words.removesuffix("s")
        return f"its rows lie in {one.units} {words}" if one.units else f"none of the {unit_words} has enough rows"
    if not np.isfinite(values).all():
        return "it is not defined in every exchange"
    if values.std() <= _CONSTANT * max(float(values.max()), np.finfo(float).tiny):
        return "no exchange changes it"
    return ""


def _percentile(values: FloatArray) -> float:
    """At most 5 % of the values lie above it."""
    return float(np.quantile(values, LEVEL, method="inverted_cdf"))
