"""`check` as a user and a CI server see it."""

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import pytest

from lidarcheck.cli import main
from lidarcheck.errors import GoldenError
from lidarcheck.harness.gate.evidence import KpiEvidence, KpiVerdict
from lidarcheck.harness.kpis.spec import KpiSpec
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult


def kpi(name, verdict, new, note=""):
    spec = KpiSpec(name, "mean", "m", "target", 0.01)
    return KpiResult(spec, verdict, 1.0, new, golden=KpiEvidence(verdict, new - 1.0, 0.1, 0.02, 64), note=note)


HELD = ScenarioResult("walls", Path("walls.toml"), "", (kpi("range", KpiVerdict.IDENTICAL, 1.0),), seeds=8)
FELL = ScenarioResult(
    "panels",
    Path("panels.toml"),
    "",
    (kpi("area", KpiVerdict.EQUIVALENT, 1.0), kpi("walk", KpiVerdict.REGRESSED, 1.5, "beyond ±0.1")),
    problems=("the scenario has changed",),
)
SKIPPED = ScenarioResult("slim", Path("slim.toml"), "", (), notes=("not run: the scenario is for SLIM",))


def report(*scenarios, problems=()):
    return CheckReport(scenarios, tuple(problems), None, "", 3, 1e-3, 1.25, {})


@pytest.fixture
def checked(monkeypatch):
    """Make `check` find what a test says, and keep what it was asked."""
    asked = {}
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)

    def install(found):
        def run(paths, *, progress, **options):
            progress(1, 2, "walls")
            asked.update(options, paths=paths)
            if isinstance(found, Exception):
                raise found
            return found

        monkeypatch.setattr("lidarcheck.harness.check.check", run)
        return asked

    return install


def test_what_holds_exits_with_0_and_ends_with_the_table(checked, capsys):
    asked = checked(report(HELD, SKIPPED))
    assert main(["check"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert asked == {"paths": (), "seed": None, "model": None, "jobs": None, "pool": None}
    lines = out.splitlines()
    assert lines[0].split() == ["scenario,", "KPI", "verdict", "golden", "now", "catches", "unit"]
    assert lines[1].split() == ["walls", "holds"]
    assert lines[2].split() == ["range", "identical", "1", "1", "0.02", "m"]
    assert lines[3].split() == ["slim", "not", "run"]
    assert lines[-2] == "note: slim: not run: the scenario is for SLIM"
    assert lines[-1] == "check holds: 1 KPI in 2 scenarios (1 identical), 1.2 s"


def test_what_fell_out_exits_with_1_and_says_what_and_why(checked, capsys):
    checked(report(HELD, FELL, problems=["goldens/x.toml has no scenario: restore it"]))
    assert main(["check"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "  walk         REGRESSED        1  1.5     0.02  m" in lines
    assert lines[-5:] == [
        "FAILED panels: the scenario has changed",
        "FAILED panels walk: regressed, 1 is now 1.5 m (+0.5, tolerance 0.01); beyond ±0.1",
        "FAILED goldens/x.toml has no scenario: restore it",
        "undo what changed, or see and accept what is meant: lidarcheck review panels",
        "check FAILED: 1 of 3 KPIs fell out (1 identical, 1 equivalent, 1 regressed), 1.2 s",
    ]


def test_what_cannot_run_exits_with_2(checked, capsys):
    checked(GoldenError("was edited by hand", file="goldens/walls.toml", line=3, fix="restore it"))
    assert main(["check"]) == 2
    assert capsys.readouterr() == ("", "error: goldens/walls.toml:3: was edited by hand; restore it\n")


def test_the_options_reach_the_run(checked):
    asked = checked(report(HELD))
    assert main(["check", "a", "b.toml", "--seed", str(2**64 - 1), "--model", "m.toml", "--jobs", "1"]) == 0
    assert asked == {"paths": ("a", "b.toml"), "seed": 2**64 - 1, "model": Path("m.toml"), "jobs": 1, "pool": None}


def test_json_on_standard_output_is_alone(checked, capsys):
    checked(report(FELL))
    assert main(["check", "--json", "-"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["verdict"], found["exit_code"]) == ("failed", 1)


@pytest.mark.parametrize("option", ["--json", "--html", "--junit"])
def test_a_report_that_cannot_be_written_is_refused_before_the_run(checked, option, capsys):
    asked = checked(report(HELD))
    assert main(["check", option, "nowhere/x"]) == 2
    assert "its directory does not exist" in capsys.readouterr().err
    assert asked == {}


def test_a_missing_golden_shows_no_numbers(checked, capsys):
    spec = KpiSpec("range", "mean", "m", "target", 0.01)
    missing = KpiResult(spec, KpiVerdict.MISSING, math.nan, 1.0, note="there is no golden")
    checked(report(ScenarioResult("walls", Path("walls.toml"), "", (missing,))))
    assert main(["check"]) == 1
    out = capsys.readouterr().out
    assert "nan" not in out
    assert "FAILED walls range: missing; there is no golden" in out


def test_reports_for_a_ci_server(checked, tmp_path, capsys, monkeypatch):
    checked(report(HELD, FELL))
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    xml, page = tmp_path / "check.xml", tmp_path / "check.html"
    assert main(["check", "--junit", str(xml), "--html", str(page), "--json", "-"]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out)["exit_code"] == 1
    assert "::error file=panels.toml" in err
    suites = {suite.get("name"): suite.get("failures") for suite in ElementTree.parse(xml).getroot()}
    assert (suites["walls"], suites["panels"]) == ("0", "2")
    assert page.read_text(encoding="utf-8").startswith("<!")


def test_a_run_that_could_not_be_made_is_an_error_in_junit(checked, tmp_path):
    checked(GoldenError("was edited by hand", file="goldens/walls.toml"))
    xml = tmp_path / "check.xml"
    assert main(["check", "--junit", str(xml)]) == 2
    assert ElementTree.parse(xml).getroot().get("errors") == "1"
