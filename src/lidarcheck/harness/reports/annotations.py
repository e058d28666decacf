"""A KPI in plain words, and what a CI server shows of it beside the code."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from lidarcheck.errors import LidarcheckError
from lidarcheck.harness.gate.evidence import KpiVerdict
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult
from lidarcheck.printable import printable, printable_lines

__all__ = ["advice", "annotations", "explanation", "headline", "number", "scenario_lines", "with_unit"]

_SHOWN = 10
"""GitHub shows so many lines of a kind of one step, and drops the others without a word."""


def annotations(report: CheckReport, environ: Mapping[str, str]) -> list[str]:
    """The lines that a CI server turns into marks beside the scenario files; empty where nobody reads them.

    GitHub Actions (`GITHUB_ACTIONS=true` in `environ`): an error for what fails, a notice for a KPI that has changed
    within what is allowed, at the KPI's line and by paths from the root of the repository. GitLab and others read the
    JUnit report.
    """
    if environ.get("GITHUB_ACTIONS") != "true":
        return []
    errors = [_command("error", "", 0, "lidarcheck check", problem) for problem in report.problems]
    notices = []
    for scenario in report.scenarios:
        file, lines = _from_root(scenario.file, environ), scenario_lines(scenario.file)
        errors.extend(_command("error", file, 1, scenario.name, problem) for problem in scenario.problems)
        for index, kpi in enumerate(scenario.kpis):
            line, title = lines.get(index, 1), f"{kpi.name}: {kpi.verdict.value}"
            if kpi.fails:
                errors.append(_command("error", file, line, title, headline(scenario, kpi)))
            elif kpi.verdict in (KpiVerdict.CHANGED, KpiVerdict.IMPROVED):
                notices.append(_command("notice", file, line, title, headline(scenario, kpi)))
    return [*_capped("error", errors), *_capped("notice", notices)]


def headline(scenario: ScenarioResult, kpi: KpiResult) -> str:
    """One line: whose KPI, the verdict, golden and new value, and why."""
    parts = [f"{scenario.name} {kpi.name}: {kpi.verdict.value}"]
    if math.isfinite(kpi.old) and math.isfinite(kpi.new):
        parts.append(
            f"{number(kpi.old)} is now {with_unit(number(kpi.new), kpi)} ({kpi.new - kpi.old:+.4g}, "
            f"tolerance {number(kpi.spec.tolerance)})"
        )
    head = ", ".join(parts)
    return f"{head}; {kpi.note}" if kpi.note else head


def explanation(scenario: ScenarioResult, kpi: KpiResult) -> str:
    """A first line that stands for itself, then what was compared, a line each, ending with what to do."""
    rows = [(name, value) for name, value in _rows(scenario, kpi) if value]
    width = max(len(name) for name, _ in rows)
    table = [f"  {name:<{width}}  {value}" for name, value in rows]
    head = f"{scenario.name} {kpi.name}: {kpi.verdict.value.upper()}"
    if math.isfinite(kpi.old) and math.isfinite(kpi.new):
        head += f", {number(kpi.old)} is now {with_unit(number(kpi.new), kpi)}"
    return printable_lines("\n".join(map(printable, [head, *table])))


def advice(scenario: ScenarioResult, kpis: Sequence[KpiResult]) -> str:
    """What to do about KPIs that fail alike, by verdict and by limit; empty if their notes say so already."""
    names = ",".join(kpi.name for kpi in kpis)
    accept = f'`lidarcheck review {scenario.name} --accept {names} --reason "WHY"`'
    if any(kpi.limit for kpi in kpis):
        return "bring the model back within the limit, or change the limit in the scenario if the requirement has"
    verdicts = {kpi.verdict for kpi in kpis}
    if verdicts == {KpiVerdict.REGRESSED}:
        return f"undo what changed in the model; if the change is meant: {accept}"
    if verdicts == {KpiVerdict.INDETERMINATE}:
        return f"give the KPI more beams or frames, so that it scatters less; if the scatter is meant: {accept}"
    return ""


def number(value: float) -> str:
    """Five digits; a dash where there is no number."""
    return f"{value:.5g}" if math.isfinite(value) else "-"


def with_unit(text: str, kpi: KpiResult) -> str:
    """The text with the KPI's unit behind it; a share (unit 1) has none."""
    return text if kpi.spec.unit == "1" else f"{text} {kpi.spec.unit}".rstrip()


def scenario_lines(file: Path) -> dict[int, int]:
    """The line of each `[[kpis]]` table, counted from 0, in the scenario file; empty if the file cannot be read."""
    from lidarcheck.formats.config import parse_toml

    try:
        data, lines = parse_toml(file)
    except LidarcheckError:
        return {}
    kpis = data.get("kpis")
    return {index: lines.line(("kpis", index)) for index in range(len(kpis) if isinstance(kpis, list) else 0)}


def _rows(scenario: ScenarioResult, kpi: KpiResult) -> list[tuple[str, str]]:
    spec, golden, release = kpi.spec, kpi.golden, kpi.release
    change = f"{kpi.new - kpi.old:+.4g}" if math.isfinite(kpi.new - kpi.old) else ""
    if golden and math.isfinite(golden.margin):
        change += f", of which chance explains ±{golden.margin:.2g}"
    limits = [f"at least {number(spec.low)}"] if spec.low is not None else []
    limits += [f"at most {number(spec.high)}"] if spec.high is not None else []
    return [
        ("golden", with_unit(number(kpi.old), kpi)),
        ("now", with_unit(number(kpi.new), kpi)),
        ("change", change),
        ("tolerance", with_unit(number(spec.tolerance), kpi)),
        ("catches", "" if math.isnan(kpi.smallest) else f"changes from {with_unit(number(kpi.smallest), kpi)} on"),
        ("limit", " and ".join(limits)),
        ("seeds", f"{golden.seeds} fresh" if golden and golden.seeds else ""),
        ("last release", f"{release.delta:+.4g}, {release.verdict.value}" if release else ""),
        ("accepted as", kpi.reason),
        ("why", kpi.note),
        ("what to do", advice(scenario, [kpi])),
    ]


def _from_root(file: Path, environ: Mapping[str, str]) -> str:
    """The path from the repository's root, with forward slashes; as it is if it lies elsewhere."""
    given = environ.get("GITHUB_WORKSPACE")
    path = file.resolve()
    roots = [Path(given).resolve()] if given else []
    roots += [parent for parent in path.parents if (parent / ".git").exists()]
    for root in roots:
        if path.is_relative_to(root):
            return path.relative_to(root).as_posix()
    return file.as_posix()


def _command(kind: str, file: str, line: int, title: str, message: str) -> str:
    where = {"file": file, "line": str(line), "title": title} if file else {"title": title}
    fields = ",".join(f"{name}={_escaped(value, property=True)}" for name, value in where.items())
    return f"::{kind} {fields}::{_escaped(message)}"


def _escaped(text: str, *, property: bool = False) -> str:
    """As GitHub's runner undoes it: percent first, and in properties also what separates them."""
    text = printable(text) if property else printable_lines(text)
    escapes = {"%": "%25", "\r": "%0D", "\n": "%0A"}
    if property:
        escapes |= {":": "%3A", ",": "%2C"}
    return "".join(escapes.get(character, character) for character in text)


def _capped(kind: str, commands: list[str]) -> list[str]:
    if len(commands) <= _SHOWN:
        return commands
    rest = len(commands) - _SHOWN + 1
    more = _command(kind, "", 0, "lidarcheck check", f"{rest} more of this kind: see the log or the JUnit report")
    return [*commands[: _SHOWN - 1], more]
