"""Shapes of samples, against what is known of them in closed form."""

import math
import time

import numpy as np
import pytest

from lidarcheck.kpi import shapes

RNG = np.random.default_rng(11)
NORMAL = RNG.normal(2.0, 3.0, 20_000)


def integral(one):
    return np.trapezoid(one.density, one.x)


def test_a_density_integrates_to_one_and_is_the_normal_one():
    (one,) = shapes.densities([NORMAL])
    assert integral(one) == pytest.approx(1.0, abs=1e-6)
    true = np.exp(-0.5 * ((one.x - 2.0) / 3.0) ** 2) / (3.0 * math.sqrt(2.0 * math.pi))
    assert np.abs(one.density - true).max() < 0.05 * true.max()


def test_a_density_is_that_of_scipy():
    from scipy.stats import gaussian_kde

    sample = NORMAL[:300]
    spread = min(sample.std(ddof=1), np.subtract(*np.quantile(sample, (0.75, 0.25))) / 1.349)
    width = 0.9 * spread * 300**-0.2
    (one,) = shapes.densities([sample], points=2048)
    other = gaussian_kde(sample, bw_method=width / sample.std(ddof=1))(one.x)
    assert np.abs(one.density - other).max() < 2e-3 * other.max()


@pytest.mark.parametrize("sample", [[5.0], [5.0] * 9, [1e-9] * 3, [-1e15, -1e15], [0.0], [1.0, 2.0], [1e100, -1e100]])
def test_a_density_of_next_to_nothing_still_integrates_to_one(sample):
    (one,) = shapes.densities([sample])
    assert np.isfinite(one.density).all()
    assert integral(one) == pytest.approx(1.0, rel=1e-3)
    assert one.density[0] < 1e-3 * one.density.max()


def test_quantised_data_draw_no_comb():
    for sample in (RNG.poisson(9.0, 200_000), np.round(RNG.normal(0.0, 0.03, 200_000), 2)):
        (one,) = shapes.densities([sample])
        peaks = np.flatnonzero((one.density[1:-1] > one.density[:-2]) & (one.density[1:-1] >= one.density[2:]))
        assert (one.density[1:-1][peaks] > 0.1 * one.density.max()).sum() == 1


def test_densities_share_a_grid_and_nothing_has_none():
    one, none, other = shapes.densities([[1.0, 2.0], [np.nan], [50.0, 60.0]])
    assert np.array_equal(one.x, other.x)
    assert none.x.size == none.density.size == 0
    assert integral(one) == pytest.approx(1.0, rel=1e-3)
    assert integral(other) == pytest.approx(1.0, rel=1e-3)


def test_a_shift_is_a_parallel_and_a_stretch_a_slope():
    levels, x, y = shapes.quantile_pairs(NORMAL, NORMAL + 0.25)
    assert np.allclose(y - x, 0.25)
    assert np.all(np.diff(levels) > 0)
    _, x, y = shapes.quantile_pairs(NORMAL, RNG.permutation(2.0 * NORMAL))
    assert np.allclose(y, 2.0 * x)
    _, x, y = shapes.quantile_pairs([3.0, 1.0, 2.0], [1.0, 1.0, 5.0])
    assert x.tolist() == [1.0, 2.0, 3.0]
    assert y.tolist() == [1.0, 1.0, 5.0]


def test_quantiles_of_nothing_and_of_one_value():
    for pair in (([], [1.0]), ([1.0], []), ([np.nan], [np.nan])):
        assert [values.size for values in shapes.quantile_pairs(*pair)] == [0, 0, 0]
    assert [values.tolist() for values in shapes.quantile_pairs([4.0], [1.0, 3.0])] == [[0.5], [4.0], [2.0]]


def test_a_distribution_function_is_exact_where_it_is_given():
    for sample in (NORMAL, RNG.poisson(3.0, 5000), np.array([7.0]), np.full(20, 3.0)):
        x, share = shapes.distribution_steps(sample, 100)
        assert np.array_equal(share, [(sample <= value).mean() for value in x])
        assert share[-1] == 1.0
        assert len(x) <= 100
    x, share = shapes.distribution_steps(NORMAL, 100)
    assert np.diff(share).max() <= 0.0102
    assert [values.size for values in shapes.distribution_steps([np.nan, np.inf])] == [0, 0]


def test_bins_hold_everything_and_whole_numbers_get_whole_bins():
    edges = shapes.bin_edges([NORMAL, NORMAL + 9.0], 50)
    assert len(edges) == 51
    assert shapes.counts(NORMAL, edges).sum() == NORMAL.size
    whole = shapes.bin_edges([[0, 1, 2, 9], [4]], 40)
    assert whole.tolist() == [-0.5 + i for i in range(11)]
    wide = shapes.bin_edges([np.arange(1000)], 40)
    assert np.diff(wide).tolist() == [25.0] * 40
    assert set(shapes.counts(np.arange(1000), wide)) == {25.0}


@pytest.mark.parametrize("samples", [[], [[]], [[np.nan]], [[3.0]], [[0.25] * 4], [[1e300, -1e300]]])
def test_bins_of_next_to_nothing(samples):
    edges = shapes.bin_edges(samples)
    assert np.all(np.diff(edges) > 0)
    assert sum(shapes.counts(sample, edges).sum() for sample in samples) == sum(len(shapes.finite(s)) for s in samples)


def test_bins_on_a_log_axis_are_even_and_whole_numbers_never_get_narrower_ones():
    values = RNG.lognormal(3.0, 1.0, 1000)
    edges = shapes.log_edges([values], 30)
    assert np.allclose(np.diff(np.log(edges)), np.log(values.max() / values.min()) / 30)
    assert shapes.counts(values, edges).sum() == 1000
    assert len(shapes.log_edges([[0.1, 1000.5]], 40)) == len(shapes.log_edges([[0.1, 1000.0]], 40)) == 41
    whole = np.arange(1.0, 501.0)
    edges = shapes.log_edges([whole], 40)
    assert np.all(edges % 1.0 == 0.5)
    assert np.all(np.diff(np.diff(edges)) >= 0.0)
    assert np.diff(edges)[:5].tolist() == [1.0] * 5
    held = shapes.counts(whole, edges)
    assert held.sum() == 500
    assert np.all(held > 0)
    assert 15 <= len(held) <= 60
    for samples in ([], [[0.0, -1.0]], [[np.nan]], [[7.0]], [[0.25]]):
        assert np.all(np.diff(shapes.log_edges(samples)) > 0)


def test_whole_numbers_spread_out_fill_their_units_evenly():
    spread = shapes.spread_out([3, 1, 1, 3, 1, 3, 3])
    assert np.allclose(spread, [1 - 1 / 3, 1, 1 + 1 / 3, 2.625, 2.875, 3.125, 3.375])
    assert shapes.spread_out([0.5, 0.25]).tolist() == [0.25, 0.5]
    assert shapes.spread_out([np.nan]).size == 0
    (one,) = shapes.densities([np.log10(shapes.spread_out(RNG.poisson(20.0, 100_000) + 1.0))])
    peaks = (one.density[1:-1] > one.density[:-2]) & (one.density[1:-1] >= one.density[2:])
    assert (one.density[1:-1][peaks] > 0.1 * one.density.max()).sum() == 1


def test_quartiles():
    assert shapes.quartiles(np.arange(101.0)) == (25.0, 50.0, 75.0)
    assert all(map(math.isnan, shapes.quartiles([np.nan])))


def test_half_a_million_values_take_no_time():
    samples = [RNG.normal(0.0, 1.0, 500_000), RNG.normal(0.0, 1.0, 500_000)]
    start = time.process_time()
    shapes.densities(samples)
    shapes.quantile_pairs(*samples)
    shapes.distribution_steps(samples[0])
    shapes.counts(samples[0], shapes.bin_edges(samples))
    assert time.process_time() - start < 2.0
