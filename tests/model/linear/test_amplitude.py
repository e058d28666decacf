"""The amplitude of a linear detector: who is detected, what is recorded, and the echoes that noise alone makes."""

import numpy as np
import pytest
from scipy import stats

from any_detector_kit import LIGHT_SPEED, same, sensor, z_of_share
from lidarcheck.model.linear.echoes import linear_echoes
from lidarcheck.sensor.feature import Feature

N = 60_000


@pytest.mark.parametrize(
    ("signal", "numbers", "ambient"),
    [
        (5.0, {}, 0.0),
        (7.0, {}, 0.0),
        (6.0, {"excess": 0.5}, 0.0),
        (6.0, {"relative": 0.3}, 0.0),
        (30.0, {"noise": 4.0, "threshold": 24.0, "excess": 1.0}, 0.0),
        (6.0, {}, 3.0),
    ],
)
def test_detection_and_recorded_amplitudes_are_a_normal_law_cut_at_the_threshold(signal, numbers, ambient):
    detector = sensor(
        threshold=numbers.get("threshold", 5.5),
        false_rate_hz=0.0,
        **{k: v for k, v in numbers.items() if k != "threshold"},
    )
    sigma = np.sqrt(detector.noise**2 + ambient + detector.excess * signal + (detector.relative * signal) ** 2)
    found = linear_echoes(same(N, 50.0, signal, background=ambient), detector, threads=1)
    share = stats.norm.cdf((signal - detector.threshold) / sigma)
    assert abs(z_of_share(len(found), N, share)) < 4.0
    z = (detector.threshold - signal) / sigma
    mean = signal + sigma * stats.norm.pdf(z) / stats.norm.sf(z)
    assert abs(found.amplitude.mean() - mean) < 4.0 * found.amplitude.std() / np.sqrt(len(found))
    law = stats.truncnorm(z, np.inf, signal, sigma)
    assert stats.kstest(found.amplitude, law.cdf).pvalue > 1e-4
    assert found.amplitude.min() > detector.threshold


def test_without_noise_detection_is_a_step():
    detector = sensor(noise=0.0, threshold=5.0)
    assert len(linear_echoes(same(500, 50.0, 5.0), detector, threads=1)) == 0
    found = linear_echoes(same(500, 50.0, 5.0001), detector, threads=1)
    assert len(found) == 500
    assert np.all(found.amplitude == 5.0001)


def expected_false(detector, variance, rate=None):
    gate_ns = 2.0 * (detector.max_range_m - detector.min_range_m) / LIGHT_SPEED
    if rate is None:
        rate = 0.44 / detector.pulse_fwhm_ns / np.sqrt(3.0) * np.exp(-(detector.threshold**2) / (2.0 * variance))
    return 1.0 - np.exp(-rate * gate_ns)


@pytest.mark.parametrize(("numbers", "ambient"), [({"threshold": 3.5}, 0.0), ({"threshold": 4.5, "noise": 1.2}, 0.4)])
def test_false_echoes_follow_rice(numbers, ambient):
    detector = sensor(min_range_m=20.0, **numbers)
    variance = detector.noise**2 + ambient
    found = linear_echoes(same(N, 0.0, 0.0, background=ambient), detector, threads=1)
    assert abs(z_of_share(len(found), N, expected_false(detector, variance))) < 4.0
    assert len(np.unique(found.beam)) == len(found)
    assert stats.kstest(found.range_m, stats.uniform(20.0, 280.0).cdf).pvalue > 1e-4
    energy = (found.amplitude**2 - detector.threshold**2) / (2.0 * variance)
    assert stats.kstest(energy, stats.expon.cdf).pvalue > 1e-4


def test_a_false_rate_of_its_own_counts_in_the_dark_and_grows_with_light_as_rice_does():
    detector = sensor(threshold=4.0, false_rate_hz=60_000.0)
    dark = linear_echoes(same(N, 0.0, 0.0), detector, threads=1)
    assert abs(z_of_share(len(dark), N, expected_false(detector, 1.0, 6e-5))) < 4.0
    lit = linear_echoes(same(N, 0.0, 0.0, background=0.3), detector, threads=1)
    rate = 6e-5 * np.exp(-8.0 / 1.3 + 8.0)
    assert abs(z_of_share(len(lit), N, expected_false(detector, 1.3, rate))) < 4.0


def test_noiseless_and_deaf_detectors_have_no_false_echoes():
    for numbers in ({"noise": 0.0, "false_rate_hz": 1e8}, {"false_rate_hz": 0.0}, {"noise": 0.0}):
        assert (
            len(linear_echoes(same(20_000, 0.0, 0.0, background=4.0), sensor(threshold=3.0, **numbers), threads=1)) == 0
        )


def test_a_false_echo_beside_a_real_one_is_gone_and_elsewhere_competes():
    detector = sensor(
        threshold=3.0, max_echoes=2, keep="first", range_floor_m=0.0, edge_factor=0.0, range_resolution_m=0.0
    )
    found = linear_echoes(same(N, 150.0, 1000.0), detector, threads=1)
    false = found.amplitude < 500.0
    share = expected_false(detector, 1.0) * (1.0 - 2.0 * detector.separation_m / 300.0)
    assert abs(z_of_share(np.sum(false), N, share)) < 4.0
    assert np.abs(found.range_m[false] - 150.0).min() >= detector.separation_m
    strongest = linear_echoes(same(N, 150.0, 1000.0), sensor(threshold=3.0), threads=1)
    assert np.all(strongest.amplitude > 500.0)
    nearest = linear_echoes(same(N, 150.0, 1000.0), sensor(threshold=3.0, keep="first"), threads=1)
    assert 0 < np.sum(nearest.amplitude < 500.0) < np.sum(false)


def test_saturation_clips_the_amplitude_and_lengthens_the_pulse():
    width = Feature("WIDTH", "width_above_threshold", unit="ns")
    detector = sensor(noise=0.0, threshold=10.0, saturation=100.0, recovery_ns=3.0, features=(width,))
    found = linear_echoes(same(1, 50.0, 10_000.0), detector, threads=1)
    assert found.amplitude.tolist() == [100.0]
    plain = 2.0 * 5.0 / 2.3548 * np.sqrt(2.0 * np.log(10.0))
    assert found.features["WIDTH"] == pytest.approx([plain + 6.0], rel=1e-12)
    false = linear_echoes(same(5000, 0.0, 0.0), sensor(threshold=3.0, saturation=3.2), threads=1)
    assert np.mean(false.amplitude == 3.2) == pytest.approx(np.exp(-(3.2**2 - 3.0**2) / 2.0), abs=0.08)
    assert false.amplitude.max() == 3.2


def test_the_background_feature_is_poisson_and_the_same_for_a_shots_echoes():
    ambient = Feature("AMBIENT", "background", step=1.0, bits=16)
    detector = sensor(noise=4.0, threshold=24.0, max_echoes=2, features=(ambient,))
    found = linear_echoes(same(N // 2, [50.0, 90.0], [1e4, 1e4], background=5.0), detector, threads=1)
    counts = found.features["AMBIENT"]
    assert np.array_equal(counts[::2], counts[1::2])
    counts = counts[::2]
    assert abs(counts.mean() - 21.0) < 4.0 * np.sqrt(21.0 / len(counts))
    assert abs(counts.var() / 21.0 - 1.0) < 5.0 * np.sqrt(2.0 / len(counts))
