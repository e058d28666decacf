"""What the gap workflow finds: the verdict, the effects, the evidence, and everything that a report shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from lidarcheck.effects.base import Effect
from lidarcheck.inference.intervals import Gap, Interval
from lidarcheck.model.spec import Model

__all__ = [
    "Alternative",
    "Calibrated",
    "Candidate",
    "Explanation",
    "Finding",
    "Progress",
    "ProgressCallback",
    "SearchStep",
    "Standout",
    "StepCallback",
]

VERDICTS = ("no_gap", "explained", "unknown")


@dataclass(frozen=True)
class Finding:
    """One missing effect: its name ("unknown" outside the catalogue), its parameters, how sure that is.

    `where`: in words, what of the data it shows in. `equivalent_to`: effects that these data cannot tell apart from
    it, and `separated_by`: the measurement that would. `effects`: what the written model gets for it, in the order of
    the light's way (more than one for an empirical description).
    """

    name: str
    parameters: Mapping[str, Interval]
    confidence: float
    equivalent_to: tuple[str, ...]
    where: str
    separated_by: str = ""
    effects: tuple[Effect, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As report.json has it."""
        return {
            "name": self.name,
            "parameters": {name: one.to_dict() for name, one in self.parameters.items()},
            "confidence": self.confidence,
            "equivalent_to": list(self.equivalent_to),
            "where": self.where,
            "separated_by": self.separated_by,
        }


@dataclass(frozen=True, slots=True)
class Standout:
    """A summary that stands out: which feature over which bin of which covariate, by how many standard deviations."""

    feature: str
    covariate: str
    bin: str
    z: float
    words: str


@dataclass(frozen=True, slots=True)
class Candidate:
    """One row of the candidates' table.

    `gain`: by how much it shortens the distance of the summaries on the fit frames; `needed`: what chance and the
    5 % rule ask for; `pull`: its leading parameter's distance from no effect in standard errors; `closed`: share of
    the distance that it closes on the select frames (NaN where it was not fitted); `verdict` in words; `start`: of
    which kind or thing it was tried, where one effect has several.
    """

    name: str
    round: int
    gain: float
    needed: float
    pull: float
    closed: float
    verdict: str
    equivalent_to: tuple[str, ...] = ()
    start: str = ""


@dataclass(frozen=True, slots=True)
class Calibrated:
    """A number of the case's model that was fitted besides the names, within usual errors: `name` as
    `materials.5.reflectance`, what it was, its value with its 90 % interval, and the share of the gap above the floor
    that it closes on the frames that verify (NaN where there is no such gap)."""

    name: str
    was: float
    value: float
    low: float
    high: float
    gap_share: float = math.nan


@dataclass(frozen=True, slots=True)
class Alternative:
    """Other names in the place of those given: `score`, by how much nearer the summaries of the frames seen are with
    them (half the difference of the distances, as of log densities; below 0 they are farther), the `gap` that they
    leave there beam by beam (NaN where that was not asked), and why they are not the answer."""

    names: tuple[str, ...]
    score: float
    gap: float
    why_not: str


@dataclass(frozen=True, slots=True)
class SearchStep:
    """What one step of the workflow did, in words."""

    name: str
    words: str


ProgressCallback = Callable[[str, int, int], object]
"""Told (step, done, of) while the workflow runs; called often."""
StepCallback = Callable[[SearchStep], object]
"""Hears what was found while the workflow runs, in words."""


@dataclass(frozen=True)
class Progress:
    """The steps by name, in order, with the share of the whole work that each usually takes."""

    shares: Mapping[str, float]


@dataclass(frozen=True)
class Explanation:
    """The whole answer. `model` is the case's model with what was found; `seeds` and `hashes` make it repeatable.

    `split`: which frames (numbers as in the case's file, from 0) were used to fit, to select and to verify.
    `not_testable`: effects that these scenes cannot show, with the reason. `left_out`: damaged frames and why.
    `geometry`: whether X, Y, Z were checked against the beams, in words.
    `closed_seen`: share of the gap that the names close on the frames that they were chosen by; None without names.
    `calibrated`: what was fitted besides the names. `rivals`: other names that were tried in their places.
    `ideals_from`: what the ideal scans were made from, where the case says it.
    """

    verdict: str
    findings: tuple[Finding, ...]
    not_testable: Mapping[str, str]
    gap: Gap
    model: Model
    steps: tuple[SearchStep, ...]
    where: tuple[Standout, ...]
    candidates: tuple[Candidate, ...]
    split: Mapping[str, tuple[int, ...]]
    seeds: Mapping[str, int]
    hashes: Mapping[str, str]
    left_out: Mapping[str, str] = field(default_factory=dict)
    geometry: str = ""
    closed_seen: float | None = None
    calibrated: tuple[Calibrated, ...] = ()
    rivals: tuple[Alternative, ...] = ()
    ideals_from: str = ""

    @property
    def nothing_more(self) -> str:
        """To what "nothing is missing" is limited where the ideal scans were made from repeats; else empty."""
        return "that repeats can show" if self.ideals_from == "repeats" else ""

    def to_dict(self) -> dict[str, Any]:
        """report.json."""
        return {
            "verdict": self.verdict,
            **({"ideals_from": self.ideals_from} if self.ideals_from else {}),
            "effects": [one.to_dict() for one in self.findings],
            "not_testable": list(self.not_testable),
            "gap": {
                "before": self.gap.before.value,
                "after": self.gap.after.value,
                "floor": self.gap.floor.value,
                "closed": self.gap.closed,
                "intervals": {
                    **{
                        name: [getattr(self.gap, name).low, getattr(self.gap, name).high]
                        for name in ("before", "after", "floor")
                    },
                    "closed": [*self.gap.closed_span],
                },
                "closed_seen": self.closed_seen,
                "by_feature": {
                    name: dict(zip(("before", "after", "floor"), values, strict=True))
                    for name, values in self.gap.by_feature.items()
                },
                "waterfall": [{"effect": name, **one.to_dict()} for name, one in self.gap.waterfall],
                "classifier": self.gap.classifier.to_dict(),
                "by_kind": {
                    name: dict(zip(("before", "after", "floor"), values, strict=True))
                    for name, values in self.gap.by_kind.items()
                },
            },
            "calibrated": [
                {
                    "name": c.name,
                    "was": c.was,
                    "value": c.value,
                    "low": c.low,
                    "high": c.high,
                    "gap_share": _known(c.gap_share),
                }
                for c in self.calibrated
            ],
            "rivals": [
                {"names": list(r.names), "score": r.score, "gap": _known(r.gap), "why_not": r.why_not}
                for r in self.rivals
            ],
            "why_not_testable": dict(self.not_testable),
            "steps": [{"step": one.name, "found": one.words} for one in self.steps],
            "where": [
                {"feature": w.feature, "covariate": w.covariate, "bin": w.bin, "z": w.z, "words": w.words}
                for w in self.where
            ],
            "candidates": [
                {
                    "name": c.name,
                    "round": c.round,
                    "gain": c.gain,
                    "needed": c.needed,
                    "pull": c.pull,
                    "closed": _known(c.closed),
                    "verdict": c.verdict,
                    "equivalent_to": list(c.equivalent_to),
                    "start": c.start,
                }
                for c in self.candidates
            ],
            "split": {name: list(frames) for name, frames in self.split.items()},
            "seeds": dict(self.seeds),
            "hashes": dict(self.hashes),
            "left_out": dict(self.left_out),
            "geometry": self.geometry,
        }


def _known(value: float) -> float | None:
    """None for what is not known, of which JSON has no number."""
    return None if math.isnan(value) else value
