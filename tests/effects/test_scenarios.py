"""A scenario and a golden for every effect, and what they can see."""

import math
from functools import cache

import numpy as np
import pytest

from lidarcheck.effects import catalogue
from lidarcheck.harness.gate import evidence, sensitivity
from lidarcheck.harness.goldens.file import load_golden
from lidarcheck.harness.scenario.measure import measure
from lidarcheck.harness.scenario.scenario import load_scenario
from places import ROOT

SEEDS = range(9_000, 9_003)


@cache
def error_share() -> float:
    """The part of the error budget that one KPI of the whole suite has."""
    files = sorted((ROOT / "scenarios").glob("*.toml"))
    return evidence.error_share(sum(file.read_text(encoding="utf-8").count("[[kpis]]") for file in files))


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
@pytest.mark.parametrize("name", catalogue())
def test_an_effect_that_is_missing_is_caught_at_its_typical_strength(name: str, variant: str) -> None:
    stem = f"effect_{name}_{variant}"
    scenario = load_scenario(ROOT / "scenarios" / f"{stem}.toml")
    golden = load_golden(ROOT / "goldens" / f"{stem}.toml")
    (effect,) = scenario.model.effects
    assert effect == type(effect)(), "the scenario does not show the effect at its typical strength"
    without = [measure(scenario, scenario.model.without(name), seed) for seed in SEEDS]
    caught = []
    for kpi in golden.kpis.values():
        values = [seed.values.get(kpi.spec.name, math.nan) for seed in without]
        if kpi.spec.kind != "distance" and np.isfinite(values).all():
            smallest = sensitivity.smallest_change(kpi.spec, kpi.reference, error_share())
            caught.append(abs(np.mean(values) - kpi.reference.mean) > smallest)
    assert any(caught)


def test_every_scenario_of_an_effect_or_a_scene_says_what_it_shows() -> None:
    for file in (ROOT / "scenarios").glob("*.toml"):
        assert len(file.read_text(encoding="utf-8").split("description =")[0].strip("# \n")) > 30, file.name
