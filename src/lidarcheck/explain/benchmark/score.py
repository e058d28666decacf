"""What a benchmark's answers are worth: shares with Wilson intervals, coverage, calibration, seconds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from lidarcheck.kpi.detection import wilson

__all__ = ["CONFIDENT", "LARGEST_SET", "Answer", "Bin", "Score", "Share", "score"]

LARGEST_SET = 3
"""Effects that one finding may leave open, itself included, to count as named within an equivalence set."""
CONFIDENT = 0.5
"""A wrong name with at least this confidence is said, not suspected."""
STRENGTHS = ("weak", "medium", "strong")
NULLS, HIDDEN, OUTSIDE = ("null", "null_nuisance"), ("single", "pair", "several"), ("left_out", "alien")
_FIGURES = ("closed", "told_before", "told_after")
_EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)


@dataclass(frozen=True)
class Answer:
    """One case: what was hidden, and what was found.

    `effects`: the names that were hidden; `observable`: which of them stand out of the noise; `comparable`: true values
    by "effect.parameter". `told_before`, `told_after`: how well a classifier tells measured from simulated echoes with
    the case's model and with the explained one, 2 AUC - 1. `found`, `gap`, `steps`: as `report.json` has
    them. `not_testable`: the effects that could not be shown, and why. `error`: why there is no answer; empty else.
    """

    number: int
    kind: str
    strength: str
    variant: str
    scene: str
    effects: tuple[str, ...]
    observable: Mapping[str, bool]
    comparable: Mapping[str, float]
    verdict: str
    found: tuple[Mapping[str, Any], ...]
    closed: float
    seconds: float
    told_before: float = math.nan
    told_after: float = math.nan
    z: Mapping[str, float] = field(default_factory=dict)
    exclude: tuple[str, ...] = ()
    error: str = ""
    gap: Mapping[str, Any] = field(default_factory=dict)
    steps: tuple[Mapping[str, str], ...] = ()
    not_testable: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Answer:
        """From its dictionary, as JSON gives it back."""
        parts = dict(row)
        for name in ("effects", "found", "exclude", "steps"):
            parts[name] = tuple(parts.get(name, ()))
        parts |= {name: math.nan for name in _FIGURES if parts.get(name) is None}
        return cls(**parts)

    def to_dict(self) -> dict[str, Any]:
        """Plain values; what is not a number is None."""
        row = asdict(self)
        return row | {name: _or_none(row[name]) for name in _FIGURES}

    @property
    def names(self) -> tuple[str, ...]:
        """What was named, in order of importance, without "unknown"."""
        return tuple(one["name"] for one in self.found if one["name"] != "unknown")

    @property
    def right(self) -> bool:
        """Whether the answer is the one that is wanted, by exact names."""
        if self.kind in NULLS:
            return self.verdict == "no_gap"
        return _recognised(self) if self.kind in OUTSIDE else _exact(self)

    @property
    def shows(self) -> bool:
        """Whether all that was hidden stands out of the noise."""
        return all(self.observable.get(name, False) for name in self.effects)


@dataclass(frozen=True, slots=True)
class Share:
    """`hits` of `of`, with Wilson's 95 % interval; NaN and 0 … 1 where there are none."""

    hits: int
    of: int

    @property
    def value(self) -> float:
        """The share itself."""
        return self.hits / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval."""
        low, high = wilson(self.hits, self.of)
        return float(low), float(high)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        low, high = self.interval
        return {"hits": self.hits, "of": self.of, "share": _or_none(self.value), "low": low, "high": high}


@dataclass(frozen=True, slots=True)
class Bin:
    """Names said with a confidence of `low` to `high`: mean confidence beside the share that was right."""

    low: float
    high: float
    confidence: float
    right: Share


@dataclass(frozen=True)
class Score:
    """All figures. `shares` and `all_shares` by name: of the cases whose effects stand out, and of all cases.

    `closed`: median share of the gap closed where something stands out; `told`: medians, there, of how well a
    classifier tells measured from simulated echoes, before and after; `described`, `described_told`: the same of what
    is outside of the catalogue, where empirical terms close it. `brier`: mean squared difference of confidence
    and outcome. `seconds`: median and 90th percentile. `errors`: cases without an answer, by number.
    """

    cases: int
    shares: Mapping[str, Share]
    all_shares: Mapping[str, Share]
    closed: float
    told: tuple[float, float]
    described: float
    described_told: tuple[float, float]
    calibration: tuple[Bin, ...]
    brier: float
    seconds: tuple[float, float]
    errors: Mapping[int, str]

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        bins = [
            {"low": b.low, "high": b.high, "confidence": b.confidence, **b.right.to_dict()} for b in self.calibration
        ]
        return {
            "cases": self.cases,
            "observable": {name: share.to_dict() for name, share in self.shares.items()},
            "all": {name: share.to_dict() for name, share in self.all_shares.items()},
            "closed": _or_none(self.closed),
            "told_apart": _before_after(self.told),
            "described": {"closed": _or_none(self.described), "told_apart": _before_after(self.described_told)},
            "calibration": bins,
            "brier": _or_none(self.brier),
            "seconds": {"median": _or_none(self.seconds[0]), "p90": _or_none(self.seconds[1])},
            "errors": {str(number): why for number, why in self.errors.items()},
        }


def _median(values: Iterable[float]) -> float:
    """The median of those that are numbers; NaN where none is."""
    known = [value for value in values if not math.isnan(value)]
    return float(np.median(known)) if known else math.nan


def _before_after(told: tuple[float, float]) -> dict[str, float | None]:
    return {"before": _or_none(told[0]), "after": _or_none(told[1])}


def _told(answers: Sequence[Answer]) -> tuple[float, float]:
    """Medians of how well a classifier tells measured from simulated echoes, before and after."""
    return _median(a.told_before for a in answers), _median(a.told_after for a in answers)


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def score(answers: Sequence[Answer]) -> Score:
    """Judge a benchmark's answers."""
    showing = [a for a in answers if a.shows]
    hidden, outside = ([a for a in showing if a.kind in kinds] for kinds in (HIDDEN, OUTSIDE))
    seconds = [a.seconds for a in answers if not a.error]
    said = [(_confidence(one), one["name"] in a.effects) for a in answers for one in a.found if _is_name(one)]
    return Score(
        cases=len(answers),
        shares=_shares(showing),
        all_shares=_shares(answers),
        closed=_median(a.closed for a in hidden),
        told=_told(hidden),
        described=_median(a.closed for a in outside),
        described_told=_told(outside),
        calibration=_calibration(said),
        brier=float(np.mean([(p - right) ** 2 for p, right in said])) if said else math.nan,
        seconds=(float(np.median(seconds)), float(np.quantile(seconds, 0.9))) if seconds else (math.nan, math.nan),
        errors={a.number: a.error for a in answers if a.error},
    )


def _shares(answers: Sequence[Answer]) -> dict[str, Share]:
    singles = [a for a in answers if a.kind == "single"]
    pairs, several = ([a for a in answers if a.kind == kind] for kind in ("pair", "several"))
    hidden = [*singles, *pairs, *several]
    found = {"singles named exactly": _share(singles, _exact)}
    for strength in STRENGTHS:
        of = [a for a in singles if a.strength == strength]
        found[f"  {strength}"] = _share(of, _exact)
    found["singles within a set of three"] = _share(singles, _within)
    found["pairs complete"] = _share(pairs, _exact)
    found["pairs within sets of three"] = _share(pairs, _within)
    found["three or four complete"] = _share(several, _exact)
    found["  of their effects, named"] = _named(several)
    found["  of their names, hidden"] = _true_names(several)
    found["wrong abstentions"] = _share(hidden, lambda a: a.verdict != "explained")
    found["  said to be unknown"] = _share(hidden, lambda a: a.verdict == "unknown")
    found["  said to be no gap"] = _share(hidden, lambda a: a.verdict == "no_gap")
    nulls = [a for a in answers if a.kind in NULLS]
    found["false alarms on nulls"] = _share(nulls, lambda a: a.verdict != "no_gap")
    found["  without nuisances"] = _share([a for a in nulls if a.kind == "null"], lambda a: a.verdict != "no_gap")
    found["  with nuisances"] = _share([a for a in nulls if a.kind == "null_nuisance"], lambda a: a.verdict != "no_gap")
    outside = [a for a in answers if a.kind in OUTSIDE]
    found["unknowns recognised"] = _share(outside, _recognised)
    for kind, words in (("left_out", "  left out of the catalogue"), ("alien", "  of no catalogue")):
        found[words] = _share([a for a in outside if a.kind == kind], _recognised)
    found["unknowns confidently misnamed"] = _share(outside, _misled)
    found["90 % intervals cover the truth"] = _coverage(answers)
    return found


def _share(answers: Sequence[Answer], holds: Callable[[Answer], bool]) -> Share:
    return Share(sum(holds(a) for a in answers), len(answers))


def _is_name(finding: Mapping[str, Any]) -> bool:
    return bool(finding["name"] != "unknown")


def _confidence(finding: Mapping[str, Any]) -> float:
    """What is not a number is no confidence."""
    return float(finding["confidence"] or 0.0)


def _exact(answer: Answer) -> bool:
    """Explained, by just what was hidden."""
    return answer.verdict == "explained" and sorted(answer.names) == sorted(answer.effects)


def _named(answers: Iterable[Answer]) -> Share:
    """Of the effects that were hidden, how many were named."""
    named = [name in answer.names for answer in answers for name in answer.effects]
    return Share(sum(named), len(named))


def _true_names(answers: Iterable[Answer]) -> Share:
    """Of the names that were said, how many were hidden."""
    true = [name in answer.effects for answer in answers for name in answer.names]
    return Share(sum(true), len(true))


def _within(answer: Answer) -> bool:
    """Explained by as many findings as were hidden, each of which may stand for one of them."""
    sets = [{one["name"], *one["equivalent_to"]} for one in answer.found if _is_name(one)]
    if answer.verdict != "explained" or len(sets) != len(answer.effects):
        return False
    return _matched(answer.effects, [one for one in sets if len(one) <= LARGEST_SET])


def _matched(effects: Sequence[str], sets: Sequence[set[str]]) -> bool:
    """Whether every effect finds a set of its own that holds it."""
    if not effects:
        return True
    first, rest = effects[0], effects[1:]
    return any(first in one and _matched(rest, [*sets[:i], *sets[i + 1 :]]) for i, one in enumerate(sets))


def _misled(answer: Answer) -> bool:
    """A name was said with confidence that was not hidden, or was no longer in the catalogue."""
    allowed = set(answer.effects) - set(answer.exclude)
    return any(_is_name(one) and one["name"] not in allowed and _confidence(one) >= CONFIDENT for one in answer.found)


def _recognised(answer: Answer) -> bool:
    return answer.verdict == "unknown" and not _misled(answer)


def _coverage(answers: Iterable[Answer]) -> Share:
    """Of the true values of effects that were named, how many lie in their interval."""
    hits = of = 0
    for answer in answers:
        for one in answer.found:
            for name, interval in one["parameters"].items():
                truth = answer.comparable.get(f"{one['name']}.{name}")
                if truth is not None and None not in (interval["low"], interval["high"]):
                    of += 1
                    hits += interval["low"] <= truth <= interval["high"]
    return Share(hits, of)


def _calibration(said: Sequence[tuple[float, bool]]) -> tuple[Bin, ...]:
    bins = []
    for low, high in itertools.pairwise(_EDGES):
        inside = [(p, right) for p, right in said if low <= p < high or (p == high == 1.0)]
        if inside:
            right = Share(sum(right for _, right in inside), len(inside))
            bins.append(Bin(low, high, float(np.mean([p for p, _ in inside])), right))
    return tuple(bins)
