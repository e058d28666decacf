"""`lidarcheck review`: complete the proposals of a run, show them KPI by KPI, accept them into goldens.

Nothing is accepted silently that a reader of the golden would want to know of: a regression, sources that are not
committed, a partial seed set, or a threshold that moved together with its value need a reason, which the golden then
carries. A golden that could only ever be indeterminate, or that breaks a limit, is not accepted at all.
"""

from __future__ import annotations

import dataclasses
import hashlib
import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.errors import GoldenError
from lidarcheck.formats.plain import plain
from lidarcheck.harness.gate import evidence, gate, sensitivity
from lidarcheck.harness.gate.evidence import KpiVerdict
from lidarcheck.harness.gate.seeds import GOLDEN_SEEDS, REFERENCE_SEEDS, Progress, Runner, ScenarioJob, SeedRecord
from lidarcheck.harness.goldens.file import load_proposal, save_golden
from lidarcheck.harness.goldens.git_state import uncommitted
from lidarcheck.harness.goldens.golden import Golden, KpiGolden, build, paired_identical, sample_of, thresholds_changed
from lidarcheck.harness.layout import Layout, make_directory, select
from lidarcheck.harness.scenario_run import Load, Measure, ScenarioRun, open_run, provenance_now, suite_size

__all__ = ["KpiReview", "ReviewReport", "ScenarioReview", "file_hash", "review"]

logger = logging.getLogger(__name__)

_PAIRED = GOLDEN_SEEDS[: evidence.PAIRED_SEEDS]
_REST = GOLDEN_SEEDS[evidence.PAIRED_SEEDS :]
_GROWN_SUITE = 1600
"""A golden must be fine enough for a suite of so many KPIs, or a growing suite would make it indeterminate."""


@dataclass(frozen=True, slots=True)
class KpiReview:
    """One KPI, old and proposed; either is None where it is new or dropped.

    `needs_reason`: what speaks against it; `refused`: why it cannot be accepted at all.
    """

    name: str
    old: KpiGolden | None
    new: KpiGolden | None
    verdict: KpiVerdict
    needs_reason: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()

    @property
    def delta(self) -> float:
        """Proposed minus old mean; nan if there is only one."""
        return self.new.reference.mean - self.old.reference.mean if self.new and self.old else math.nan

    @property
    def open(self) -> bool:
        """Whether accepting it would change the golden."""
        return self.verdict is not KpiVerdict.IDENTICAL or (self.old is not None and self.old.spec != self.new_spec)

    @property
    def new_spec(self) -> object:
        """What is asked now; None if it is dropped."""
        return None if self.new is None else self.new.spec


@dataclass(frozen=True, slots=True)
class ScenarioReview:
    """One scenario's proposal beside its golden (None: there is none, or it is damaged).

    `base`: hash of the golden's file as it was read, empty if there was none; `needs_reason`: what speaks against the
    proposal as a whole; `notes`: what a reader should know; `settled`: there is nothing to accept.
    """

    name: str
    layout: Layout
    golden: Golden | None
    base: str
    proposal: Golden
    kpis: tuple[KpiReview, ...]
    needs_reason: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    settled: bool = False


@dataclass(frozen=True, slots=True)
class ReviewReport:
    """What there is to accept."""

    scenarios: tuple[ScenarioReview, ...]

    @property
    def settled(self) -> bool:
        """Whether there is nothing to accept."""
        return all(scenario.settled for scenario in self.scenarios)

    def to_dict(self) -> dict[str, Any]:
        """The review as JSON holds it; null where there is no number."""
        return {"settled": self.settled, "scenarios": [_scenario_dict(scenario) for scenario in self.scenarios]}


def review(
    paths: Sequence[Path | str] = (),
    *,
    complete: bool = True,
    jobs: int | None = None,
    progress: Progress | None = None,
    measure: Measure | None = None,
    load: Load | None = None,
) -> ReviewReport:
    """Propose goldens for the scenarios, from all 64 seeds of each that is not bit-identical with its golden.

    A complete proposal that an earlier review left is taken as it is, if source, scenario, parameters and golden are
    the same. `complete=False`: look at the 8 paired seeds alone. Other arguments as in `check`. Writes proposals, no
    goldens. Warns of goldens without a scenario, on which a check fails.
    """
    selection = select(paths)
    for text in (text for layout in selection.whole for text in layout.orphans_in_words()):
        logger.warning("%s", text)
    cases = [open_run(file, None, measure, load, tolerate_damage=True) for file in selection.files]
    bases = [file_hash(case.layout.golden(case.scenario.name)) for case in cases]
    run = Runner(jobs, progress)
    run.seeds([case.paired_job for case in cases], _PAIRED)
    proposals = [_known_proposal(case, base) for case, base in zip(cases, bases, strict=True)]
    lacking = [case for case, known in zip(cases, proposals, strict=True) if known is None and complete]
    for case in lacking:
        case.need_chance()
    run.seeds([case.fresh_job for case in lacking], _REST)
    references: dict[Path, list[SeedRecord]] = {case.scenario.path: [] for case in lacking if _has_distance(case)}
    distances = [case for case in lacking if _has_distance(case)]
    run.seeds(
        [ScenarioJob(case.scenario.name, case.run, references[case.scenario.path]) for case in distances],
        REFERENCE_SEEDS,
    )

    share = evidence.error_share(suite_size(cases))
    reviews = []
    for case, base, known in zip(cases, bases, proposals, strict=True):
        proposal = known or _proposal(case, references.get(case.scenario.path, []), base, share)
        reviews.append(_scenario_review(case, proposal, base))
        _keep(reviews[-1])
    return ReviewReport(tuple(reviews))


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes; empty if there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def _has_distance(case: ScenarioRun) -> bool:
    return any(spec.kind == "distance" for spec in case.scenario.kpis)


def _known_proposal(case: ScenarioRun, base: str) -> Golden | None:
    """A proposal that needs no more seeds: the golden itself if the echoes are its own, or one that is complete."""
    golden, asked = case.golden, {spec.name: spec for spec in case.scenario.kpis}
    if golden and golden.kpis.keys() == asked.keys() and _all_identical(case, golden):
        kpis = {name: dataclasses.replace(golden.kpis[name], spec=spec) for name, spec in asked.items()}
        made = golden.provenance
        now = provenance_now(case.scenario, case.model, seeds=made.seeds, reference_seeds=made.reference_seeds)
        return dataclasses.replace(golden, kpis=kpis, provenance=dataclasses.replace(now, base=base), proposed=True)
    path = case.layout.proposal(case.scenario.name)
    try:
        proposal = load_proposal(path)
    except GoldenError:
        return None  # a proposal is only a saving of time
    same = (
        proposal.provenance.same_model(provenance_now(case.scenario, case.model)) and proposal.provenance.base == base
    )
    return proposal if same and proposal.complete and _all_identical(case, proposal) else None


def _all_identical(case: ScenarioRun, golden: Golden) -> bool:
    same_features = all(
        golden.kpis[spec.name].spec.feature == spec.feature and golden.kpis[spec.name].spec.kind == spec.kind
        for spec in case.scenario.kpis
        if spec.name in golden.kpis
    )
    return same_features and all(paired_identical(golden, kpi, case.paired) for kpi in golden.kpis.values())


def _proposal(case: ScenarioRun, reference: Sequence[SeedRecord], base: str, share: float) -> Golden:
    """The proposal from the seeds that were run, with the gate's verdict on each KPI and the last run's."""
    records = [*case.paired, *case.fresh]
    provenance = dataclasses.replace(
        provenance_now(case.scenario, case.model, seeds=f"0-{len(records) - 1}"), base=base
    )
    built = build(case.scenario.name, case.scenario.kpis, records, reference or records, provenance)
    said = _last_verdicts(case)
    kpis = {}
    for name, kpi in built.kpis.items():
        found = [_verdict(case, kpi, records, share)]
        if said.get(name) in (KpiVerdict.REGRESSED, KpiVerdict.INDETERMINATE) and found[0] is not KpiVerdict.MISSING:
            found.append(said[name])
        kpis[name] = dataclasses.replace(kpi, verdict=evidence.worst(found).value)
    return dataclasses.replace(built, kpis=kpis, proposed=True)


def _verdict(case: ScenarioRun, new: KpiGolden, records: Sequence[SeedRecord], share: float) -> KpiVerdict:
    old = case.golden.kpis.get(new.spec.name) if case.golden else None
    if old is None or case.golden is None:
        return KpiVerdict.MISSING
    if paired_identical(case.golden, old, case.paired):
        return KpiVerdict.IDENTICAL
    return gate.judge(old.spec, old.reference, sample_of(old, records, case.paired), share).verdict


def _last_verdicts(case: ScenarioRun) -> Mapping[str, KpiVerdict]:
    """What the last check of the same model said, on other seeds."""
    try:
        proposal = load_proposal(case.layout.proposal(case.scenario.name))
    except GoldenError:
        return {}
    if not proposal.provenance.same_model(provenance_now(case.scenario, case.model)):
        return {}
    return {name: KpiVerdict(kpi.verdict) for name, kpi in proposal.kpis.items() if kpi.verdict}


def _scenario_review(case: ScenarioRun, proposal: Golden, base: str) -> ScenarioReview:
    golden = case.golden
    old = golden.kpis if golden else {}
    names = dict.fromkeys([*proposal.kpis, *old])
    share = evidence.error_share(max(suite_size([case]), _GROWN_SUITE))
    kpis = tuple(_kpi_review(case, old.get(name), proposal.kpis.get(name), share) for name in names)
    dirty, note = uncommitted(case.scenario)
    reasons = [f"uncommitted changes in {dirty}"] if dirty else []
    reasons += [f"the golden could not be read: {case.damage}"] if case.damage else []
    changed = golden is not None and golden.provenance.scenario != case.scenario.content_hash
    if changed and any(kpi.old and kpi.new and kpi.verdict is not KpiVerdict.IDENTICAL for kpi in kpis):
        reasons.append("the scenario and its values changed in one step")
    if not proposal.complete:
        drawn = min((kpi.reference.drawn for kpi in proposal.kpis.values()), default=0)
        reasons.append(f"a partial seed set: {drawn} of {evidence.FULL_SEEDS} seeds")
    same_echoes = golden is not None and golden.digests == proposal.digests
    settled = same_echoes and not changed and not any(kpi.open for kpi in kpis)
    notes = tuple(text for text in (note,) if text)
    return ScenarioReview(case.scenario.name, case.layout, golden, base, proposal, kpis, tuple(reasons), notes, settled)


def _kpi_review(case: ScenarioRun, old: KpiGolden | None, new: KpiGolden | None, share: float) -> KpiReview:
    if new is None:
        name = old.spec.name if old else ""
        asked = any(spec.name == name for spec in case.scenario.kpis)
        why = "the run did not measure it" if asked else "the scenario no longer asks for it"
        return KpiReview(name, old, None, KpiVerdict.MISSING, needs_reason=(why,))
    if old is None:
        verdict = KpiVerdict.MISSING
    elif old.same_values(new):
        verdict = KpiVerdict.IDENTICAL
    else:
        verdict = KpiVerdict(new.verdict or KpiVerdict.CHANGED)
    reasons = [verdict.value] if verdict in (KpiVerdict.REGRESSED, KpiVerdict.INDETERMINATE) else []
    moved = thresholds_changed(old.spec, new.spec) if old else ""
    if moved and verdict is not KpiVerdict.IDENTICAL:
        reasons.append(f"a threshold changed in the same step: {moved}")
    refused = [sensitivity.too_coarse(new.spec, new.reference, share), _breaks_limit(new)]
    if new.spec.catches is not None:
        refused.append(sensitivity.misses(new.spec, new.reference, share))
    return KpiReview(new.spec.name, old, new, verdict, tuple(reasons), tuple(text for text in refused if text))


def _breaks_limit(kpi: KpiGolden) -> str:
    spec, mean = kpi.spec, kpi.reference.mean
    if spec.low is not None and mean < spec.low:
        return f"{mean:.5g} is below its limit {spec.low:g}: no golden may break a limit"
    if spec.high is not None and mean > spec.high:
        return f"{mean:.5g} is above its limit {spec.high:g}: no golden may break a limit"
    return ""


def _keep(found: ScenarioReview) -> None:
    """Leave the proposal for the next review, or remove one that has nothing to say."""
    path = found.layout.own(found.layout.proposal(found.name))
    if found.settled:
        path.unlink(missing_ok=True)
    else:
        found.layout.private()
        make_directory(path.parent)
        save_golden(found.proposal, path)


def _scenario_dict(found: ScenarioReview) -> dict[str, Any]:
    return {
        "name": found.name,
        "settled": found.settled,
        "needs_reason": list(found.needs_reason),
        "notes": list(found.notes),
        "kpis": [
            {
                "name": kpi.name,
                "verdict": kpi.verdict.value,
                "old": plain(kpi.old.reference.mean) if kpi.old else None,
                "new": plain(kpi.new.reference.mean) if kpi.new else None,
                "delta": plain(kpi.delta),
                "unit": (kpi.new or kpi.old).spec.unit if kpi.new or kpi.old else "",  # type: ignore[union-attr]
                "needs_reason": list(kpi.needs_reason),
                "refused": list(kpi.refused),
            }
            for kpi in found.kpis
        ],
    }
