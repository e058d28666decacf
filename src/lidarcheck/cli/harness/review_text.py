"""A review as a person reads it."""

from __future__ import annotations

import math

from lidarcheck.cli.core.terminal import columns, number_text, table
from lidarcheck.cli.harness.check_text import unit_text
from lidarcheck.harness.review.review import KpiReview, ReviewReport, ScenarioReview
from lidarcheck.harness.review.wording import objections, verdict_word

__all__ = ["review_text"]

COLUMNS = columns(
    "scenario, KPI", "verdict", "golden", "proposed", "change", "unit", right=("golden", "proposed", "change")
)


def review_text(report: ReviewReport, *, hint: bool) -> str:
    """The open KPIs of each scenario, what speaks against them, and with `hint` how to accept them."""
    open_ones = [found for found in report.scenarios if not found.settled]
    settled = len(report.scenarios) - len(open_ones)
    lines = [f"as its golden says: {settled} of {len(report.scenarios)}"]
    if not open_ones:
        return f"{lines[0]}; nothing to accept\n"
    rows = [row for found in open_ones for row in _rows(found)]
    lines += [line for found in open_ones for line in objections(found)]
    if hint:
        names = " ".join(found.name for found in open_ones)
        reason = any(found.needs_reason or any(kpi.needs_reason for kpi in found.kpis) for found in open_ones)
        lines.append(f"to accept: lidarcheck review {names} --accept all" + (' --reason "why"' if reason else ""))
    return table(COLUMNS, rows) + "\n".join(lines) + "\n"


def _rows(found: ScenarioReview) -> list[tuple[str, ...]]:
    head = (found.name, "" if found.golden else "no golden", "", "", "", "")
    return [head, *(_row(kpi) for kpi in found.kpis if kpi.open)]


def _row(kpi: KpiReview) -> tuple[str, ...]:
    old = math.nan if kpi.old is None else kpi.old.reference.mean
    new = math.nan if kpi.new is None else kpi.new.reference.mean
    either = kpi.new or kpi.old
    unit = unit_text(either.spec.unit) if either else ""
    return (f"  {kpi.name}", verdict_word(kpi), number_text(old), number_text(new), number_text(kpi.delta, "+"), unit)
