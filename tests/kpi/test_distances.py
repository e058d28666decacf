import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats
from scipy.spatial.distance import jensenshannon

from lidarcheck.errors import UsageError
from lidarcheck.kpi.distances import energy, js, ks, shared_edges, wasserstein
from lidarcheck.kpi.validation import dvm, mean, spread

DISTANCES = {"wasserstein": wasserstein, "ks": ks, "energy": energy, "js": js}
REFERENCE = {
    "wasserstein": stats.wasserstein_distance,
    "ks": lambda m, s: stats.ks_2samp(m, s, method="asymp").statistic,
    "energy": stats.energy_distance,
}
numbers = st.one_of(st.integers(-50, 50).map(float), st.floats(-1e3, 1e3, allow_subnormal=False))
samples = arrays(np.float64, st.integers(1, 60), elements=numbers)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of scipy's p-value for a handful of samples
@pytest.mark.parametrize("name", REFERENCE)
@given(m=samples, s=samples)
def test_agrees_with_scipy(name, m, s):
    assert DISTANCES[name](m, s) == pytest.approx(REFERENCE[name](m, s), rel=1e-9, abs=1e-6)


@given(m=samples, s=samples)
def test_js_agrees_with_scipy(m, s):
    edges = np.concatenate([[-np.inf], shared_edges(m, s), [np.inf]])
    # numpy closes its last bin; with an open one nothing lies on that edge.
    p, q = (np.histogram(x, edges)[0] / len(x) for x in (m, s))
    assert js(m, s) == pytest.approx(jensenshannon(p, q, base=2) ** 2, abs=1e-9)


@pytest.mark.parametrize("name", DISTANCES)
@given(m=samples, s=samples, seed=st.integers(0, 99))
def test_symmetric_not_negative_and_blind_to_order(name, m, s, seed):
    distance = DISTANCES[name]
    value = distance(m, s)
    assert value >= 0.0
    assert distance(s, m) == pytest.approx(value, abs=1e-12)
    assert distance(np.random.default_rng(seed).permutation(m), s) == value
    assert distance(m, m) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", DISTANCES)
def test_empty_constant_and_single(name):
    distance = DISTANCES[name]
    assert math.isnan(distance([], [1.0, 2.0]))
    assert math.isnan(distance([1.0], []))
    assert math.isnan(distance([], []))
    assert distance([3.0] * 7, [3.0]) == 0.0
    assert distance([3.0], [3.0]) == 0.0
    assert distance([3.0] * 7, [5.0] * 4) == pytest.approx(
        {"wasserstein": 2.0, "ks": 1.0, "energy": 2.0, "js": 1.0}[name]
    )


def test_by_hand():
    # F steps by 1/2 at 0 and 2, G by 1 at 1: |F - G| is 1/2 from 0 to 2.
    assert wasserstein([0, 2], [1]) == 1.0
    assert ks([0, 2], [1]) == 0.5
    assert energy([0, 2], [1]) == 1.0
    # Shares (1/2, 1/2) and (1, 0): H(3/4, 1/4) - (1 + 0)/2 bits.
    assert js([0, 2], [0, 0], edges=[1.0]) == pytest.approx(2 - 0.75 * math.log2(3) - 0.5)


def test_shift_of_a_sample_is_its_wasserstein_distance():
    sample = np.random.default_rng(1).normal(size=5000)
    assert wasserstein(sample + 0.37, sample) == pytest.approx(0.37)
    assert dvm(sample + 0.37, sample) == pytest.approx((0.37, 0.0), abs=1e-12)


def test_closed_form_of_two_gaussians():
    g = np.random.default_rng(2)
    m, s = g.normal(0.0, 2.0, 400_000), g.normal(0.0, 1.0, 300_000)
    # Same centre: the distance is that of the quantiles, (2 - 1) E|Z|.
    assert wasserstein(m, s) == pytest.approx(math.sqrt(2 / math.pi), rel=0.01)
    bias, scatter = dvm(m + 1.0, s)
    assert bias == pytest.approx(1.0, abs=0.01)
    assert scatter == pytest.approx(math.sqrt(2 / math.pi), rel=0.01)


@pytest.mark.parametrize("name", DISTANCES)
def test_refuses_what_is_no_sample(name):
    with pytest.raises(UsageError, match="not finite"):
        DISTANCES[name]([1.0, np.nan], [1.0])
    with pytest.raises(UsageError, match="not finite"):
        DISTANCES[name]([1.0], [np.inf, 0.0])
    with pytest.raises(UsageError, match="shape"):
        DISTANCES[name]([[1.0]], [1.0])


class TestSharedEdges:
    def test_whole_numbers_are_binned_whole(self):
        g = np.random.default_rng(3)
        edges = shared_edges(g.poisson(700, 20_000), g.poisson(720, 30_000))
        widths = np.diff(edges)
        assert np.all(widths == widths[0])
        assert widths[0] == round(widths[0])
        assert np.all(edges % 1.0 == 0.5)

    def test_few_values_get_a_bin_each(self):
        widths = np.repeat([4.0, 5.0, 7.0], 100)
        np.testing.assert_array_equal(shared_edges(widths, widths[:150]), [4.5, 6.0])

    def test_outliers_do_not_widen_the_bins(self):
        sample = np.random.default_rng(4).normal(size=10_000)
        edges = shared_edges(sample, np.append(sample, 1e6))
        assert np.abs(edges).max() < 10.0

    def test_one_value_and_a_stray(self):
        m = np.full(100_000, 5.0)
        s = np.concatenate([m, [1.0, 2.0, 9.0], np.linspace(20, 30, 200) ** 1.5][:2])
        assert js(m, np.concatenate([s, np.linspace(20.0, 30.0, 90)])) < 0.01

    def test_equal_distributions_stay_close_at_every_size(self):
        for seed, n in enumerate((20, 200, 2000, 20_000)):
            g = np.random.default_rng(seed)
            assert js(g.normal(size=n), g.normal(size=n)) < 2.0 * 2.0 * n ** (1 / 3) / n


class TestDvm:
    @given(m=samples, s=samples)
    def test_bias_is_the_difference_of_means(self, m, s):
        bias, scatter = dvm(m, s)
        assert bias == pytest.approx(m.mean() - s.mean(), abs=1e-9)
        assert scatter == pytest.approx(stats.wasserstein_distance(m - bias, s), abs=1e-6)

    def test_empty_and_constant(self):
        assert all(math.isnan(x) for x in dvm([], [1.0]))
        assert all(math.isnan(x) for x in dvm([1.0], []))
        assert dvm([4.0, 4.0], [1.0]) == (3.0, 0.0)


def test_mean_and_spread():
    assert math.isnan(mean([]))
    assert math.isnan(spread([]))
    assert mean([1.0, 2.0]) == 1.5
    assert spread([7.0]) == spread([7.0] * 9) == 0.0
    sample = np.random.default_rng(5).normal(3.0, 0.2, 200_000)
    assert spread(sample) == pytest.approx(0.2, rel=0.01)
    assert spread(np.concatenate([sample, np.full(2000, 1e6)])) == pytest.approx(0.2, rel=0.03)
