"""A project that version 0.1.0 wrote: later versions read it as that one did, and find in it what that one found."""

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest

from lidarcheck.cases.case import load_case
from lidarcheck.cli import main
from lidarcheck.explain.report.load import changed_since, load_explanation
from lidarcheck.formats.lut import load_lut, save_lut
from lidarcheck.formats.settings import load_settings, save_settings
from lidarcheck.harness.goldens.file import dump_golden, load_golden
from lidarcheck.harness.goldens.provenance import parameters_hash
from lidarcheck.model import load_model, save_model
from lidarcheck.model.files.write import write_model
from places import ROOT

OLD = ROOT / "tests/data/old_project"
NAMES = ("scene_SLIM", "walls_SMART", "weather_SMART")
MODELS: dict[str, str] = json.loads((OLD / "hashes.json").read_text(encoding="utf-8"))


def provenance(name: str) -> dict[str, Any]:
    """How the golden was made, as its file says."""
    document = tomllib.loads((OLD / f"goldens/{name}.toml").read_text(encoding="utf-8"))
    return dict(document["provenance"])


def contents(project: Path) -> dict[str, bytes]:
    """The bytes of all files but those of a run's own."""
    paths = (path for path in project.rglob("*") if path.is_file() and ".lidarcheck" not in path.parts)
    return {path.relative_to(project).as_posix(): path.read_bytes() for path in paths}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return Path(shutil.copytree(OLD, tmp_path / "project"))


MOVED = {"walls_SMART": "area_mean.material_1_7.30_180m", "weather_SMART": "false_alarm_probability.echo_2_60m"}
"""KPIs whose definition has changed since: an echo lies on a surface within half a pulse, no longer within 0.5 m."""
REDRAWN = ("scene_SLIM", "walls_SMART")
"""Scenarios whose echoes are other draws of the same laws since: the exact chain makes two of each word."""


def check_of(project: Path, code: int) -> dict[str, Any]:
    """The JSON of a check of the whole project."""
    report = project.parent / "check.json"
    assert main(["check", str(project), "--quiet", "--json", str(report)]) == code
    return dict(json.loads(report.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The JSON of a check of the whole project, which leaves it alone."""
    project = Path(shutil.copytree(OLD, tmp_path_factory.mktemp("checked") / "project"))
    found = check_of(project, 1)
    assert contents(project) == contents(OLD)
    return found


def test_a_check_finds_every_kpi_identical_but_those_defined_anew(checked: dict[str, Any]) -> None:
    assert [scenario["name"] for scenario in checked["scenarios"]] == list(NAMES)
    for scenario in checked["scenarios"]:
        same = [kpi for kpi in scenario["kpis"] if kpi["name"] != MOVED.get(scenario["name"])]
        assert len(same) == len(scenario["kpis"]) - (scenario["name"] in MOVED)
        wanted = {"equivalent"} if scenario["name"] in REDRAWN else {"identical"}
        assert {kpi["verdict"] for kpi in same} == wanted
        assert {kpi["release"]["verdict"] for kpi in same} == wanted


def test_one_line_says_which_command_moves_a_scenario(checked: dict[str, Any]) -> None:
    for scenario in checked["scenarios"]:
        name = scenario["name"]
        notes = [note for note in scenario["notes"] if f"lidarcheck review {name}" in note and MOVED[name] in note]
        assert len(notes) == len(scenario["notes"]) == (name in MOVED and name not in REDRAWN)


def test_that_command_moves_the_project(project: Path) -> None:
    check_of(project, 1)
    for name in MOVED:
        command = ["review", str(project / f"scenarios/{name}.toml"), "--accept", "all", "--reason", "the window", "-q"]
        assert main(command) == 0
    found = check_of(project, 0)
    for scenario in found["scenarios"]:
        verdicts = {kpi["verdict"] for kpi in scenario["kpis"]}
        assert verdicts == {"identical" if scenario["name"] in MOVED else "equivalent"}


def test_another_source_alone_changes_no_verdict(checked: dict[str, Any]) -> None:
    assert checked["source"] not in {provenance(name)["model_source"] for name in NAMES}
    redrawn = sum(len(scenario["kpis"]) for scenario in checked["scenarios"] if scenario["name"] in REDRAWN)
    assert checked["counts"]["identical"] == 10 - redrawn - len(set(MOVED) - set(REDRAWN))


def test_the_hashes_are_those_in_the_goldens(checked: dict[str, Any]) -> None:
    for scenario in checked["scenarios"]:
        made = provenance(scenario["name"])
        assert scenario["hashes"] == {"scenario": made["scenario"], "parameters": made["parameters"]}


@pytest.mark.parametrize("name", [*NAMES, *(f"release/{name}" for name in NAMES)])
def test_a_golden_is_written_as_it_was_read(name: str) -> None:
    file = OLD / f"goldens/{name}.toml"
    assert dump_golden(load_golden(file)) == file.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", MODELS)
def test_the_parameters_of_a_model_hash_to_what_they_did(name: str) -> None:
    """Every effect, with every one of its parameters, is in one of the models."""
    assert parameters_hash(load_model(OLD / name)) == MODELS[name]


@pytest.mark.parametrize("name", MODELS)
def test_a_model_is_written_back_unchanged(project: Path, name: str) -> None:
    file = project / name
    model, out = load_model(file), file.with_name("out.toml")
    if model.external is None:
        assert write_model(file, model, out).rewritten == ""
        assert out.read_bytes() == file.read_bytes()
    save_model(model, out)
    assert parameters_hash(load_model(out)) == MODELS[name]
    if name == "models/all_effects.toml":
        assert out.read_bytes() == file.read_bytes()


def test_tables_and_settings_keep_their_bytes(project: Path) -> None:
    luts, out = project / "luts", project / "out"
    lut = load_lut(luts / "bench_vertical.ini")
    assert [len(table) for table in lut.tables.values()] == [11, 3]
    save_lut(lut, out)
    assert out.read_bytes() == (luts / "bench_vertical.ini").read_bytes()
    for axis, name, entries in (("vertical", "V_SMART", 2), ("horizontal", "H_SLIM", 1)):
        file = luts / f"Blooming_Calibration_{name}.json"
        settings = load_settings(file)
        assert (settings.axis, len(settings.entries)) == (axis, entries)
        save_settings(settings, out)
        assert out.read_bytes() == file.read_bytes()


def test_a_case_and_what_was_found_in_it_are_read() -> None:
    case = load_case(OLD / "case")
    assert [(frame.number, len(frame.ideal)) for frame in case.frames] == [(0, 256), (1, 256), (2, 256)]
    assert case.left_out == {}
    found = load_explanation(OLD / "found/report.json", OLD / "found/model.toml", case.model)
    assert (found.verdict, [finding.name for finding in found.findings]) == ("explained", ["range_offset"])
    assert found.hashes == case.hashes
    assert changed_since(OLD / "case", found.hashes) == []
    assert found.model.effects[0].settings() == {"offset_m": 0.29715}
