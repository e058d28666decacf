"""The binomial sampler against scipy's quantiles and its own limits."""

import math

import numpy as np
import pytest
from scipy import stats

from lidarcheck.model.exact import binomial as sampler


def binomial(uniform: float, trials: int, rate: float) -> int:
    return sampler.binomial(uniform, trials, rate, sampler.inverses(trials))


UNIFORMS = np.concatenate([np.linspace(0.0, 1.0, 401)[:-1], 10.0 ** -np.arange(2, 13), 1 - 10.0 ** -np.arange(2, 10)])


@pytest.mark.parametrize("trials", [1, 2, 9, 135, 315, 800])
@pytest.mark.parametrize("rate", [1e-9, 3e-4, 0.02, 0.3, math.log(2), 1.0, 4.0, 30.0])
def test_it_is_the_quantile_function(trials: int, rate: float) -> None:
    chance = -math.expm1(-rate)
    ours = np.array([binomial(u, trials, rate) for u in UNIFORMS])
    cdf = stats.binom.cdf(np.arange(-1, trials + 1), trials, chance)
    if rate < math.log(2):
        assert np.all(cdf[ours] <= UNIFORMS + 1e-10)
        assert np.all(cdf[ours + 1] + 1e-10 >= UNIFORMS)
    else:  # the misses are drawn, so the same uniform number means the mirrored quantile
        assert np.all(cdf[ours] <= 1 - UNIFORMS + 1e-10)
        assert np.all(cdf[ours + 1] + 1e-10 >= 1 - UNIFORMS)


@pytest.mark.parametrize(("trials", "rate"), [(100_000, 0.05), (100_000, 0.5), (50_000, 2.0), (5000, 0.69)])
def test_many_trials_start_at_the_mode(trials: int, rate: float) -> None:
    chance = -math.expm1(-rate)
    sample = np.array([binomial(u, trials, rate) for u in np.random.default_rng(1).random(4000)])
    z = (sample.mean() - trials * chance) / math.sqrt(trials * chance * (1 - chance) / len(sample))
    assert abs(z) < 4
    assert 0.9 < sample.var() / (trials * chance * (1 - chance)) < 1.1
    assert stats.kstest(sample + 0.5, lambda x: stats.binom.cdf(np.floor(x), trials, chance)).pvalue > 1e-4


def test_limits() -> None:
    largest = np.nextafter(1.0, 0.0)
    assert binomial(0.5, 0, 1.0) == 0
    assert binomial(largest, 315, 0.0) == 0
    assert binomial(0.3, 315, 1e6) == 315
    assert binomial(largest, 315, 3e-4) < 20, "rounding must not make every detector fire"
    assert binomial(largest, 315, 5.0) > 280
