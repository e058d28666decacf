"""Runs of scenarios against their goldens, as the screen Overview has them computed, and what is kept of them."""

import threading
import time

import pytest

from lidarcheck.session.node import Cancelled
from lidarcheck.tui.jobs.checks import Runs, check_scenario, run_scenarios
from tui_kit import fake_check, make_project


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return make_project(tmp_path_factory.mktemp("tui") / "project")


def test_a_run_is_kept_and_a_fault_does_not_stop_the_others(project, tmp_path):
    found = []
    paths = [project / f"scenarios/{name}.toml" for name in ("broken", "background_SMART")]

    def check(paths, progress):
        if paths[0].stem == "broken":
            from lidarcheck.harness.scenario.scenario import load_scenario

            load_scenario(paths[0])
        return fake_check(paths, progress)

    run_scenarios(paths, on_progress=lambda *_: None, on_outcome=found.append, stop=threading.Event(), check=check)
    assert [outcome.verdict for outcome in found] == ["fault", "fell out"]
    assert "broken.toml" in found[0].problems[0]
    assert [kpi.verdict for kpi in found[1].kpis] == ["equivalent", "regressed"]
    assert found[1].kpis[0].limit == "<= 3"
    runs = Runs(tmp_path)
    for outcome in found:
        runs.add(outcome)
    assert Runs(tmp_path).last == runs.last
    (tmp_path / ".lidarcheck/tui/runs.json").write_text('{"a": 1}')
    assert Runs(tmp_path).last == {}


def test_a_run_stops_when_it_is_told_to(project):
    stop, start = threading.Event(), time.monotonic()
    stop.set()
    with pytest.raises(Cancelled):
        run_scenarios([project / "scenarios/background_SMART.toml"] * 9, on_progress=print, on_outcome=print, stop=stop)
    assert time.monotonic() - start < 1.0


def test_a_real_run_holds(project):
    outcome = check_scenario(project / "scenarios/background_SMART.toml")
    assert outcome.verdict == "holds"
    assert outcome.kpis
    assert {kpi.verdict for kpi in outcome.kpis} == {"identical"}
