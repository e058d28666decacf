"""What a review says in words, on the command line and in the terminal interface."""

from __future__ import annotations

from lidarcheck.harness.review.review import KpiReview, ScenarioReview

__all__ = ["objections", "verdict_word"]


def verdict_word(kpi: KpiReview) -> str:
    """The verdict; of a KPI without an old or a proposed value `new` or `dropped`."""
    return "new" if kpi.old is None else "dropped" if kpi.new is None else kpi.verdict.value


def objections(found: ScenarioReview) -> list[str]:
    """What a reader should know before accepting: notes, what needs a reason, what cannot be accepted."""
    lines = [f"{found.name}: {text}" for text in found.notes]
    lines += [f"{found.name}: needs a reason: {text}" for text in found.needs_reason]
    for kpi in found.kpis:
        lines += [f"{found.name}, {kpi.name}: cannot be accepted: {text}" for text in kpi.refused]
        lines += [f"{found.name}, {kpi.name}: needs a reason: {text}" for text in kpi.needs_reason]
    return lines
