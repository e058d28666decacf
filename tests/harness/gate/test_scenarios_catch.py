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
WATCHING = ("watch_", "sensor_")
MOST_OF_CHANCE = 2.5


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


@pytest.mark.parametrize(
    "file",
    [file for file in toml_files(PROJECT.scenarios) if file.stem.startswith(WATCHING)],
    ids=lambda file: file.stem,
)
def test_a_scenario_that_watches_for_errors_tolerates_little_more_than_chance(file) -> None:
    loose = []
    for name, kpi in load_golden(PROJECT.golden(file.stem)).kpis.items():
        chance = sensitivity.resolution(share(), kpi.reference.sd)
        # A share of few beams moves by one of them or not at all, which a spread over seeds hardly knows.
        a_beam = 1.0 / kpi.reference.trials if kpi.spec.kind == "proportion" and kpi.reference.trials > 0 else 0.0
        exact = kpi.spec.kind == "distance" or chance < 1e-9 or kpi.spec.tolerance <= 2.0 * a_beam
        if not exact and kpi.spec.tolerance > MOST_OF_CHANCE * chance:
            loose.append(f"{name}: {kpi.spec.tolerance:g} where chance alone explains {chance:.3g}")
    assert not loose


def test_what_must_be_caught_and_where_a_limit_comes_from_enter_no_hash() -> None:
    table = load_toml(PROJECT.scenario("background_SLIM"), ScenarioTable).kpis[0]
    told = table.model_copy(update={"requirement": "SR-12", "catches": 9.0})
    assert hashed(told) == hashed(table)
    assert not {"requirement", "catches"} & hashed(table).keys()
