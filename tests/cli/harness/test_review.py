"""From a scenario to its golden and back, as a sensor team does it in its own repository."""

import json
from pathlib import Path

import pytest

from lidarcheck.cli import main
from scenario_texts import PANEL_MODEL, kpis, wall_scenario

SCENARIO = wall_scenario((250, 251), (470, 479)) + kpis(detection_probability=0.05)


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with one small scenario and no golden, made current; no git speaks of this package's own sources."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("lidarcheck.harness.review.review.uncommitted", lambda *_: ("", ""))
    Path("scenarios/models").mkdir(parents=True)
    Path("scenarios/wall.toml").write_text(SCENARIO)
    Path("scenarios/models/SMART.toml").write_text(PANEL_MODEL)
    return tmp_path


def test_without_a_golden_the_check_fails_and_says_what_to_run(project, capsys):
    assert main(["check"]) == 1
    out = capsys.readouterr().out
    assert "lidarcheck review wall --accept all" in out
    assert "no KPI was compared" in out


def test_review_shows_accepts_and_is_settled(project, capsys):
    assert main(["review", "wall"]) == 0
    out = capsys.readouterr().out
    assert "detection_probability" in out
    assert "to accept: lidarcheck review wall --accept all" in out
    assert not Path("goldens").exists()

    assert main(["review", "--accept", "all"]) == 0
    assert "goldens/wall.toml" in capsys.readouterr().err
    assert main(["check"]) == 0
    assert "check holds: 1 KPI in 1 scenario (1 identical)" in capsys.readouterr().out
    assert main(["check", "--seed", "18446744073709551615", "--jobs", "1"]) == 0

    assert main(["review"]) == 0
    assert capsys.readouterr().out.endswith("as its golden says: 1 of 1; nothing to accept\n")
    assert main(["review", "--release"]) == 0
    assert Path("goldens/release/wall.toml").read_bytes() == Path("goldens/wall.toml").read_bytes()


def test_a_golden_keeps_who_accepted_a_kpi_and_where_its_limit_comes_from(project, monkeypatch):
    from lidarcheck.harness.goldens.file import load_golden

    def kpi():
        return load_golden(project / "goldens/wall.toml").kpis["detection_probability"]

    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(project / "gitconfig"))
    Path("gitconfig").write_text('[user]\nname = "A\\tReviewer"\nemail = a@b.example\n')
    Path("scenarios/wall.toml").write_text(SCENARIO + 'low = 0.1\nrequirement = "SR-12"\n')
    assert main(["review", "--accept", "all", "--quiet"]) == 0
    assert kpi().accepted_by == "A Reviewer <a@b.example>"
    assert kpi().accepted_date.startswith("20")
    assert kpi().spec.requirement == "SR-12"
    first = Path("goldens/wall.toml").read_bytes()
    assert main(["review", "--accept", "all", "--by", "somebody", "--quiet"]) == 0
    assert Path("goldens/wall.toml").read_bytes() == first  # nothing was open
    Path("goldens/wall.toml").unlink()
    assert main(["review", "--accept", "all", "--by", " some\nbody ", "--quiet"]) == 0
    assert kpi().accepted_by == "some body"
    assert main(["review", "--by", "somebody"]) == 2


def test_review_as_json(project, capsys):
    assert main(["review", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["scenarios"][0]["name"] == "wall"


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("review --reason x", "error: --reason without --accept says why of nothing; add --accept"),
        ("review --release --accept all", "error: --release does not go with --accept; accept first, then release"),
        ("review nowhere", "error: nowhere: there is no such scenario"),
        ("review --accept detection", "error: no reviewed scenario has a KPI 'detection'; did you mean detection_prob"),
        ("check nowhere.toml", "error: nowhere.toml: there is no such scenario"),
        ("check --model nowhere.toml", "error: nowhere.toml: "),
    ],
)
def test_what_cannot_be_done_is_one_line(project, line, says, capsys):
    assert main(line.split()) == 2
    err = capsys.readouterr().err
    assert err.startswith(says)
    assert err.count("\n") == 1
    assert not Path("goldens").exists()


def test_a_damaged_scenario_names_its_line(project, capsys):
    Path("scenarios/wall.toml").write_text(SCENARIO.replace("range_m", "rang_m"))
    assert main(["check"]) == 2
    err = capsys.readouterr().err
    assert all(line.startswith("error: ") for line in err.splitlines())
    assert "wall.toml:" in err
    assert "range_m" in err
