"""What is said of a case by the frames of the fit and the selection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lidarcheck.explain.decision.calibration import calibrated, entries
from lidarcheck.explain.decision.closure import Closure
from lidarcheck.explain.decision.equivalence import Polished
from lidarcheck.explain.decision.findings import candidates_table, findings_of
from lidarcheck.explain.decision.inner_echoes import shows_inside
from lidarcheck.explain.decision.late_forms import with_finer_forms, with_forms_of_beams
from lidarcheck.explain.decision.mirror_images import only_images_stay
from lidarcheck.explain.decision.model_check import Open, carries_over
from lidarcheck.explain.decision.range_trends import ranges_follow
from lidarcheck.explain.decision.recurring import recurs
from lidarcheck.explain.decision.split_echoes import only_edges_stay
from lidarcheck.explain.empirical.description import Description
from lidarcheck.explain.report.explanation import Alternative, Calibrated, Explanation, Finding, SearchStep, Standout
from lidarcheck.explain.report.wording import depends_on
from lidarcheck.explain.search.selection import Search, SearchData
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.wasserstein import PARTS, Scale
from lidarcheck.model.spec import Model

if TYPE_CHECKING:
    from lidarcheck.cases.case import Case
    from lidarcheck.cases.split import Split
    from lidarcheck.explain.decision.last_word import Verified

__all__ = ["Answer", "answer_with_names", "answer_with_terms", "closes", "explanation_of", "objection"]


@dataclass(frozen=True)
class Answer:
    """The verdict with its findings, and the models from the case's own to the explained one, effect by effect; of
    names also what is open with these on the frames seen, which of them `recurring` speaks against, whether `inside`
    speaks against all, and the `rivals` that were tried in their places. `calibrated`: what was fitted besides, and
    `calibrating`: the models from that of the names alone on with one more of these each."""

    verdict: str
    findings: tuple[Finding, ...]
    stages: tuple[tuple[str, Model], ...]
    words: str
    open: Open | None = None
    recurring: tuple[str, ...] = ()
    inside: bool = False
    calibrated: tuple[Calibrated, ...] = ()
    calibrating: tuple[Model, ...] = ()
    rivals: tuple[Alternative, ...] = ()

    @property
    def closed(self) -> float | None:
        """The share of the gap that the names close on the frames seen; None where there is no name."""
        if self.open is None:
            return None
        before, after, _ = self.open.mean_of(PARTS)
        return min(1.0 - after / before, 1.0) if before > 0.0 else 0.0


def closes(answer: Answer) -> bool:
    """Whether the named effects, if there are any, close the gap on the frames seen. Not where what strikes at random
    is the same in every frame, nor where echoes stay in the midst of surfaces of which a view that looks elsewhere has
    none."""
    if answer.open is None:
        return True
    if answer.recurring or answer.inside:
        return False
    return carries_over(answer.open, [finding.name for finding in answer.findings])


def objection(answer: Answer) -> str:
    """What speaks against the named effects on the frames seen, in words."""
    if answer.recurring:
        places = "the same columns in every frame, beside bright targets, or on one material"
        return f"{' and '.join(answer.recurring)} would strike {places}"
    if answer.inside:
        return "echoes stay in the midst of surfaces, where no edge is"
    return "too much stays open on the frames seen"


def answer_with_names(bench: SearchData, seen: Scale, search: Search, closed: Closure, last: Polished) -> Answer:
    """The accepted effects with all that is said of them, and the small errors put right where that helps."""
    case = bench.simulator.model
    last = with_finer_forms(seen, case, last, bench.pool)
    [(before, noise)] = bench.pool.map(Scale.excess_by_part, [(seen.shared, case)])
    even = findings_of(bench, search, closed, last, float(before.mean()))
    findings = with_forms_of_beams(seen, case, even, last.last.nuisance, bench.pool)
    stages, model = [("", case)], case
    for finding in findings:
        for effect in finding.effects:
            model = model.with_(effect)
        stages.append((finding.name, model))
    put_right = calibrated(seen, model, last.last.nuisance, bench.pool)
    there = put_right.model
    besides, calibrating = entries(last.simulator, last.last, model, put_right)
    recurring = tuple(finding.name for finding in findings if recurs(seen, there, finding.name, bench.pool))
    images, following = only_images_stay(seen, there, Nuisance()), ranges_follow(last.simulator, last.last)
    edges = only_edges_stay(seen, there, float(before.mean()))
    open_ = Open(before, put_right.left, noise, put_right.noise, images, following, edges, closed.settled)
    inside = shows_inside(seen, there, [finding.name for finding in findings])
    return Answer("explained", findings, tuple(stages), "", open_, recurring, inside, besides, calibrating, last.rivals)


def answer_with_terms(bench: SearchData, search: Search, left: float, found: Description) -> Answer:
    """What the residual depends on, and the terms that were found; `left`: the part that no name explains."""
    simulator = bench.simulator
    left_over = simulator.measured - search.first.shown.mean(axis=0)
    depends = depends_on(simulator.summaries.names, left_over, simulator.beams.view)
    said = f"{depends}; described as {found.words.replace('; ', ', ')}" if found.effects else depends
    finding = Finding("unknown", {}, min(max(left, 0.0), 1.0), (), said, "", found.effects)
    described = bench.simulator.model
    for effect in found.effects:
        described = described.with_(effect)
    name = f"empirical: {found.words}" if found.effects else "empirical: no term helps"
    return Answer("unknown", (finding,), (("", bench.simulator.model), (name, described)), depends)


def explanation_of(
    case: Case,
    split: Split,
    bench: SearchData,
    where: tuple[Standout, ...],
    search: Search,
    answer: Answer,
    untestable: Mapping[str, str],
    verified: Verified,
    seed: int,
    steps: Sequence[SearchStep],
) -> Explanation:
    """Everything together."""
    return Explanation(
        verdict=verified.verdict,
        findings=answer.findings,
        not_testable=untestable,
        gap=verified.gap,
        model=verified.model,
        steps=tuple(steps),
        where=where,
        candidates=candidates_table(bench, search, answer.verdict, answer.findings),
        split=split.numbers(),
        seeds={"seed": seed, "fit": bench.simulator.seed, "select": bench.select.seed, "verify": 2 * seed + 3},
        hashes=dict(case.hashes),
        left_out=dict(case.left_out),
        closed_seen=answer.closed,
        calibrated=verified.calibrated,
        rivals=answer.rivals,
        geometry=case.geometry_words,
        ideals_from=case.origin.source,
    )
