"""Echoes in a histogram: against a slow search of the same counts, and against what the laws promise."""

import numpy as np
import pytest

import slow_histogram
from any_detector_kit import LIGHT_SPEED, chip, same
from lidarcheck.model.histogram.echoes import histogram_echoes
from lidarcheck.model.histogram.search import background_of, coates
from lidarcheck.sensor.feature import Feature

FEATURES = (
    Feature("H", "histogram", bits=32),
    Feature("CONFIDENCE", "confidence", step=1.0, bits=8),
    Feature("N", "photons"),
)
GLASS = {"cover_glass": 0.01, "background_per_ns": 2e-4}


@pytest.mark.parametrize(
    "numbers",
    [
        {},
        GLASS,
        {"readout": "first", "coates": True, "cover_glass": 0.3, "background_per_ns": 0.02},
        {"readout": "first", "cover_glass": 0.3, "background_per_ns": 0.02},
        {"bins": 61, "bin_ns": 0.21, "pulse_fwhm_ns": 0.5, **GLASS},
        {"dead_bins": 5, "shots": 2000, "cover_glass": 0.2, "background_per_ns": 0.005},
        {"spads": 1, "shots": 300, "background_per_ns": 0.01},
        {"first_bin_ns": 0.4, **GLASS},
        {"bins": 61, "pulse_fwhm_ns": 0.65, "threshold_sigma": 0.5, "background_per_ns": 1e-3},
        {"features": (Feature("H", "histogram", bits=9), Feature("N", "photons")), **GLASS},
    ],
)
def test_echoes_are_those_that_a_slow_search_finds_in_the_same_counts(numbers):
    detector = chip(**{"features": FEATURES, "max_echoes": 16, "min_range_m": 0.0, "max_range_m": 1.7} | numbers)
    n, seen = 60, 0
    rng = np.random.default_rng(8)
    for ranges, signals in (
        ([0.05], [0.004]),
        ([0.7, 0.78], [0.02, 0.015]),
        ([0.3, 1.2], [0.05, 0.001]),
        ([1.66], [0.01]),
    ):
        scale = 3e5 / detector.trials * rng.uniform(0.5, 2.0)
        asked = same(n, ranges, np.array(signals) * scale, background=detector.background_per_ns)
        found = histogram_echoes(asked, detector, seed=int(rng.integers(1000)), threads=1)
        for zone in range(n):
            rows = found.beam == zone
            slow = slow_histogram.echoes(detector, found.histogram[zone])
            slow = [(LIGHT_SPEED / 2.0 * (detector.first_bin_ns + t * detector.bin_ns), s, b) for t, s, b, _ in slow]
            slow = sorted(echo for echo in slow if 0.0 <= echo[0] <= 1.7 and echo[1] > 0.0)
            assert len(slow) == rows.sum()
            for ours, theirs in ((found.range_m, 0), (found.amplitude, 1), (found.numbers.floor_counts, 2)):
                assert ours[rows] == pytest.approx([echo[theirs] for echo in slow], rel=1e-7, abs=1e-7)
            seen += len(slow)
    assert seen > n


def test_the_range_scatters_as_photon_statistics_say():
    for signal, background in ((2e-3, 1e-5), (2e-3, 0.02)):
        detector = chip(features=FEATURES, background_per_ns=background, threshold_sigma=5.0)
        found = histogram_echoes(same(4000, 0.9, signal, background=background), detector, threads=1)
        photons, floor = found.amplitude.mean(), found.numbers.floor_counts.mean()
        sigma = LIGHT_SPEED / 2.0 * 0.6 / 2.3548 / np.sqrt(photons) * np.sqrt(1.0 + 2.0 * floor / photons)
        near = found.range_m[np.abs(found.range_m - 0.9) < 0.05]
        assert len(near) > 3900
        assert near.std() == pytest.approx(sigma, rel=0.12)
        assert near.mean() == pytest.approx(0.9, abs=5.0 * sigma / np.sqrt(len(near)) + 2e-4)


def test_pile_up_pulls_first_photons_to_the_front_and_coates_undoes_it():
    strong = {"readout": "first", "background_per_ns": 1e-5, "features": FEATURES}
    asked = same(200, 0.9, 3.0, background=1e-5)
    piled = histogram_echoes(asked, chip(**strong), threads=1).range_m.mean()
    undone = histogram_echoes(asked, chip(coates=True, **strong), threads=1).range_m.mean()
    assert piled < 0.9 - 0.01
    assert undone == pytest.approx(0.9, abs=1e-3)


def test_coates_gives_back_the_rates():
    rate = np.array([0.1, 0.0, 2.0, 0.3, 5.0, 1e-6])
    trials = 10_000_000
    counts = trials * np.exp(-np.concatenate([[0.0], np.cumsum(rate)[:-1]])) * -np.expm1(-rate)
    coates(trials, counts)
    assert counts == pytest.approx(trials * rate, rel=1e-6)


def test_coates_survives_bins_that_take_all_that_is_left():
    counts = np.array([4.0, 6.0, 0.0])
    coates(10, counts)
    assert counts == pytest.approx([10.0 * np.log(10.0 / 6.0), 10.0 * np.log(12.0), 0.0])


@pytest.mark.parametrize("bins", [8, 11, 128, 1000])
def test_the_background_is_read_off_the_last_quarter_without_an_echo_in_it(bins):
    rng = np.random.default_rng(bins)
    for mean in (0.05, 3.0, 400.0):
        counts = rng.poisson(mean, bins).astype(float)
        counts[-1] += 50.0 * (1.0 + mean)
        assert background_of(counts, np.empty(bins)) == pytest.approx(slow_histogram.background(counts), rel=1e-12)


def test_a_cover_glass_alone_is_rarely_an_echo():
    """With what the glass is expected to give left out of the noise, half of the empty zones show an echo."""
    detector = chip(cover_glass=0.02, background_per_ns=2e-5, features=FEATURES)
    found = histogram_echoes(same(3000, 0.0, 0.0, background=2e-5), detector, threads=1)
    assert len(found) < 30


def test_confidence_and_photons_are_those_of_the_echo():
    detector = chip(features=FEATURES, background_per_ns=1e-4)
    found = histogram_echoes(same(50, 0.9, 3e-4, background=1e-4), detector, threads=1)
    photons, floor = found.amplitude, found.numbers.floor_counts
    share = np.minimum(photons / np.sqrt(photons + floor) / 20.0, 1.0)
    assert np.array_equal(found.features["CONFIDENCE"], np.rint(255.0 * share))
    assert np.array_equal(found.features["N"], photons)
    assert found.features["CONFIDENCE"].max() < 255.0


def test_the_background_feature_is_the_floor_of_all_bins():
    detector = chip(features=(Feature("H", "histogram", bits=32), Feature("AMBIENT", "background")))
    found = histogram_echoes(same(5, 0.9, 0.01, background=1e-5), detector, threads=1)
    floor = [128.0 * slow_histogram.background(found.histogram[zone].astype(float)) for zone in found.beam]
    assert found.features["AMBIENT"] == pytest.approx(floor)


def test_the_stronger_of_two_by_photons_is_kept():
    detector = chip(max_echoes=1, features=FEATURES)
    found = histogram_echoes(same(100, [0.4, 1.2], [0.01, 0.02], background=1e-5), detector, threads=1)
    assert np.all(found.range_m > 1.0)
    pair = chip(max_echoes=2, keep="strongest_second", return_order="as_kept", features=FEATURES)
    found = histogram_echoes(same(100, [0.4, 1.2], [0.01, 0.02], background=1e-5), pair, threads=1)
    assert found.echo_number.tolist() == [1, 2] * 100
    assert found.made_number.tolist() == [2, 1] * 100
