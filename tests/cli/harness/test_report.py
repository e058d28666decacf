"""The release report: what is there, what is missing, and how the goldens stand."""

import dataclasses
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.cli.core.workflow_output import finish
from lidarcheck.cli.harness.report import workflows
from lidarcheck.figures.data import Distribution, Page, Section
from lidarcheck.harness.goldens.file import load_golden, save_golden
from scenario_texts import PANEL_MODEL, kpis, wall_scenario

SCENARIO = wall_scenario((250, 250), (470, 473)) + kpis(detection_probability=0.05)
WORKFLOWS = set(workflows())
FIGURE = Distribution("Range", "residual", "m", {"real": np.arange(9.0), "simulated": np.arange(7.0)})


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A project with a golden, a release golden and a check that holds."""
    root = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        patch.setattr("lidarcheck.harness.review.review.uncommitted", lambda *_: ("", ""))
        Path("scenarios/models").mkdir(parents=True)
        Path("scenarios/wall.toml").write_text(SCENARIO)
        Path("scenarios/models/SMART.toml").write_text(PANEL_MODEL)
        assert main(["review", "--accept", "all", "--quiet"]) == 0
        assert main(["review", "--release", "--quiet"]) == 0
        Path("results").mkdir()
        assert main(["check", "--json", "results/check.json", "--quiet"]) == 0
    return root


@pytest.fixture
def project(made, tmp_path, monkeypatch):
    root = tmp_path / "project"
    shutil.copytree(made, root)
    monkeypatch.chdir(root)
    return root


def result(directory, title="Panels", words="All hold."):
    """What a workflow leaves."""
    page = Page(title, words, (Section("Ranges", figures=(FIGURE,)),), {"seed": "1"})
    finish(page, {"bias": 0.5}, out=Path(directory), json=None, plot=None)


def report(*arguments):
    return main(["report", *map(str, arguments), "--out", "release.html", "--json", "release.json", "--quiet"])


def release():
    return json.loads(Path("release.json").read_text())


def test_everything_that_is_there_is_on_the_page_and_the_rest_is_named(project, capsys):
    result("results/one")
    result("results/two", "Panels", "One falls out.")
    capsys.readouterr()
    assert report("results") == 0
    found, page, printed = release(), Path("release.html").read_text(), capsys.readouterr().out
    assert [one["summary"] for one in found["workflows"]] == ["All hold.", "One falls out."]
    assert set(found["missing"]) == WORKFLOWS
    assert "explain" in WORKFLOWS
    assert not found["complete"]
    for text in (page, printed):
        assert "All hold." in text
        assert "One falls out." in text
        assert "missing" in text
        assert all(name in text for name in WORKFLOWS)
    assert "<script" not in page
    assert not re.findall(r"https?://", page)
    names = re.findall(r'<input type="radio" name="([^"]+)"', page)
    assert set(names) == {"w1-f1", "w2-f1"}
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'for="([^"]+)"', page)) <= set(ids)
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)
    assert report("results") == 0
    assert Path("release.html").read_text() == page


def test_the_goldens_are_told_with_provenance_and_the_last_check(project):
    assert report("results") == 0
    (golden,), check, page = release()["goldens"], release()["check"], Path("release.html").read_text()
    kept = load_golden(project / "goldens/wall.toml").provenance
    assert golden["scenario"] == "wall"
    assert golden["verdict"] == "identical"
    assert golden["shifts"] == []
    assert golden["made"]["model_source"] == kept.model_source
    assert golden["released"]["date"] == kept.date
    assert check["verdict"] == "holds"
    assert check["current"]
    assert kept.model_source[:16] in page
    assert "holds (1 identical)" in page


def test_what_has_moved_since_the_release_is_told(project):
    path = project / "goldens/release/wall.toml"
    golden = load_golden(path)
    ((name, kpi),) = golden.kpis.items()
    earlier = type(kpi.reference)(0.5, 0.1, 64, 64, kpi.reference.paired, kpi.reference.trials)
    save_golden(type(golden)("wall", {name: type(kpi)(kpi.spec, earlier)}, golden.digests, golden.provenance), path)
    assert report("results") == 0
    ((shift,),) = [one["shifts"] for one in release()["goldens"]]
    assert shift["release"] == 0.5
    assert shift["now"] == kpi.reference.mean
    assert f"{(kpi.reference.mean - 0.5) / 0.05:.2g}" in Path("release.html").read_text()


def test_two_releases_stand_side_by_side_from_folders_and_from_git(project, capsys):
    git = ["git", "-c", "user.name=a", "-c", "user.email=b"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "one"], ["tag", "v1"]):
        subprocess.run([*git, *words], check=True)
    shutil.copytree("goldens/release", "second")
    golden = load_golden(project / "second/wall.toml")
    ((name, kpi),) = golden.kpis.items()
    moved = dataclasses.replace(kpi, reference=dataclasses.replace(kpi.reference, mean=0.5), reason="new laser")
    save_golden(dataclasses.replace(golden, kpis={name: moved}), project / "second/wall.toml")
    capsys.readouterr()
    assert main(["report", "--between", "v1", "second", "--out", "r.html", "--json", "r.json", "--quiet"]) == 0
    (one,) = json.loads(Path("r.json").read_text())["kpis"]
    assert (one["old"], one["new"], one["reason"]) == (kpi.reference.mean, 0.5, "new laser")
    assert one["accepted_by"]
    assert one["difference"] == 0.5 - kpi.reference.mean
    for text in (capsys.readouterr().out, Path("r.html").read_text()):
        assert "1 of 1 KPIs differ" in text
        assert "new laser" in text
    assert main(["report", "--between", "v1", "--help-me", "--out", "x.html"]) == 2
    assert main(["report", "--between", "v1", "v2", "--out", "x.html"]) == 2
    assert "v2: is no folder, and no revision of git here" in capsys.readouterr().err


def test_goldens_that_are_missing_orphaned_or_edited_are_told(project):
    golden = (project / "goldens/wall.toml").read_text()
    (project / "scenarios/new.toml").write_text(SCENARIO)
    (project / "goldens/old.toml").write_text(golden)
    (project / "goldens/wall.toml").write_text(golden.replace("mean = ", "mean = 1"))
    assert report("results", "--goldens", "goldens") == 0
    problems = {one["scenario"]: one["problem"] for one in release()["goldens"]}
    assert problems["new"] == "there is no golden"
    assert problems["old"] == "the golden has no scenario"
    assert "edited by hand" in problems["wall"]


def test_a_check_of_other_code_or_none_is_said(project):
    check = json.loads(Path("results/check.json").read_text())
    Path("results/check.json").write_text(json.dumps({**check, "source": "0" * 64}))
    assert report("results") == 0
    assert not release()["check"]["current"]
    assert "made with other code" in Path("release.html").read_text()
    Path("results/check.json").unlink()
    result("results/one")
    assert report("results") == 0
    assert release()["check"] is None
    assert "Last check: not given" in Path("release.html").read_text()


def test_a_page_of_another_run_is_not_shown(project):
    result("results/one")
    page = Path("results/one/report.html")
    page.write_text(page.read_text().replace("All hold.", "All fall out."))
    assert report("results") == 0
    assert "was edited" in release()["workflows"][0]["note"]
    assert "All fall out." not in Path("release.html").read_text()
    page.unlink()
    assert report("results") == 0
    assert "is gone" in release()["workflows"][0]["note"]


def test_an_explanation_is_a_result_too(project):
    Path("results/gap").mkdir()
    gap = {"before": {"value": 2.0, "low": 1.0, "high": 3.0}, "after": 0.5, "floor": None}
    document = {"verdict": "explained", "effects": [{"name": "fog"}], "gap": gap}
    Path("results/gap/report.json").write_text(json.dumps(document))
    assert report("results") == 0
    (found,) = release()["workflows"]
    assert found["workflow"] == "explain"
    assert found["summary"] == "Verdict explained: fog. Gap before 2, after 0.5."
    assert "explain" not in release()["missing"]


def test_what_is_no_result_is_said(project, capsys):
    for name, text in {"a": "{", "b": "[]", "c": '{"workflow": 3}'}.items():
        Path("results", name).mkdir()
        Path("results", name, "result.json").write_text(text)
    Path("empty").mkdir()
    assert report("results", "empty") == 0
    assert [line.split(": ")[1].split(",")[0] for line in release()["amiss"]] == [
        "is not JSON",
        "is not the result of a workflow",
        "is not the result of a workflow",
        "no result of a workflow in it",
    ]
    assert "empty: no result of a workflow in it" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere", "--out", "a.html"], "there is no such directory"),
        (["results/check.json", "--out", "a.html"], "is not a directory"),
        (["results", "--out", "nowhere/a.html"], "its directory does not exist"),
        (["results", "--out", "results"], "is a directory"),
        (["results", "--out", "results/one/report.html"], "would replace another file"),
        (["results", "--out", "a.html", "--json", "a.html"], "would replace another file"),
        (["results", "--out", "a.html", "--goldens", "nowhere"], "there is no such directory"),
        (["results", "--out", "a.html", "--goldens", "results"], "holds no scenarios and no goldens"),
        (["results", "--out", "a.html", "--check", "nowhere.json"], "cannot read"),
        (["results", "--out", "a.html", "--check", "results/one/result.json"], "is not the JSON of a check"),
        (["results", "--out", "a.html", "--check", "scenarios/wall.toml"], "is not JSON"),
        (["--out", "a.html"], "needs DIR"),
        (["results"], "needs --out"),
    ],
)
def test_what_cannot_be_done_is_refused_and_nothing_written(project, capsys, arguments, words):
    result("results/one")
    before = sorted(project.rglob("*"))
    capsys.readouterr()
    assert main(["report", *arguments]) == 2
    found = capsys.readouterr().err
    assert found.startswith("error: ")
    assert words in found
    assert sorted(project.rglob("*")) == before


def test_without_a_project_the_goldens_are_said_to_be_none(project, tmp_path, monkeypatch):
    result(tmp_path / "alone")
    monkeypatch.chdir(tmp_path / "alone")
    assert report(".") == 0
    assert release()["goldens"] is None
    assert "no project with goldens" in Path("release.html").read_text()


def test_results_of_one_workflow_are_told_apart_by_their_file(project, capsys):
    result("results/near")
    result("results/far", words="One does not hold.")
    assert report("results") == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["Panels", "✓", "there", "results/near/result.json", "All", "hold."] in lines
    assert ["Panels", "✓", "there", "results/far/result.json", "One", "does", "not", "hold."] in lines
