"""The JUnit report of a check: a suite for each scenario, a case for each KPI, its numbers as properties."""

from __future__ import annotations

import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.atomic import write_text
from lidarcheck.harness.reports.annotations import explanation, headline
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult
from lidarcheck.printable import printable_lines

__all__ = ["GOLDEN_CASE", "RUN_SUITE", "junit_text", "properties", "scenario_problems", "write_junit"]

GOLDEN_CASE = "golden fits"
"""The case that holds what fails a scenario beyond its KPIs; no KPI can have this name."""
RUN_SUITE = "run"
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(report: CheckReport | LidarcheckError, path: Path | str) -> None:
    """Write the report, whole or not at all; of an error, that the run could not be made."""
    write_text(Path(path), junit_text(report))


def junit_text(report: CheckReport | LidarcheckError) -> str:
    """The report as JUnit XML, as Jenkins, GitLab and GitHub's actions read it.

    What fails is a `failure`; an error that ended the run is an `error`; a scenario that is not for the model is
    `skipped`.
    """
    root = ET.Element("testsuites", name="lidarcheck check")
    if isinstance(report, LidarcheckError):
        suite = ET.SubElement(root, "testsuite", name=RUN_SUITE)
        case = _case(suite, "lidarcheck", "check")
        _outcome(case, "error", type(report).__name__, report.lines()[0], "\n".join(report.lines()))
    else:
        root.set("time", f"{report.seconds:.3f}")
        _run_suite(root, report)
        for scenario in report.scenarios:
            _scenario_suite(root, scenario)
    _count(root)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def properties(scenario: ScenarioResult, kpi: KpiResult) -> list[tuple[str, str]]:
    """What is told of a KPI as JUnit properties: names and values in the KPI's unit, absent where there is none."""
    spec, golden, release = kpi.spec, kpi.golden, kpi.release
    numbers = {
        "value": kpi.new,
        "reference": kpi.old,
        "delta": golden.delta if golden else math.nan,
        "margin": golden.margin if golden else math.nan,
        "tolerance": spec.tolerance,
        "smallest_change": kpi.smallest,
        "limit_low": math.nan if spec.low is None else spec.low,
        "limit_high": math.nan if spec.high is None else spec.high,
    }
    words = {
        "unit": spec.unit,
        "direction": spec.direction,
        "release_verdict": release.verdict.value if release else "",
        "note": kpi.note,
        "reason": kpi.reason,
    }
    found = [("scenario", scenario.name), ("verdict", kpi.verdict.value)]
    found += [(name, f"{value:.12g}") for name, value in numbers.items() if math.isfinite(value)]
    return found + [(name, value) for name, value in words.items() if value]


def scenario_problems(scenario: ScenarioResult) -> tuple[str, ...]:
    """What fails a scenario beyond single KPIs, also that it was compared with nothing."""
    if scenario.kpis and not scenario.compared:
        return (*scenario.problems, "no KPI was compared with a golden")
    return scenario.problems


def _run_suite(root: ET.Element, report: CheckReport) -> None:
    """What holds for the run as a whole: how it was made, and its own problems."""
    suite = ET.SubElement(root, "testsuite", name=RUN_SUITE)
    made = {
        "seed": "default" if report.seed is None else str(report.seed),
        "model": report.model or "the scenarios' own",
        "kpis_in_suite": str(report.kpis_in_suite),
        "error_budget": f"{report.error_budget:g}",
        "source": report.source,
        **report.versions,
    }
    _properties(suite, made.items())
    _case_with_problems(_case(suite, "lidarcheck", "run proves something"), report.problems)


def _scenario_suite(root: ET.Element, scenario: ScenarioResult) -> None:
    suite = ET.SubElement(root, "testsuite", name=_clean(scenario.name))
    about = {"file": _from_here(scenario.file), "description": scenario.description, "seeds": str(scenario.seeds)}
    _properties(suite, {**about, **{f"{name}_hash": value for name, value in scenario.hashes.items()}}.items())
    golden = _case(suite, scenario.name, GOLDEN_CASE)
    if scenario.kpis or scenario.problems:
        _case_with_problems(golden, scenario_problems(scenario))
    else:
        ET.SubElement(golden, "skipped", message=_clean("; ".join(scenario.notes) or "not run"))
    for kpi in scenario.kpis:
        case = _case(suite, scenario.name, kpi.name)
        _properties(case, properties(scenario, kpi))
        if kpi.fails:
            _outcome(case, "failure", kpi.verdict.value, headline(scenario, kpi), explanation(scenario, kpi))
    if scenario.notes:
        ET.SubElement(suite, "system-out").text = _clean("\n".join(scenario.notes))


def _from_here(file: Path) -> str:
    """The path from the current directory, where the file lies below it."""
    path, here = file.resolve(), Path.cwd().resolve()
    return (path.relative_to(here) if path.is_relative_to(here) else file).as_posix()


def _case(suite: ET.Element, classname: str, name: str) -> ET.Element:
    return ET.SubElement(suite, "testcase", classname=_clean(classname), name=_clean(name))


def _case_with_problems(case: ET.Element, problems: tuple[str, ...]) -> None:
    if problems:
        _outcome(case, "failure", "problem", problems[0], "\n".join(problems))


def _outcome(case: ET.Element, kind: str, word: str, message: str, text: str) -> None:
    ET.SubElement(case, kind, type=word, message=_clean(message)).text = _clean(text)


def _properties(parent: ET.Element, pairs: Iterable[tuple[str, str]]) -> None:
    table = ET.SubElement(parent, "properties")
    for name, value in pairs:
        ET.SubElement(table, "property", name=_clean(name), value=_clean(value))


def _count(root: ET.Element) -> None:
    """The numbers that readers of JUnit expect on each suite and on the whole."""
    for element in (root, *root.iter("testsuite")):
        counts = {"tests": "testcase", "failures": "failure", "errors": "error", "skipped": "skipped"}
        for name, tag in counts.items():
            element.set(name, str(sum(1 for _ in element.iter(tag))))


def _clean(text: str | os.PathLike[str]) -> str:
    """The text as it shows itself; what XML cannot hold besides is the replacement character."""
    return _NOT_XML.sub("\ufffd", printable_lines(str(text)))
