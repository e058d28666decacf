"""`lidarcheck check --sensitivity`: which scenario watches which parameter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.cli.core.outputs import check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import columns, emit, number_text, progress, table

if TYPE_CHECKING:
    from lidarcheck.harness.watch.matrix import Answer, WatchedParameter, WatchReport

__all__ = ["sensitivity", "sensitivity_text"]

_COLUMNS = columns("parameter", "change", "watched by", "KPI", "golden", "now", right=("golden", "now"))


def sensitivity(scenarios: Sequence[str], *, every: bool, only: str, jobs: int | None, json: Path | str | None) -> int:
    """Run the matrix, show it, and return the exit code."""
    if json is not None:
        check_writable(json, option="--json", besides=scenarios)
    from lidarcheck.harness.layout import select
    from lidarcheck.harness.watch.matrix import watch

    with progress("asking") as show:
        report = watch(scenarios, only=only, every=every, jobs=jobs, progress=show)
    if json != "-":
        emit(sensitivity_text(report))
    if json is not None:
        write_result(json, json_text(with_origin(report.to_dict(), [*select(scenarios).files])))
    return report.exit_code


def sensitivity_text(report: WatchReport) -> str:
    """The matrix, a line for each parameter and red scenario, what is watched by none, and the verdict."""
    rows, styles = [], []
    for one in report.parameters:
        for answer in one.red or (None,):
            rows.append(_row(one, answer))
            styles.append("" if answer else "red")
    lines = [f"FAILED {_unwatched(one)}" for one in report.unwatched]
    lines += [f"FAILED {problem}" for problem in report.problems]
    watched = len(report.parameters) - len(report.unwatched)
    word = "FAILED" if report.exit_code else "holds"
    lines.append(
        f"sensitivity {word}: {watched} of {len(report.parameters)} parameters are watched, "
        f"{report.asked} scenarios asked, {report.seconds:.1f} s"
    )
    return table(_COLUMNS, rows, styles=styles) + "\n".join(lines) + "\n"


def _row(one: WatchedParameter, answer: Answer | None) -> tuple[str, ...]:
    if answer is None:
        return (one.name, one.change or "-", "watched by none", "", "", "")
    outcome = answer.outcome
    now = outcome.verdict if outcome.new is None else number_text(outcome.new)
    old = "" if outcome.old is None else number_text(outcome.old)
    return (one.name, answer.change, answer.scenario, outcome.kpi, old, now)


def _unwatched(one: WatchedParameter) -> str:
    if not one.answers:
        return f"{one.name} is watched by none: no scenario's model gives it a value that can be changed"
    asked = ", ".join(answer.scenario for answer in one.answers[:4]) + (", ..." if len(one.answers) > 4 else "")
    return (
        f"{one.name} is watched by none: {one.change} turns none of {asked} red; add a scenario or a KPI that sees it"
    )
