"""`lidarcheck check`: run scenarios, compare them with their goldens, leave proposals."""

from __future__ import annotations

import dataclasses
import logging
import math
import time
from collections.abc import Sequence
from pathlib import Path

from lidarcheck.errors import InputError, UsageError
from lidarcheck.harness.gate import gate, sensitivity
from lidarcheck.harness.gate.evidence import (
    ERROR_BUDGET,
    FIRST_SEEDS,
    FULL_SEEDS,
    PAIRED_SEEDS,
    KpiEvidence,
    KpiVerdict,
    Sample,
    error_share,
    worst,
)
from lidarcheck.harness.gate.seeds import GOLDEN_SEEDS, Progress, Runner, fresh_seeds
from lidarcheck.harness.goldens.file import save_golden
from lidarcheck.harness.goldens.golden import KpiGolden, mean_quantiles, paired_identical, sample_of
from lidarcheck.harness.goldens.provenance import parameters_hash, source_hash, versions
from lidarcheck.harness.kpis.spec import KpiSpec
from lidarcheck.harness.layout import ScenarioSelection, make_directory, select
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult
from lidarcheck.harness.scenario_run import Load, Measure, ScenarioRun, open_run, suite_size
from lidarcheck.model.spec import Model
from lidarcheck.workers import WorkerPool

__all__ = ["check", "judged"]

logger = logging.getLogger(__name__)

_PAIRED = GOLDEN_SEEDS[:PAIRED_SEEDS]


def check(
    paths: Sequence[Path | str] = (),
    *,
    seed: int | None = None,
    model: Model | Path | str | None = None,
    jobs: int | None = None,
    pool: WorkerPool | None = None,
    progress: Progress | None = None,
    measure: Measure | None = None,
    load: Load | None = None,
) -> CheckReport:
    """Run scenarios against their goldens, and say what each KPI has done.

    `paths`: scenario files, directories of them or names; none: the project's `scenarios/`. `seed`: makes an
    independent re-run with fresh seeds, also of a model that is bit-identical. `model`: asked in place of the
    scenarios' own, where the variant is theirs. `jobs`: seeds run side by side, which changes no result; `pool`: who
    runs them in the place of this machine's cores. `measure`, `load`: stand-ins for `harness.measure.measure` and
    `harness.scenario.load_scenario`. A KPI that fell out is in the report; a `LidarcheckError` means that the run could
    not be made. Goldens are never written.
    """
    start = time.monotonic()
    selection = select(paths)
    cases = [open_run(file, model, measure, load) for file in selection.files]
    kpis_in_suite = suite_size(cases)
    share = error_share(kpis_in_suite)
    run = Runner(jobs, progress, pool)
    if pool is not None:
        _refuse_external([case for case in cases if not case.skipped])
    results = judged(cases, run, share, seed)
    if model is None:
        for case, result in zip(cases, results, strict=True):
            _leave_proposal(case, result)
    return CheckReport(
        scenarios=results,
        problems=_run_problems(selection, results),
        seed=seed,
        model="" if model is None else str(model if not isinstance(model, Model) else model.file or "given"),
        kpis_in_suite=kpis_in_suite,
        error_budget=ERROR_BUDGET,
        seconds=time.monotonic() - start,
        versions=versions(),
        source=source_hash(),
    )


def judged(
    cases: Sequence[ScenarioRun], run: Runner, share: float, seed: int | None = None
) -> tuple[ScenarioResult, ...]:
    """Run the seeds that the gate asks for of each case, and judge them; `share`: the error that each KPI is left."""
    active = [case for case in cases if not case.skipped]
    run.seeds([case.paired_job for case in active], _PAIRED)
    compared = [case for case in active if case.golden and (seed is not None or not _nothing_new(case))]
    for case in compared:
        case.need_chance()
    fresh = fresh_seeds(seed, FULL_SEEDS)
    run.seeds([case.fresh_job for case in compared], fresh[:FIRST_SEEDS])
    doubtful = [case for case in compared if _in_doubt(case, share)]
    run.seeds([case.fresh_job for case in doubtful], fresh[FIRST_SEEDS:])
    return tuple(_scenario_result(case, share) for case in cases)


def _refuse_external(cases: Sequence[ScenarioRun]) -> None:
    """`UsageError` for a model that is a program: it is on this machine, with its files, and not on the workers'."""
    for case in cases:
        if case.model.external is not None:
            what = f"the scenario {case.scenario.name} runs an external model, which is on this machine alone"
            raise UsageError(what, fix="leave out --scheduler, or name the other scenarios")


def _nothing_new(case: ScenarioRun) -> bool:
    """Whether every KPI is bit-identical with both references, so that fresh seeds could tell nothing.

    With the last golden is enough where that says all that a comparison with the release's asks: its seeds are then
    this model's.
    """
    return all(
        paired_identical(golden, kpi, case.paired) or (golden is case.release and _is_known(case, kpi))
        for golden, kpi, _ in case.comparisons()
    )


def _is_known(case: ScenarioRun, kpi: KpiGolden) -> bool:
    """Whether the last golden has of a KPI what can be held against the release's: of distances it has only its own."""
    last = case.golden.kpis[kpi.spec.name] if case.golden else kpi
    return last.spec.kind == kpi.spec.kind != "distance" and last.reference.drawn == FULL_SEEDS


def _in_doubt(case: ScenarioRun, share: float) -> bool:
    """Whether the first fresh seeds leave a doubt about any KPI, against either reference."""
    return any(
        gate.needs_more(spec, kpi.reference, sample_of(kpi, case.fresh, case.paired), share)
        for _, kpi, spec in case.comparisons()
        if case.measures(kpi.spec)
    )


def _scenario_result(case: ScenarioRun, share: float) -> ScenarioResult:
    scenario = case.scenario
    kpis: tuple[KpiResult, ...] = ()
    if not case.skipped:
        golden = case.golden.kpis if case.golden else {}
        specs = {spec.name: spec for spec in scenario.kpis} | {name: kpi.spec for name, kpi in golden.items()}
        kpis = tuple(_kpi_result(case, spec, golden.get(name), share) for name, spec in specs.items())
    return ScenarioResult(
        name=scenario.name,
        file=scenario.path,
        description=scenario.description,
        kpis=kpis,
        problems=tuple(case.problems()),
        notes=(*case.notes(), *_outgrown(case, share)),
        seeds=len(case.paired) + len(case.fresh),
        hashes={"scenario": scenario.content_hash, "parameters": parameters_hash(case.model)},
    )


def _outgrown(case: ScenarioRun, share: float) -> list[str]:
    """Which KPIs chance explains too much of by now: each is left less of the error, the more the suite has."""
    if case.skipped or case.golden is None:
        return []
    found = [(kpi.spec, sensitivity.too_coarse(kpi.spec, kpi.reference, share)) for kpi in case.golden.kpis.values()]
    return [f"{spec.name} has become too coarse as the suite has grown: {why}" for spec, why in found if why]


def _kpi_result(case: ScenarioRun, spec: KpiSpec, golden: KpiGolden | None, share: float) -> KpiResult:
    absent = _why_missing(case, spec, golden)
    if absent or golden is None:
        values = tuple(record.values.get(spec.name, math.nan) for record in case.paired)
        old = math.nan if golden is None else golden.reference.mean
        return KpiResult(spec, KpiVerdict.MISSING, old, _mean(values), note=absent, paired=values)
    sample = sample_of(golden, case.fresh, case.paired)
    assert case.golden is not None
    last = _evidence(spec, golden, sample, paired_identical(case.golden, golden, case.paired), share)
    release, drifted, drift_note = _release_evidence(case, spec, golden, share)
    if last.verdict.fails:
        drift_note = ""  # a change since the last golden is no slow drift
    limit = gate.beyond_limit(spec, sample.fresh or sample.paired, share)
    verdict = worst([last.verdict, *([release.verdict] if drifted and release else ())])
    features = [mean_quantiles(case.fresh or case.paired, spec.feature)] if spec.feature else []
    return KpiResult(
        spec=spec,
        verdict=worst([verdict, *([KpiVerdict.REGRESSED] if limit else ())]),
        old=golden.reference.mean,
        new=_mean(sample.fresh) if sample.fresh else golden.reference.mean,
        golden=last,
        release=release,
        limit=limit,
        note="; ".join(text for text in (f"limit: {limit}" if limit else "", last.note, drift_note) if text),
        reason=golden.reason,
        fresh=sample.fresh,
        paired=sample.paired,
        old_paired=golden.reference.paired,
        old_quantiles=golden.quantiles,
        new_quantiles=tuple(features[0].tolist()) if features else (),
    )


def _why_missing(case: ScenarioRun, spec: KpiSpec, golden: KpiGolden | None) -> str:
    name = case.scenario.name
    if case.golden is None:
        return f"there is no golden: run `lidarcheck review {name} --accept all`"
    if golden is None:
        return f"the golden does not have it: run `lidarcheck review {name}` and accept it"
    if all(spec.name != asked.name for asked in case.scenario.kpis):
        return f"the scenario no longer asks for it: restore it, or run `lidarcheck review {name}` and accept that"
    return "" if case.measures(spec) else "the run did not measure it: check the scenario's selection"


def _evidence(spec: KpiSpec, kpi: KpiGolden, sample: Sample, identical: bool, share: float) -> KpiEvidence:
    """The comparison with one reference; bit-identical paired seeds make EQUIVALENT IDENTICAL."""
    if not sample.drawn:
        smallest = sensitivity.smallest_change(spec, kpi.reference, share)
        return KpiEvidence(KpiVerdict.IDENTICAL, 0.0, math.nan, smallest, 0, note="")
    evidence = gate.judge(spec, kpi.reference, sample, share)
    if identical and evidence.verdict is KpiVerdict.EQUIVALENT:
        return dataclasses.replace(evidence, verdict=KpiVerdict.IDENTICAL)
    return evidence


def _release_evidence(
    case: ScenarioRun, spec: KpiSpec, golden: KpiGolden, share: float
) -> tuple[KpiEvidence | None, bool, str]:
    """(comparison with the last release, whether its verdict counts, what to say of it)."""
    kpi = case.release.kpis.get(spec.name) if case.release else None
    if kpi is None or case.release is None:
        return None, False, ""
    sample, identical = sample_of(kpi, case.fresh, case.paired), paired_identical(case.release, kpi, case.paired)
    if not case.fresh and not identical:
        sample = dataclasses.replace(sample, trials=golden.reference.trials, known=golden.reference)
    evidence = _evidence(spec, kpi, sample, identical, share)
    if not evidence.verdict.fails:
        return evidence, False, ""
    if golden.reason and (golden.reason, golden.reason_date) != (kpi.reason, kpi.reason_date):
        return evidence, False, f"{evidence.verdict} since the last release, accepted: {golden.reason}"
    return evidence, True, f"{evidence.verdict} since the last release ({evidence.delta:+.4g}): it has drifted"


def _run_problems(selection: ScenarioSelection, results: Sequence[ScenarioResult]) -> tuple[str, ...]:
    problems = [text for layout in selection.whole for text in layout.orphans_in_words()]
    if not any(result.compared for result in results):
        problems.append("no KPI was compared with a golden: a run that compares nothing proves nothing")
    return tuple(problems)


def _leave_proposal(case: ScenarioRun, result: ScenarioResult) -> None:
    """Write what a review would start from, or remove what is settled; a read-only project is no reason to fail."""
    path = case.layout.proposal(case.scenario.name)
    try:
        if case.skipped or (result.identical and not result.problems):
            case.layout.own(path).unlink(missing_ok=True)
            return
        case.layout.private()
        make_directory(case.layout.own(path).parent)
        verdicts = {kpi.name: kpi.verdict.value for kpi in result.kpis}
        save_golden(case.proposal(verdicts), path)
    except (OSError, InputError) as error:
        logger.warning("no proposal was left in %s: %s", path, error)


def _mean(values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return math.fsum(finite) / len(finite) if finite else math.nan
