"""Every golden of this project catches the change that its scenario wants caught. Reads files, simulates nothing."""

import dataclasses
from functools import cache

import pytest

from lidarcheck.formats.config import load_toml
from lidarcheck.harness.gate import evidence, sensitivity
from lidarcheck.harness.goldens.file import load_golden
from lidarcheck.harness.layout import Layout, toml_files
from lidarcheck.harness.scenario.asked import hashed, name_of
from lidarcheck.harness.scenario.file import ScenarioTable
from lidarcheck.harness.scenario_run import kpis_in_goldens
from places import ROOT

PROJECT = Layout(ROOT, ROOT / "scenarios")


@cache
def share() -> float:
    return evidence.error_share(kpis_in_goldens(PROJECT))


@pytest.mark.parametrize("file", toml_files(PROJECT.scenarios), ids=lambda file: file.stem)
def test_a_golden_catches_what_its_scenario_wants_caught(file) -> None:
    golden, found = load_golden(PROJECT.golden(file.stem)), []
    for table in load_toml(file, ScenarioTable).kpis:
        kpi = golden.kpis[name_of(table)]
        spec = dataclasses.replace(kpi.spec, catches=table.catches)
        found += [f"{spec.name}: {words}" for words in [sensitivity.misses(spec, kpi.reference, share())] if words]
        # The more KPIs a suite has, the wider is what chance explains of each: goldens become too coarse as it grows.
        found += [f"{spec.name}: {words}" for words in [sensitivity.too_coarse(spec, kpi.reference, share())] if words]
    assert not found


def test_what_must_be_caught_and_where_a_limit_comes_from_enter_no_hash() -> None:
    table = load_toml(PROJECT.scenario("background_SLIM"), ScenarioTable).kpis[0]
    told = table.model_copy(update={"requirement": "SR-12", "catches": 9.0})
    assert hashed(told) == hashed(table)
    assert not {"requirement", "catches"} & hashed(table).keys()
