"""`check --sensitivity` on a suite of one small scenario: what is watched, what is not, and a run that goes on."""

import json
import shutil
from pathlib import Path

import pytest

from lidarcheck.cli import main
from scenario_texts import kpis, surface

MODEL = """
[model]
variant = "SMART"

[model.materials.1]
name = "panel"
reflectance = 0.8

[[model.effects]]
name = "signal_gain"
gain = 0.9
"""


@pytest.fixture(scope="module")
def reviewed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project whose one scenario sees the mean AREA of a wall at 40 m, with its golden."""
    root = tmp_path_factory.mktemp("suite")
    (root / "scenarios").mkdir()
    text = f'description = "a wall"\n{MODEL}\n{surface((260, 260), (460, 499), (40.0, 40.0))}{kpis(area_mean=12.0)}'
    (root / "scenarios" / "wall.toml").write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        assert main(["review", "--accept", "all", "--quiet"]) == 0
    return root


@pytest.fixture
def suite(reviewed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it, to work in."""
    root = tmp_path / "suite"
    shutil.copytree(reviewed, root)
    monkeypatch.chdir(root)
    return root


def matrix(*options: str) -> int:
    return main(["check", "--sensitivity", "--quiet", *options])


def test_a_parameter_that_turns_a_kpi_red_is_watched(suite: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (suite / "goldens" / "wall.toml").read_bytes()
    assert matrix("--only", "signal_gain") == 0
    out = capsys.readouterr().out
    assert "signal_gain.gain" in out
    assert "0.9 -> 0.99" in out
    assert "wall" in out
    assert "area_mean" in out
    assert "sensitivity holds: 1 of 1 parameters are watched" in out
    assert (suite / "goldens" / "wall.toml").read_bytes() == before
    assert not (suite / ".lidarcheck" / "proposals" / "wall.toml").exists()


def test_one_that_turns_none_red_fails_the_suite_and_is_named(suite: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert matrix("--only", "max_range_m", "--json", "found.json") == 1
    out = capsys.readouterr().out
    assert "FAILED sensor.max_range_m is watched by none: 300 -> 270 m turns none of wall red" in out
    found = json.loads((suite / "found.json").read_text(encoding="utf-8"))
    assert found["unwatched"] == ["sensor.max_range_m"]
    assert found["exit_code"] == 1
    assert [one["watched_by"] for one in found["parameters"]] == [[]]


def test_a_run_that_was_broken_off_goes_on_where_it_was(
    suite: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert matrix("--only", "signal_gain") == 0
    first = capsys.readouterr().out
    kept = suite / ".lidarcheck" / "sensitivity.jsonl"
    with kept.open("a", encoding="utf-8") as file:
        file.write('{"key": "cut o')  # as an interrupt leaves it

    def simulate(*_: object, **__: object) -> None:
        raise AssertionError("what is known is not simulated again")

    monkeypatch.setattr("lidarcheck.harness.scenario.measure.measure", simulate)
    assert matrix("--only", "signal_gain") == 0
    assert capsys.readouterr().out.splitlines()[:2] == first.splitlines()[:2]
    assert matrix("--only", "sensor.threshold") == 2
    assert "what is known is not simulated again" in capsys.readouterr().err


def test_a_scenario_that_is_red_as_it_stands_watches_nothing(suite: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = suite / "scenarios" / "wall.toml"
    file.write_text(file.read_text(encoding="utf-8").replace("reflectance = 0.8", "reflectance = 0.6"), "utf-8")
    assert matrix("--only", "signal_gain") == 1
    out = capsys.readouterr().out
    assert "signal_gain.gain is watched by none" in out
    assert "FAILED wall falls out as it stands and was not counted: run `lidarcheck check wall`" in out


def test_all_goes_on_beyond_the_first_red_scenario(suite: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder in ("scenarios", "goldens"):
        text = (suite / folder / "wall.toml").read_text(encoding="utf-8")
        (suite / folder / "wall_again.toml").write_text(text, encoding="utf-8")
    (suite / "goldens" / "wall_again.toml").unlink()
    assert main(["review", "wall_again", "--accept", "all", "--quiet"]) == 0
    capsys.readouterr()
    assert matrix("--only", "signal_gain") == 0
    assert "wall_again" not in capsys.readouterr().out
    assert matrix("--only", "signal_gain", "--all") == 0
    assert "wall_again" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "--only", "fog"], "--only needs --sensitivity"),
        (["check", "--all"], "--all needs --sensitivity"),
        (["check", "--sensitivity", "--seed", "3"], "--seed cannot be combined with --sensitivity"),
        (["check", "--sensitivity", "--only", "nothing_like_it"], "no parameter has 'nothing_like_it' in its name"),
    ],
)
def test_what_cannot_be_asked_is_refused(
    suite: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert main(arguments) == 2
    assert words in capsys.readouterr().err
