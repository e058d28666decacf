"""The JUnit report and the annotations of a check, as a CI server reads them."""

import dataclasses
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from lidarcheck.errors import ConfigError, GoldenError, InputError
from lidarcheck.harness.gate.evidence import KpiVerdict
from lidarcheck.harness.reports.annotations import annotations, explanation
from lidarcheck.harness.reports.junit import GOLDEN_CASE, junit_text, write_junit
from report_kit import distance, kpi, missing, regressed, report, scenario

GITHUB = {"GITHUB_ACTIONS": "true"}


def suites(text):
    return {suite.get("name"): suite for suite in ET.fromstring(text).iter("testsuite")}


def case(suite, name):
    (found,) = [item for item in suite.iter("testcase") if item.get("name") == name]
    return found


def test_a_suite_for_each_scenario_and_a_case_for_each_kpi():
    found = suites(junit_text(report(scenario("wall", kpi(), regressed()), scenario("panel", distance()))))
    assert list(found) == ["run", "wall", "panel"]
    assert [item.get("name") for item in found["wall"].iter("testcase")] == [GOLDEN_CASE, "area_mean", "area_mean.near"]
    assert {item.get("classname") for item in found["wall"].iter("testcase")} == {"wall"}
    assert found["wall"].attrib == {"name": "wall", "tests": "3", "failures": "1", "errors": "0", "skipped": "0"}


def test_the_whole_counts_its_suites():
    root = ET.fromstring(junit_text(report(scenario("wall", kpi(), regressed()), problems=["an orphan"])))
    assert root.tag == "testsuites"
    counts = {name: root.get(name) for name in ("tests", "failures", "errors", "skipped", "time")}
    assert counts == {"tests": "4", "failures": "2", "errors": "0", "skipped": "0", "time": "1.250"}


def test_a_kpi_that_fell_out_is_a_failure_in_words():
    found = suites(junit_text(report(scenario("wall", regressed()))))
    failure = case(found["wall"], "area_mean.near").find("failure")
    assert failure.get("type") == "regressed"
    assert failure.get("message").startswith("wall area_mean.near: regressed, 100 is now 109 counts (+9, tolerance 2)")
    assert "what to do" in failure.text


def test_the_numbers_are_properties():
    found = suites(junit_text(report(scenario("wall", regressed()))))
    values = {item.get("name"): item.get("value") for item in case(found["wall"], "area_mean.near").iter("property")}
    assert values == {
        "scenario": "wall",
        "verdict": "regressed",
        "value": "109",
        "reference": "100",
        "delta": "9",
        "margin": "0.5",
        "tolerance": "2",
        "smallest_change": "3.5",
        "limit_low": "90",
        "unit": "counts",
        "direction": "target",
        "note": "the 8 paired seeds differ",
        "reason": "a new lens",
    }


def test_the_file_is_told_from_the_current_directory(tmp_path, monkeypatch):
    wall = dataclasses.replace(scenario("wall", kpi()), file=tmp_path / "scenarios" / "wall.toml")
    monkeypatch.chdir(tmp_path)
    assert '"scenarios/wall.toml"' in junit_text(report(wall))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert f'"{wall.file.as_posix()}"' in junit_text(report(wall))


def test_what_has_no_number_has_no_property():
    found = suites(junit_text(report(scenario("wall", missing()))))
    values = {item.get("name") for item in case(found["wall"], "gone").iter("property")}
    assert values.isdisjoint({"reference", "delta", "margin", "smallest_change"})
    assert case(found["wall"], GOLDEN_CASE).find("failure").get("message") == "no KPI was compared with a golden"


def test_problems_of_scenario_and_run_are_failures():
    found = suites(junit_text(report(scenario("wall", kpi(), problems=("it has changed",)), problems=["an orphan"])))
    assert case(found["wall"], GOLDEN_CASE).find("failure").text == "it has changed"
    assert case(found["run"], "run proves something").find("failure").text == "an orphan"


def test_a_scenario_that_was_not_run_is_skipped():
    found = suites(junit_text(report(scenario("slim", notes=("not run: for SLIM",)))))
    assert case(found["slim"], GOLDEN_CASE).find("skipped").get("message") == "not run: for SLIM"


def test_an_error_is_an_error():
    faults = [InputError("one", file="a.toml", line=3), InputError("two", file="a.toml", line=5)]
    root = ET.fromstring(junit_text(ConfigError(faults)))
    assert (root.get("tests"), root.get("errors"), root.get("failures")) == ("1", "1", "0")
    error = root.find("testsuite/testcase/error")
    assert (error.get("type"), error.get("message")) == ("ConfigError", "error: a.toml:3: one")
    assert error.text.splitlines() == ["error: a.toml:3: one", "error: a.toml:5: two"]


def test_markup_and_what_xml_cannot_hold():
    note = 'a < b & "c" \x00\x1b[31m \ud800 ]]> ü'
    found = suites(junit_text(report(scenario("wall", kpi(verdict=KpiVerdict.CHANGED, note=note)))))
    values = {item.get("name"): item.get("value") for item in case(found["wall"], "area_mean").iter("property")}
    assert values["note"] == 'a < b & "c" \\x00\\x1b[31m \\ud800 ]]> ü'


def test_written_whole_or_not_at_all(tmp_path):
    write_junit(report(scenario("wall", kpi())), tmp_path / "check.xml")
    assert ET.parse(tmp_path / "check.xml").getroot().get("failures") == "0"
    with pytest.raises(InputError):
        write_junit(GoldenError("bad"), tmp_path / "nowhere" / "check.xml")
    assert [path.name for path in tmp_path.iterdir()] == ["check.xml"]


def test_an_explanation_is_a_line_then_a_table():
    lines = explanation(scenario("wall"), regressed()).splitlines()
    assert lines[0] == "wall area_mean.near: REGRESSED, 100 is now 109 counts"
    assert [line.split()[0] for line in lines[1:]] == [
        "golden", "now", "change", "tolerance", "catches", "limit", "seeds", "accepted", "why", "what",
    ]  # fmt: skip
    assert "  change       +9, of which chance explains ±0.5" in lines


@pytest.mark.parametrize("environ", [{}, {"GITHUB_ACTIONS": "false"}, {"GITLAB_CI": "true"}])
def test_nothing_is_annotated_where_nobody_reads_it(environ):
    assert annotations(report(scenario("wall", regressed())), environ) == []


def test_github_gets_file_line_and_title(tmp_path):
    (tmp_path / ".git").mkdir()
    file = tmp_path / "sensor" / "scenarios" / "wall.toml"
    file.parent.mkdir(parents=True)
    file.write_text('description = "x"\n\n[[kpis]]\nkpi = "a"\n\n[[kpis]]\nkpi = "b"\n')
    found = report(scenario("wall", kpi(), regressed(), file=file), scenario("gone", kpi(verdict=KpiVerdict.CHANGED)))
    lines = annotations(found, GITHUB)
    assert lines[0].startswith(
        "::error file=sensor/scenarios/wall.toml,line=6,title=area_mean.near%3A regressed::wall area_mean.near: "
    )
    assert lines[1].startswith("::notice file=scenarios/gone.toml,line=1,title=area_mean%3A changed::gone area_mean")
    assert len(lines) == 2


def test_a_workspace_is_the_root(tmp_path):
    file = tmp_path / "scenarios" / "wall.toml"
    (line,) = annotations(
        report(scenario("wall", regressed(), file=file)), GITHUB | {"GITHUB_WORKSPACE": str(tmp_path)}
    )
    assert "file=scenarios/wall.toml," in line


def test_a_command_cannot_be_broken_out_of():
    bad = "50 %\r\n::set-output name=x::y"
    (line,) = annotations(report(scenario("a,b:c", kpi(), problems=(bad,), file=Path("a,b:c%.toml"))), GITHUB)
    assert line == ("::error file=a%2Cb%3Ac%25.toml,line=1,title=a%2Cb%3Ac::50 %25\\r%0A\\x3a:set-output name=x::y")
    (line,) = annotations(report(problems=["an orphan"]), GITHUB)
    assert line == "::error title=lidarcheck check::an orphan"


def test_no_more_than_github_shows():
    many = report(scenario("wall", *(kpi(f"k{index}", KpiVerdict.REGRESSED, 9.0) for index in range(12))))
    lines = annotations(many, GITHUB)
    assert len(lines) == 10
    assert lines[-1] == "::error title=lidarcheck check::3 more of this kind: see the log or the JUnit report"
