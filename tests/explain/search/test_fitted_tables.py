"""Lists of numbers are read again around the fit that has them."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import at_ranges, frames, model
from lidarcheck.effects import make
from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.effects.search.residuals import at_knots
from lidarcheck.effects.walk_error import WalkError
from lidarcheck.explain.search import fitted_tables
from lidarcheck.explain.search.fitted_tables import read_again
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator
from lidarcheck.scan import Scan

FIRST, LAST = 230, 279
TRUE = np.exp(0.4 * np.random.default_rng(3).standard_normal(LAST - FIRST + 1))
PLACE = {"first_layer": FIRST, "last_layer": LAST, "every": 1}


@pytest.fixture(scope="module")
def simulator() -> Simulator:
    gains = make("layer_gain", {**PLACE, "gain": 1.0, "gains": tuple(TRUE.tolist())})
    return Simulator(frames(model(gains), 2, layers=range(FIRST, LAST + 1), points=range(320, 640, 4)), model(), 3)


def with_gains(simulator: Simulator, gains: np.ndarray) -> Fit:
    probe = Probe(
        "layer_gain", {"gain": 1.0, "gains": tuple(gains.tolist())}, search_spec("layer_gain").free, PLACE, "pattern"
    )
    return fit(simulator, [probe], [probe.start()], rounds=0)


def gains_of(found: Fit) -> np.ndarray:
    settings = found.effects()[0].settings()
    return float(settings["gain"]) * np.asarray(settings["gains"])


def test_gains_that_were_read_too_small_come_out_right(simulator: Simulator) -> None:
    """A list that says half of what each layer does leaves much open, and no factor on all layers helps."""
    start = with_gains(simulator, np.sqrt(TRUE))
    found = read_again(simulator, start)
    assert found.distance - simulator.floor_distance < 0.4 * (start.distance - simulator.floor_distance)
    before, after = (np.abs(np.log(gains_of(one) / TRUE)) for one in (start, found))
    assert np.median(after) < 0.5 * np.median(before)
    assert after.mean() < 0.6 * before.mean()
    assert np.array_equal(found.x[0], start.x[0])


def test_other_frames_may_have_other_layers(simulator: Simulator) -> None:
    """Gains of layers that these frames lack stay as they are; those that the list lacks are not added."""
    start = with_gains(simulator, np.sqrt(TRUE))
    true = model(make("layer_gain", {**PLACE, "gain": 1.0, "gains": tuple(TRUE.tolist())}))
    other = Simulator(frames(true, 2, layers=range(FIRST + 10, LAST + 6), points=range(320, 640, 4)), model(), 3)
    there = fit(other, start.probes, start.x, rounds=0)
    found = read_again(other, there)
    assert found.distance < there.distance
    before, after = gains_of(there), gains_of(found)
    assert np.array_equal(after[:10], np.round(before[:10], 3))
    assert np.abs(np.log(after / TRUE))[10:].mean() < 0.7 * np.abs(np.log(before / TRUE))[10:].mean()


def saturating(area: np.ndarray) -> np.ndarray:
    """A walk that no curve of two numbers has [m]."""
    return 0.25 * np.exp(-area / 300.0) - 0.1 * np.exp(-(((np.log10(area) - 2.6) / 0.15) ** 2))


def walked(scan: Scan) -> Scan:
    return at_ranges(scan, scan.range_m + saturating(scan.area))


def test_what_a_walk_s_curve_has_not_comes_out_as_a_table() -> None:
    fine = {"layers": range(230, 290, 2), "points": range(320, 640, 6)}
    simulator = Simulator(frames(model(), 3, changed=walked, **fine), model(), 3)
    probe = next(one for one in fixed_probes(["walk_error"]) if not one.variant)
    curve = fit(simulator, [probe], [probe.start()], rounds=4)
    found = read_again(simulator, curve)
    assert found.distance - simulator.floor_distance < 0.5 * (curve.distance - simulator.floor_distance)
    there, plain = found.effects()[0], curve.effects()[0]
    assert isinstance(there, WalkError)
    assert isinstance(plain, WalkError)
    assert there.per_decade_m == pytest.approx(plain.per_decade_m, abs=0.01)
    area = np.exp(simulator.summaries.expected.mean[simulator.summaries.expected.known, 1])
    off = [np.abs(walk.shift_m(area) - saturating(area)).mean() for walk in (there, plain)]
    assert off[0] < 0.8 * off[1]
    span = np.ptp(plain.shift_m(area))
    assert 0.0 < np.abs(there.shifts_m).max() <= 0.32 * span


def test_the_other_numbers_follow_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """A curve and a reflectance have made up for what the curve has not: beside these the table alone leaves most."""
    spec = search_spec("walk_error")
    assert spec.list_reader is not None
    reader = spec.list_reader
    brighter = model(make("material_reflectance", {"factor": 1.45, "material_id": 2}))
    fine = {"layers": range(230, 290, 2), "points": range(320, 640, 6)}

    def late(scan: Scan) -> Scan:
        return at_ranges(scan, scan.range_m - 0.2 * np.exp(-scan.area / 500.0))

    simulator = Simulator(frames(brighter, 3, changed=late, **fine), model(), 3)
    walk = next(one for one in fixed_probes(["walk_error"]) if not one.variant)
    material = Probe(
        "material_reflectance", {"factor": 1.2}, search_spec("material_reflectance").free, {"material_id": 2}
    )
    alone = fit(simulator, [walk], [walk.start()], rounds=4)
    curve = fit(simulator, [walk, material], [*alone.x, material.start()], rounds=4)
    left = {}
    for rounds in (0, reader.rounds, 4):
        other = dataclasses.replace(spec, list_reader=dataclasses.replace(reader, rounds=rounds))
        monkeypatch.setattr(
            fitted_tables, "search_spec", lambda name, own=other: {"walk_error": own}.get(name) or search_spec(name)
        )
        left[rounds] = read_again(simulator, curve).distance - simulator.floor_distance
    assert left[0] < curve.distance - simulator.floor_distance
    # How far the search's own rounds lead is a matter of the frames' seed, 0.0 to 0.8 of it are left: more lead on.
    assert left[reader.rounds] < 0.9 * left[0]
    assert left[4] < 0.3 * left[0]


@pytest.mark.long
def test_what_a_power_of_the_cosine_has_not_comes_out_as_factors() -> None:
    """A gloss at 30 degrees and a shade at 60 on top of the power."""
    bumps = np.array([0.6, 0.8, 1.2, 1.6, 1.6, 1.0, 0.6, 0.5, 0.8, 1.2])
    sheen = make("incidence_falloff", {"exponent": 2.0, "factors": tuple(bumps.tolist())})
    fine = {"layers": range(230, 290, 2), "points": range(320, 640, 4)}
    simulator = Simulator(frames(model(sheen), 3, **fine), model(), 3)
    probe = fixed_probes(["incidence_falloff"])[0]
    curve = fit(simulator, [probe], [probe.start()], rounds=4)
    found = read_again(simulator, curve)
    assert found.distance - simulator.floor_distance < 0.6 * (curve.distance - simulator.floor_distance)

    def factor(one: Fit) -> np.ndarray:
        settings = one.effects()[0].settings()
        power = np.cos(np.deg2rad(simulator.beams.incidence_deg)) ** (settings["exponent"] - 1.0)
        knots = settings.get("factors") or (1.0,)
        return np.asarray(power * np.interp(simulator.beams.incidence_deg / 10.0, np.arange(len(knots)), knots))

    angle, true = simulator.beams.incidence_deg, np.cos(np.deg2rad(simulator.beams.incidence_deg))
    true = true * np.interp(angle / 10.0, np.arange(10), bumps)
    off = [np.abs(np.log(factor(one) / true))[angle < 85.0].mean() for one in (found, curve)]
    assert off[0] < 0.8 * off[1]


def test_where_no_beams_are_a_table_goes_on_between_its_neighbours() -> None:
    """Many beams at 1, 4.5 and 8, and none between: other frames may have some there."""
    place = np.repeat([1.0, 4.5, 8.0], 500)
    value = np.repeat([0.0, -0.7, -1.4], 500) + 0.1 * np.random.default_rng(2).standard_normal(1500)
    found = at_knots(place, value, np.full(1500, 100.0), 10)
    assert np.abs(found - -0.2 * (np.arange(10) - 1.0)).max() < 0.08
    assert np.array_equal(at_knots(place[:0], value[:0], place[:0], 10), np.zeros(10))


def test_what_comes_no_nearer_is_left_as_it_is(simulator: Simulator) -> None:
    right = with_gains(simulator, np.round(TRUE, 3))
    assert np.abs(np.log(gains_of(read_again(simulator, right)) / TRUE)).max() < 0.1
    plain = fixed_probes(["signal_gain"])[0]
    nothing = fit(simulator, [plain], [plain.start()], rounds=0)
    assert read_again(simulator, nothing) is nothing
