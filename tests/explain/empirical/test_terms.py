"""Empirical terms: what they are fitted to, and that they say of hidden readouts what these did."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable

import numpy as np
import pytest

from explain_core_kit import at_ranges, frames, model
from lidarcheck.effects import make
from lidarcheck.explain.empirical.curves import curve, levels, repeating, rhythms, steps_of
from lidarcheck.explain.empirical.description import describe
from lidarcheck.explain.empirical.residuals import Residual, residuals
from lidarcheck.explain.empirical.terms import Kind, _fitted, again, described
from lidarcheck.explain.search.selection import SearchData
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model import Model
from lidarcheck.scan import Scan

# Curves


def test_levels_turn_one_distribution_into_another() -> None:
    rng = np.random.default_rng(1)
    peaks = rng.integers(10, 60, 20_000).astype(np.float64)
    knots, values = levels("peak_log10", np.log(np.tile(peaks, 3)), np.log(np.round(1.6 * peaks**0.9)))
    assert 10.0**knots == pytest.approx(np.arange(10, 60))
    assert np.exp(values) * 10.0**knots == pytest.approx(np.round(1.6 * np.arange(10, 60) ** 0.9), rel=0.01)


@pytest.mark.parametrize("name", ["area_log10", "width_ns"])
def test_levels_of_the_same_distribution_change_little(name: str) -> None:
    rng = np.random.default_rng(2)
    own = rng.normal(5.0, 1.0, 20_000)
    shown = np.concatenate([own + rng.normal(0, 0.05, len(own)) for _ in range(3)])
    _, values = levels(name, shown, own + rng.normal(0, 0.05, len(own)))
    assert np.abs(values).max() < 0.05


def clumped(rng: np.random.Generator, n: int = 10_000) -> np.ndarray:
    """Ranges of a road and of two walls, which leave most ranges unseen."""
    return np.concatenate([rng.uniform(10, 35, n // 2), rng.normal(61, 0.3, n // 4), rng.normal(140, 0.5, n // 4)])


@pytest.mark.parametrize("period_m", [3.0, 7.7, 15.3, 24.0])
def test_a_rhythm_is_found_in_ranges_that_come_in_clumps(period_m: float) -> None:
    rng = np.random.default_rng(3)
    u = clumped(rng)
    wave = 0.02 + 0.05 * np.sin(2.0 * np.pi * u / period_m + 1.0)
    value, weight = wave + rng.normal(0, 0.1, len(u)), np.full(len(u), 100.0)
    (period, explained), *others = rhythms(u, value, weight, "range_m")
    assert period == pytest.approx(period_m, rel=0.02)
    assert explained == pytest.approx((100.0 * wave**2).sum(), rel=0.1)
    assert all(less < explained for _, less in others)
    knots, values = repeating(u, value, weight, "range_m", period)
    assert knots[-1] - knots[0] == pytest.approx(period_m, rel=0.01)
    assert np.interp(u % knots[-1], knots, values) == pytest.approx(wave, abs=0.015)


def test_where_there_is_no_room_for_a_rhythm_there_is_none() -> None:
    u = np.linspace(10.0, 12.0, 50)
    assert rhythms(u, np.sin(u), np.ones(50), "range_m") == []
    assert rhythms(np.linspace(0, 100, 50), np.ones(50), np.zeros(50), "range_m") == []


@pytest.mark.parametrize(("step_m", "first_m"), [(0.3, 0.0), (0.6, 0.1), (1.63, 1.0)])
def test_the_steps_of_a_coarse_scale_are_found(step_m: float, first_m: float) -> None:
    range_m = clumped(np.random.default_rng(4))
    coarse = first_m + step_m * np.round((range_m - first_m) / step_m)
    found = steps_of(coarse)
    assert found is not None
    assert found[1] == pytest.approx(step_m, rel=1e-9)
    off = (coarse - found[0]) / found[1]
    assert np.abs(off - np.round(off)).max() < 1e-6


def test_ranges_on_no_steps_but_those_of_a_file_have_none() -> None:
    range_m = clumped(np.random.default_rng(5))
    assert steps_of(range_m) is None
    assert steps_of(np.round(range_m, 2)) is None
    assert steps_of(np.zeros(0)) is None


def test_a_fine_curve_over_layers_has_a_knot_for_each() -> None:
    rng = np.random.default_rng(6)
    layer = rng.integers(200, 260, 20_000).astype(np.float64)
    own = rng.normal(0, 0.05, 600)
    knots, values = curve(
        layer, own[layer.astype(int)] + rng.normal(0, 0.02, len(layer)), np.ones(len(layer)), "layer", 80
    )
    assert knots == pytest.approx(np.arange(200, 260))
    assert values == pytest.approx(own[200:260], abs=0.01)
    rough, _ = curve(layer, np.ones(len(layer)), np.ones(len(layer)), "layer", 12)
    assert len(rough) <= 12


# Descriptions


def compressed(scan: Scan) -> Scan:
    """A PEAK that is not linear in the detectors that are ON."""
    return dataclasses.replace(scan, peak=np.round(135.0 * (scan.peak / 135.0) ** 0.8))


def fast_clock(scan: Scan) -> Scan:
    """A WIDTH counted a third too fast."""
    return dataclasses.replace(scan, width_ns=np.round(1.33 * scan.width_ns))


def more_area(scan: Scan) -> Scan:
    return dataclasses.replace(scan, area=np.round(1.2 * scan.area))


def coarse(scan: Scan) -> Scan:
    return at_ranges(scan, 0.8 * np.round(scan.range_m / 0.8))


def rhythmic(scan: Scan) -> Scan:
    return at_ranges(scan, scan.range_m + 0.2 * np.sin(2.0 * np.pi * scan.range_m / 9.0))


FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 12)}


def bench_of(true: Model, believed: Model, changed: Callable[[Scan], Scan] | None) -> tuple[SearchData, Scale, Scale]:
    """The bench of three frames, what is seen of them, and a fourth one for the gap."""
    measured = frames(true, 4, changed=changed, **FINE)
    simulator, select = Simulator((measured[0], measured[2]), believed, 3), Simulator(measured[1:2], believed, 4)
    bench = SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))
    return bench, Scale.of(measured[:3], believed, 8), Scale.of(measured[3:], believed, 9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("changed", "says", "closed"),
    [
        (compressed, r"PEAK over PEAK\b", 0.8),
        (fast_clock, r"WIDTH over WIDTH\b", 0.8),
        (more_area, r"AREA over AREA\b", 0.8),
        (coarse, r"range in steps of 0\.8 m\b", 0.6),
        (rhythmic, r"range over range, the same every (8\.9\d*|9|9\.0\d*) m\b", 0.6),
    ],
)
def test_a_readout_of_no_catalogue_is_described_as_what_it_is(
    changed: Callable[[Scan], Scan], says: str, closed: float
) -> None:
    bench, seen, unseen = bench_of(model(), model(), changed)
    found = describe(bench, seen, 9, lambda *_: None)
    assert re.match(says, found.words), found.words
    with_terms = model()
    for effect in found.effects:
        with_terms = with_terms.with_(effect)
    before, after = (unseen.excess(one)[0] for one in (model(), with_terms))
    assert after < (1.0 - closed) * before


def test_a_signal_that_flickers_is_described_with_its_standard_deviation() -> None:
    flat = make("empirical_flicker", {"covariate": "layer", "knots": [0], "values": [0.4]})
    bench, seen, _ = bench_of(model().with_(flat), model(), None)
    found = describe(bench, seen, 9, lambda *_: None)
    assert found.words.startswith("flicker over ")
    values = next(one for one in found.effects if one.name == "empirical_flicker").settings()["values"]
    assert np.median(values) == pytest.approx(0.4, abs=0.1)


def test_a_chosen_kind_is_fitted_again_whatever_ranks_before_it_on_other_frames() -> None:
    bench, _, _ = bench_of(model().with_(make("range_scale", {"fraction": 0.004})), model(), None)
    kinds = [
        Kind("range", ("range_m", "layer")),
        Kind("range", ("point", "incidence_deg")),
        Kind("range", ("layer",), 80),
    ]
    for kind in kinds:
        found = again(bench.simulator, model(), kind)
        assert found is not None
        own = found.settings()
        assert tuple(own[name] for name in ("covariate", "covariate_2") if name in own) == kind.covariates
    over_range = again(bench.simulator, model(), kinds[0])
    assert over_range is not None
    knots, values = (np.array(over_range.settings()[name]) for name in ("knots", "values"))
    assert np.polyfit(knots, values, 1)[0] == pytest.approx(0.004, rel=0.3)


def test_levels_that_a_file_would_not_tell_apart_are_one() -> None:
    rng = np.random.default_rng(7)
    area = np.log(rng.uniform(20_000.0, 20_010.0, 5_000))
    left = Residual("area", np.zeros(9), np.ones(9), np.arange(9), 2.0, all_values=(area, area + 0.1))
    bench, _, _ = bench_of(model(), model(), None)
    settings = _fitted(bench.simulator, left, Kind("area", ("area_log10",), shape="levels")).settings()
    assert len(settings["knots_area"]) == len(settings["values_area"]) < 5
    assert np.array(settings["values_area"]) == pytest.approx(0.1, abs=0.01)


def test_where_few_echoes_are_seen_no_levels_are_fitted() -> None:
    few = frames(model(), 2, layers=range(256, 262), points=range(470, 480))
    simulator = Simulator(few, model(), 3)
    assert all(one.all_values is None for one in residuals(simulator, model()))
    assert again(simulator, model(), Kind("peak", ("peak_log10",), shape="levels")) is None


def test_parts_that_a_model_describes_already_are_left_as_they_are() -> None:
    own = make("empirical_range", {"covariate": "layer", "knots": [0], "values": [0.1]})
    width = make("empirical_amplitude", {"covariate_width": "layer", "knots_width": [0], "values_width": [1.0]})
    assert described(model()) == set()
    assert described(model().with_(own).with_(width)) == {"range", "width"}
    bench, seen, _ = bench_of(model(), model().with_(own), rhythmic)
    found = describe(bench, seen, 9, lambda *_: None)
    assert own not in found.effects
    assert "range over" not in found.words
