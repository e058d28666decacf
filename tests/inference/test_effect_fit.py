"""What the fits must find: parameters within intervals that are worth the name, small errors, white surfaces."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import MATERIALS, WALL, case, frames, model
from lidarcheck.effects import make
from lidarcheck.explain.decision.closure import intervals
from lidarcheck.explain.search.screening import screen
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.explain.workflow import explain
from lidarcheck.inference.effect_fit import fit
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.nuisances import LIMIT, Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.sensor import Material

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 12)}
TRUTHS = [
    ("range_offset", {"offset_m": 0.06}, "offset_m", 0.008, 0.02),
    ("range_offset", {"offset_m": 0.25}, "offset_m", 0.03, 0.08),
    ("range_scale", {"fraction": 0.004}, "fraction", 0.0004, 0.0015),
    ("walk_error", {"per_decade_m": 0.2, "bend_m": 0.0}, "per_decade_m", 0.07, 0.25),
]


@pytest.mark.parametrize(("name", "true", "parameter", "near", "wide"), TRUTHS)
def test_a_fit_ends_at_the_truth_with_an_interval_worth_the_name(
    name: str, true: dict, parameter: str, near: float, wide: float
) -> None:
    simulator = Simulator(frames(model(make(name, true)), 2, **FINE), model(), 6)
    best = max(screen(simulator, fixed_probes([name])), key=lambda one: one.gain(simulator, simulator.measured)[0])
    found = fit(simulator, [best.probe], [best.probe.start()], rounds=5)
    one = intervals(simulator, found, 1.5)[0][parameter]
    assert one.value == pytest.approx(true[parameter], abs=near)
    assert 0.0 < one.high - one.low < wide
    assert found.distance < 1.4 * simulator.floor_distance


@pytest.mark.parametrize("seed", [8, 9])
def test_a_small_error_of_a_table_entry_is_fitted_to_the_end(seed: int) -> None:
    true = Nuisance(materials={WALL: -2.0}).model(model())
    simulator = Simulator(frames(true, 2, layers=range(230, 290, 2), points=range(320, 640, 8)), model(), seed)
    plain = fit(simulator, [], [])
    found = fit_nuisance(simulator, plain, rounds=4)
    assert found.nuisance.materials[WALL] == pytest.approx(-2.0, abs=0.6)
    before, after = (simulator.distance(f.shown, metric=simulator.bare) for f in (plain, found))
    assert after < 0.3 * before


@pytest.mark.long
def test_an_offset_is_not_taken_for_a_sensor_that_moves() -> None:
    found = explain(case(model(make("range_offset", {"offset_m": 0.12})), model()), seed=1)
    assert [one.name for one in found.findings] == ["range_offset"]
    assert found.findings[0].parameters["offset_m"].value == pytest.approx(0.12, abs=0.02)


@pytest.mark.parametrize("reflectance", [0.97, 1.0])
def test_a_white_surface_stays_white(reflectance: float) -> None:
    white = dataclasses.replace(model(), materials=MATERIALS | {WALL: Material("wall", reflectance)})
    assert Nuisance(materials={WALL: LIMIT}).model(white).materials[WALL].reflectance == 1.0
    assert explain(case(white, white, 3), seed=1).verdict == "no_gap"
    assert np.isfinite(Nuisance(materials={WALL: -LIMIT}).model(white).materials[WALL].reflectance)
