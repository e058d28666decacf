"""The histogram SPAD's dead time: closed forms, the sensor model's own chain, and its inverse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarcheck.errors import UsageError
from lidarcheck.kpi.deadtime import coates_rate, expected_counts, late_background
from lidarcheck.model.trace import on_probability
from lidarcheck.sensor import Sensor

RATES = np.concatenate([np.full(30, 0.004), [0.3, 0.9, 0.2], np.full(60, 0.004)])


def test_first_photon_only_is_geometric():
    counts = expected_counts(np.full(50, 0.1), 1000.0)
    share = 1 - np.exp(-0.1)
    np.testing.assert_allclose(counts, 1000.0 * share * (1 - share) ** np.arange(50))


def test_without_dead_time_every_bin_stands_alone():
    np.testing.assert_allclose(expected_counts(RATES, 7.0, dead_bins=1), 7.0 * -np.expm1(-RATES))


def test_two_bins_of_dead_time_by_hand():
    p, q, r = -np.expm1(-np.array([0.5, 0.2, 0.7]))
    np.testing.assert_allclose(
        expected_counts([0.5, 0.2, 0.7], 1.0, dead_bins=2), [p, (1 - p) * q, (1 - (1 - p) * q) * r]
    )


def test_settles_where_the_steady_state_starts():
    share = -np.expm1(-0.05)
    steady = share / (1 + 11 * share)
    np.testing.assert_allclose(expected_counts(np.full(80, 0.05), 1.0, dead_bins=12, background=0.05), steady)
    np.testing.assert_allclose(expected_counts(np.full(3000, 0.05), 1.0, dead_bins=12)[-1], steady, rtol=1e-9)


@pytest.mark.parametrize("dead_bins", [1, 4, 12, 64])
@pytest.mark.parametrize("background", [0.0, 0.0003, 0.05])
def test_is_the_mean_of_the_sensor_models_chain(dead_bins, background):
    sensor = Sensor.of("SMART", on_bins=1, dead_bins=dead_bins)
    rates = background + np.concatenate([np.zeros(20), np.random.default_rng(1).uniform(0, 3, 30), np.zeros(90)])
    chain = on_probability(rates[None], np.array([background]), sensor)[0]
    counts = expected_counts(rates, 1e6, dead_bins=dead_bins, background=background)
    np.testing.assert_allclose(counts, 1e6 * chain, rtol=1e-9, atol=1e-6)


@given(
    rates=st.lists(st.floats(0.0, 3.0), min_size=1, max_size=40),
    dead_bins=st.one_of(st.none(), st.integers(1, 50)),
)
def test_coates_is_the_inverse(rates, dead_bins):
    counts = expected_counts(rates, 1e5, dead_bins=dead_bins)
    back = coates_rate(counts, 1e5, dead_bins=dead_bins)
    # Where hardly a cycle is left armed the counts say little about the rate.
    told = np.cumsum(np.concatenate([[0.0], rates[:-1]])) < 12.0
    np.testing.assert_allclose(back[told], np.array(rates)[told], rtol=1e-6, atol=1e-9)


def test_coates_formula_by_hand():
    np.testing.assert_allclose(coates_rate([10, 45, 0, 45], 100), [-np.log(0.9), -np.log(0.5), 0.0, np.inf])
    np.testing.assert_allclose(coates_rate([100, 0], 100), [np.inf, 0.0])


def test_against_drawn_cycles():
    g = np.random.default_rng(2)
    cycles = 40_000
    fires = g.random((cycles, RATES.size)) < -np.expm1(-RATES)
    for dead_bins in (None, 20):
        counts, ready = np.zeros(RATES.size), np.zeros(cycles, dtype=int)
        for k in range(RATES.size):
            now = fires[:, k] & (ready <= k)
            counts[k] = now.sum()
            ready[now] = k + (dead_bins or RATES.size)
        expected = expected_counts(RATES, cycles, dead_bins=dead_bins)
        z = (counts - expected) / np.sqrt(expected)
        assert abs(z).max() < 4.0
        assert np.mean(z**2) < 1.5


def test_late_background():
    windows = {"early": slice(0, 25), "late": slice(60, 93)}
    for dead_bins in (None, 5):
        counts = expected_counts(RATES, 1e6, dead_bins=dead_bins)
        b = late_background(counts, 1e6, **windows, dead_bins=dead_bins)
        assert b.expected == pytest.approx(b.observed, rel=1e-3)
        early = counts[:25].sum()
        assert b.sigma == pytest.approx(np.sqrt(b.expected + b.expected**2 / early))
    first_photon = expected_counts(RATES, 1e6)
    naive = late_background(first_photon, 1e6, **windows, dead_bins=1)
    assert naive.expected > 2.0 * naive.observed


def test_late_background_is_scattered_as_it_says():
    g = np.random.default_rng(3)
    share = expected_counts(RATES, 1.0)
    counts = g.multinomial(1_000_000, np.append(share, 1.0 - share.sum()), size=800)[:, :-1]
    b = late_background(counts, 1e6, early=slice(0, 25), late=slice(60, 93))
    z = (b.observed - b.expected) / b.sigma
    assert abs(z.mean()) < 4 / np.sqrt(800)
    assert np.mean(z**2) == pytest.approx(1.0, abs=0.2)


def test_nothing_early():
    b = late_background(np.zeros(10), 100.0, early=slice(0, 3), late=slice(5, 9))
    assert (b.expected, b.sigma, b.observed) == (0.0, 0.0, 0.0)


def test_refuses():
    with pytest.raises(UsageError, match="dead_bins = 0"):
        expected_counts([0.1], 1.0, dead_bins=0)
    with pytest.raises(UsageError, match="negative"):
        expected_counts([-0.1], 1.0)
    with pytest.raises(UsageError, match="steady state"):
        expected_counts([0.1], 1.0, background=0.1)
    with pytest.raises(UsageError, match="more counts"):
        coates_rate([60.0, 60.0], 100.0)
