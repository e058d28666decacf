"""What a histogram chip counts: first photons, all photons with dead time, any number of trials, and what clips."""

import numpy as np
import pytest
from scipy import stats

import slow_histogram
from any_detector_kit import chip, light, same
from lidarcheck.model.exact.pulse_form import PulseForm
from lidarcheck.model.histogram.echoes import histogram_echoes
from lidarcheck.model.histogram.numbers import expected
from lidarcheck.model.histogram.pulse import CountedPulse, fwhm_bins, pulse_of, template
from lidarcheck.scan import Haze, PulseShape
from lidarcheck.sensor.feature import Feature

HISTOGRAM = (Feature("H", "histogram", bits=32),)
RANGES, SIGNALS = [0.5, 0.52, 1.1], [0.02, 0.01, 0.3]


def drawn(detector, n=400, ranges=RANGES, signals=SIGNALS, **more):
    asked = same(n, ranges, signals, background=detector.background_per_ns, **more)
    return histogram_echoes(asked, detector, threads=1).histogram.astype(float)


def agrees(counts, q, trials):
    """Whether means and variances are a binomial's in every bin, all bins together: chi-squared, and the worst z."""
    n = len(counts)
    z = (counts.mean(axis=0) - trials * q) / np.sqrt(trials * q * (1.0 - q) / n)
    assert stats.chi2.sf((z**2).sum(), len(q)) > 1e-4
    assert np.abs(z).max() < 5.0
    spread = counts.var(axis=0, ddof=1) / (trials * q * (1.0 - q))
    assert abs(np.sqrt(n / 2.0) * (spread.mean() - 1.0) * np.sqrt(len(q))) < 5.0


@pytest.mark.parametrize(
    "numbers",
    [
        {"readout": "first", "cover_glass": 0.2},
        {"readout": "first", "spads": 1, "shots": 700, "background_per_ns": 0.05},
        {"readout": "all", "cover_glass": 0.2},
        {"readout": "all", "dead_bins": 7, "cover_glass": 0.5, "background_per_ns": 0.05},
        {"readout": "all", "spads": 1, "shots": 700, "dead_bins": 3, "background_per_ns": 0.05},
    ],
)
def test_counts_are_those_of_the_law(numbers):
    detector = chip(features=HISTOGRAM, **numbers)
    rate = slow_histogram.rates(detector, RANGES, SIGNALS, detector.background_per_ns)
    q = slow_histogram.chances(detector, rate)
    assert expected(rate, 0 if detector.readout == "first" else detector.dead_bins) == pytest.approx(q, rel=1e-12)
    agrees(drawn(detector), q, detector.trials)


def test_first_photons_are_multinomial():
    """A photon that comes early cannot come late: bins are anticorrelated, and no trial counts twice."""
    detector = chip(spads=1, shots=50, features=HISTOGRAM, readout="first", background_per_ns=0.0)
    counts = drawn(detector, 4000, [0.3, 1.0], [0.7, 3.0])
    assert counts.sum(axis=1).max() <= 50
    q = slow_histogram.chances(detector, slow_histogram.rates(detector, [0.3, 1.0], [0.7, 3.0], 0.0))
    early, late = counts[:, :50].sum(axis=1), counts[:, 50:].sum(axis=1)
    covariance = -50.0 * q[:50].sum() * q[50:].sum()
    assert np.cov(early, late)[0, 1] == pytest.approx(covariance, abs=4.0 * 12.5 / np.sqrt(4000) * 1.5)


@pytest.mark.parametrize(("readout", "dead"), [("all", 1), ("all", 4), ("all", 12), ("first", 1)])
def test_the_law_is_that_of_single_spads(readout, dead):
    detector = chip(readout=readout, dead_bins=dead, spads=1, shots=200_000, cover_glass=0.6)
    rate = slow_histogram.rates(detector, RANGES, SIGNALS, 0.02)
    trials = detector.trials
    followed = slow_histogram.single_spads(detector, rate, trials, np.random.default_rng(3))
    q = expected(rate, 0 if readout == "first" else dead)
    z = (followed - trials * q) / np.sqrt(np.maximum(trials * q * (1.0 - q), 1.0))
    assert stats.chi2.sf((z**2).sum(), len(q)) > 1e-4


def test_few_and_many_shots_cost_the_same_law():
    """563 200 shots are one draw a bin, of the same law as as many single shots."""
    for shots in (1, 40, 563_200, 100_000_000):
        detector = chip(spads=9, shots=shots, features=HISTOGRAM, cover_glass=0.01)
        rate = slow_histogram.rates(detector, [0.8], [2.0 / shots], detector.background_per_ns)
        counts = drawn(detector, 300, [0.8], [2.0 / shots])
        q = slow_histogram.chances(detector, rate)
        total = detector.trials * q.sum()
        assert abs(counts.sum(axis=1).mean() - total) < 5.0 * np.sqrt(total / 300)


def test_counts_clip_at_the_bits_of_the_histogram():
    detector = chip(features=(Feature("H", "histogram", bits=8),))
    assert drawn(detector, 20).max() == 255.0


def test_bins_of_a_zone_without_an_echo_are_there():
    detector = chip(features=HISTOGRAM, background_per_ns=1e-3)
    found = histogram_echoes(light([[0.0], [0.9]], [[0.0], [0.1]], background=1e-3), detector, threads=1)
    assert found.beam.tolist() == [1]
    assert found.histogram.shape == (2, 128)
    assert found.histogram[0].min() > 50
    assert histogram_echoes(light([[0.9]], [[0.1]]), chip(), threads=1).histogram is None


def test_a_changed_pulse_is_in_the_light_and_not_in_the_search():
    detector = chip(features=HISTOGRAM)
    wide = drawn(detector, 200, [0.9], [0.05], shape=PulseShape(1.2))
    plain = chip(features=HISTOGRAM, pulse_fwhm_ns=1.2)
    agrees(wide, slow_histogram.chances(detector, slow_histogram.rates(plain, [0.9], [0.05], 1e-5)), detector.trials)


def test_a_counted_pulse_is_the_gaussian_that_it_was_counted_from():
    gaussian = PulseForm(2.5, 0.0, 1.0)
    counts = tuple(np.diff(gaussian.before(np.arange(-12.3, 14.0))))
    counted = CountedPulse(counts)
    at = np.linspace(-15.0, 15.0, 301)
    assert counted.before(at) == pytest.approx(gaussian.before(at), abs=0.007)
    whole = np.arange(-10, 11) + counted._edges()[0] % 1.0
    assert counted.before(whole) == pytest.approx(gaussian.before(whole), abs=1e-4)
    assert counted.integral(at) == pytest.approx(gaussian.integral(at), abs=0.02)
    step = np.linspace(-14.0, 14.0, 20_001)
    trapezes = np.cumsum(0.5 * np.diff(step) * (counted.before(step)[1:] + counted.before(step)[:-1]))
    assert counted.integral(step[1:]) == pytest.approx(trapezes, abs=1e-5)
    detector = chip(pulse=counts, bin_ns=0.1)
    assert fwhm_bins(detector) == pytest.approx(2.5 * 2.3548, rel=0.02)
    shape = template(pulse_of(detector))
    assert len(shape) % 2 == 1
    assert shape.sum() == pytest.approx(1.0)
    assert shape == pytest.approx(shape[::-1], abs=0.01)


def test_air_scatters_back_what_the_sum_over_its_cells_says():
    rng = np.random.default_rng(4)
    density = rng.uniform(0.0, 0.05, 30)
    haze = Haze(0.05, density, np.array([0, 2, 3]), np.array([0.62, 1.31, 9.0]), np.array([0.6, 0.3, 1.0]))
    detector = chip(features=HISTOGRAM, background_per_ns=0.0)
    asked = light(np.zeros((2, 1)), 0.0, haze=haze)
    counts = np.mean([histogram_echoes(asked, detector, seed=seed, threads=1).histogram for seed in range(60)], axis=0)
    fine = 200
    middle = (np.arange(30 * fine) + 0.5) * 0.05 / fine
    piece = np.repeat(density, fine) * 0.05 / fine
    for zone, ends in enumerate(([(0.62, 0.6), (1.31, 0.3)], [(9.0, 1.0)])):
        seen = sum(share * (middle < end) for end, share in ends)
        q = slow_histogram.chances(detector, slow_histogram.rates(detector, middle, piece * seen, 0.0))
        z = (counts[zone] - detector.trials * q) / np.sqrt(np.maximum(detector.trials * q, 0.05) / 60)
        assert stats.chi2.sf((z**2).sum(), 128) > 1e-4


def test_threads_chunks_and_other_zones_change_nothing():
    rng = np.random.default_rng(2)
    n = 700
    ranges, signals = rng.uniform(0.1, 1.6, (n, 3)), rng.uniform(0.0, 0.01, (n, 3))
    detector = chip(features=HISTOGRAM, max_echoes=3)
    asked = light(ranges, signals, background=1e-5)
    one, several = (histogram_echoes(asked, detector, seed=3, frame=2, threads=threads) for threads in (1, 3))
    assert one.histogram.tobytes() == several.histogram.tobytes()
    assert one.range_m.tobytes() == several.range_m.tobytes()
    fewer = histogram_echoes(light(ranges[:300], signals[:300], background=1e-5), detector, seed=3, frame=2)
    assert fewer.histogram.tobytes() == one.histogram[:300].tobytes()
    assert histogram_echoes(asked, detector, seed=4, frame=2).histogram.tobytes() != one.histogram.tobytes()
    assert histogram_echoes(asked, detector, seed=3, frame=1).histogram.tobytes() != one.histogram.tobytes()


def test_no_zones():
    found = histogram_echoes(light(np.empty((0, 1)), 1.0), chip(features=HISTOGRAM))
    assert len(found) == 0
    assert found.histogram.shape == (0, 128)
