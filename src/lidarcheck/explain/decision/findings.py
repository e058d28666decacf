"""What the search found as rows of the report: the effects with their parameters, and the candidates' table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import make
from lidarcheck.effects.search import search_spec
from lidarcheck.explain.decision.closure import OPEN_BY_BEAMS, Closure, confidence, intervals
from lidarcheck.explain.decision.equivalence import Polished
from lidarcheck.explain.report.explanation import Candidate, Finding
from lidarcheck.explain.report.wording import measurement, standouts
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.selection import Search, SearchData
from lidarcheck.inference.effect_fit import Fit, with_effects
from lidarcheck.inference.simulator import Simulator

__all__ = ["candidates_table", "findings_of", "is_doubtful", "rounded_effects", "separating"]


WIDEN = 1.5
"""Intervals are this much wider than the curvature says: set by hand after a dozen cases, not yet by coverage."""
_DIGITS = 5
_LEAST_SURE = 0.65


def findings_of(bench: SearchData, search: Search, closed: Closure, polish: Polished, before: float) -> list[Finding]:
    """The accepted effects, the most important first, with the parameters of the last fit.

    `before`: the gap beam by beam without them. A name need not lead over those that were compared with it beam by
    beam, where it closes that gap: to be nearer than these says little where all are far.
    """
    settled = polish.compared if polish.left <= OPEN_BY_BEAMS * before else polish.equals
    now, simulator = search.fit, bench.simulator
    parameters = intervals(polish.simulator, polish.last, WIDEN)
    effects = rounded_effects(polish.last)
    changes = [_change(simulator, now, i) for i in range(len(now.probes))]
    found = []
    for i in np.argsort([-simulator.metric.square(change) for change in changes], kind="stable"):
        name = now.probes[i].name
        equal, compared = polish.equals.get(name, ()), settled.get(name, ())
        behind = polish.behind.get(name, {})
        sure = confidence(bench, now, name, search.trials, closed, compared, behind)
        shown = standouts(simulator.summaries.names, changes[i], 2.0, simulator.beams.view, 3)
        found.append(
            Finding(
                name=name,
                parameters=parameters[i],
                confidence=sure / _shared(len(equal)),
                equivalent_to=equal,
                where="; ".join(one.words for one in shown),
                separated_by=separating(name, equal),
                effects=(effects[i],),
            )
        )
    return found


def is_doubtful(finding: Finding) -> bool:
    """Whether a name leads too little, with what shares its confidence, to be said. At edges no name leads by much."""
    alone = finding.confidence * _shared(len(finding.equivalent_to))
    return alone < _LEAST_SURE and not search_spec(finding.name).at_edges


def _shared(equals: int) -> float:
    """What a confidence is divided by where so many others explain the data as well."""
    return 1.0 + 0.5 * equals


def _change(simulator: Simulator, now: Fit, i: int) -> FloatArray:
    """What one of the effects changes with the others there."""
    rest = [j for j in range(len(now.probes)) if j != i]
    without = with_effects(simulator.model, [now.probes[j] for j in rest], [now.x[j] for j in rest])
    return np.asarray(now.shown[0] - simulator.shows(without, 1, nuisance=now.nuisance)[0])


def rounded_effects(now: Fit) -> list[Effect]:
    """The effects with their numbers to five significant digits, as the model file has them."""
    found = []
    for effect in now.effects():
        settings = {k: _rounded(v) if isinstance(v, float) else v for k, v in effect.settings().items()}
        found.append(make(effect.name, settings))
    return found


def _rounded(value: float) -> float:
    if value == 0.0 or not math.isfinite(value):
        return value
    return round(value, _DIGITS - 1 - math.floor(math.log10(abs(value))))


def separating(name: str, equal: Sequence[str]) -> str:
    """The measurement that would tell an effect from those that these data cannot tell from it."""
    return "; ".join(f"from {other}: {measurement(name, other)}" for other in equal)


def candidates_table(
    bench: SearchData, search: Search, verdict: str, findings: Sequence[Finding]
) -> tuple[Candidate, ...]:
    """Every fitted candidate with its scores, what became of it, and the names that these data cannot tell it from."""
    kept = search.fit.names() if verdict != "unknown" else ()
    alike = _alike(findings)
    rows = []
    for trial in search.trials:
        before = trial.select_before - bench.select.floor_distance
        closed = (trial.select_before - trial.select_after) / before if before > 0.0 else math.nan
        rows.append(
            Candidate(
                name=trial.name,
                round=trial.round,
                gain=trial.gain,
                needed=trial.needed,
                pull=math.sqrt(max(trial.gain, 0.0)),
                closed=closed,
                verdict=_fate(trial.name, trial.passes, trial.gain > trial.needed, kept, search, verdict),
                equivalent_to=alike.get(trial.name, ()) if trial.passes else (),
                start=_start(trial),
            )
        )
    return tuple(rows)


def _alike(findings: Sequence[Finding]) -> Mapping[str, tuple[str, ...]]:
    """What each name cannot be told from, of those that are given and of those that could stand in their places."""
    found: dict[str, tuple[str, ...]] = {}
    for one in findings:
        together = (one.name, *one.equivalent_to)
        found |= {name: tuple(other for other in together if other != name) for name in together}
    return found


def _start(trial: FittedCandidate) -> str:
    """The kind of start, or the material or object that a start is for; empty where an effect has but one."""
    probe = trial.probe
    things = [f"{name.removesuffix('_id')} {number}" for name, number in probe.fixed.items() if name.endswith("_id")]
    return probe.variant or ", ".join(things)


def _fate(name: str, passes: bool, gains: bool, kept: Sequence[str], search: Search, verdict: str) -> str:
    if name in kept and passes:
        return "accepted"
    if passes:
        if verdict == "unknown":
            return "helps, but leaves too much open"
        return "another explains more" if name not in kept else "accepted"
    return "does not hold on other frames" if gains else "explains too little"
