"""A check's report as a person reads it."""

from __future__ import annotations

from lidarcheck.cli.core.terminal import columns, number_text, table
from lidarcheck.harness.gate.evidence import KpiVerdict
from lidarcheck.harness.reports.annotations import headline
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult

__all__ = ["report_text", "verdict_table"]

COLUMNS = columns("scenario, KPI", "verdict", "golden", "now", "catches", "unit", right=("golden", "now", "catches"))
"""`catches`: the smallest change that would have been caught."""


def report_text(report: CheckReport) -> str:
    """The table of KPIs, what fell out and why, and the verdict."""
    parts = [verdict_table(report.scenarios)] if report.scenarios else []
    notes = [f"note: {scenario.name}: {text}" for scenario in report.scenarios for text in scenario.notes]
    failures = [line for scenario in report.scenarios for line in _failures(scenario)]
    failures += [f"FAILED {problem}" for problem in report.problems]
    lines = [*notes, *failures, *_advice(report), _verdict(report)]
    return "\n".join([*parts, *lines]) + "\n"


def verdict_table(scenarios: tuple[ScenarioResult, ...]) -> str:
    """Each scenario and its KPIs; what fails is in capitals, and red where there is colour."""
    rows: list[tuple[str, ...]] = []
    styles: list[str] = []
    for scenario in scenarios:
        rows.append(
            (scenario.name, "FAILED" if scenario.failed else "holds" if scenario.kpis else "not run", *[""] * 4)
        )
        styles.append("bold red" if scenario.failed else "bold")
        for kpi in scenario.kpis:
            rows.append(_row(kpi))
            styles.append("red" if kpi.fails else "")
    return table(COLUMNS, rows, styles=styles)


def _row(kpi: KpiResult) -> tuple[str, ...]:
    verdict = kpi.verdict.value.upper() if kpi.fails else kpi.verdict.value
    # Of an identical KPI only the paired seeds were run; the mean of these eight would look like a change.
    now = kpi.old if kpi.verdict is KpiVerdict.IDENTICAL and not kpi.fresh else kpi.new
    numbers = (number_text(kpi.old), number_text(now), number_text(kpi.smallest))
    return (f"  {kpi.name}", verdict, *numbers, unit_text(kpi.spec.unit))


def _failures(scenario: ScenarioResult) -> list[str]:
    """A line for each KPI that fell out; one for all that have no golden, or none that can be read."""
    lines = [f"FAILED {scenario.name}: {problem}" for problem in scenario.problems]
    alike: dict[str, list[KpiResult]] = {}
    for kpi in scenario.kpis:
        if kpi.fails and kpi.verdict is KpiVerdict.MISSING:
            alike.setdefault(kpi.note, []).append(kpi)
        elif kpi.fails:
            lines.append(f"FAILED {headline(scenario, kpi)}")
    for why, kpis in alike.items():
        which = kpis[0].name if len(kpis) == 1 else f"({len(kpis)} KPIs)"
        lines.append(f"FAILED {scenario.name} {which}: missing; {why}")
    return lines


def _advice(report: CheckReport) -> list[str]:
    """What to do about KPIs that moved; what is missing says so itself."""
    moved = {KpiVerdict.REGRESSED, KpiVerdict.INDETERMINATE}
    names = [scenario.name for scenario in report.scenarios if any(kpi.verdict in moved for kpi in scenario.kpis)]
    if not names or report.model:  # a model that was only asked for cannot be accepted
        return []
    which = names[0] if len(names) == 1 else ""
    return [f"undo what changed, or see and accept what is meant: {' '.join(f'lidarcheck review {which}'.split())}"]


def _verdict(report: CheckReport) -> str:
    counts = ", ".join(f"{count} {verdict}" for verdict, count in report.counts.items() if count)
    total = sum(report.counts.values())
    fallen = sum(kpi.fails for scenario in report.scenarios for kpi in scenario.kpis)
    word = "FAILED" if report.failed else "holds"
    whole = f"{_counted(total, 'KPI')} in {_counted(len(report.scenarios), 'scenario')}"
    what = f"{fallen} of {_counted(total, 'KPI')} fell out" if fallen else whole
    return f"check {word}: {what}{f' ({counts})' if counts else ''}, {report.seconds:.1f} s"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def unit_text(unit: str) -> str:
    """The unit as it is shown: nothing for a pure number."""
    return "" if unit == "1" else unit
