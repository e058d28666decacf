"""Binomial and Poisson numbers of any size, against scipy's distributions."""

import numpy as np
import pytest
from scipy import stats

from lidarcheck.jit import kernel
from lidarcheck.model.many_trials import INVERSES, binomial_number, poisson_numbers
from lidarcheck.model.normal import normal

N = 200_000


@kernel
def _draw(trials, chance, seed, inverse, out):
    for i in range(len(out)):
        out[i] = binomial_number(trials, chance, seed, np.uint64(2), np.uint64(i), np.uint64(7), np.uint64(0), inverse)


@kernel
def _normals(uniform, out):
    for i in range(len(uniform)):
        out[i] = normal(uniform[i])


def p_value(numbers, law):
    """Chi-squared of the numbers in bins of a third of a standard deviation, tails pooled."""
    width = max(1, int(law.std() / 3.0))
    edges = np.arange(int(law.mean() - 4 * law.std()), int(law.mean() + 4 * law.std()) + width, width)
    expected = np.diff(np.concatenate([[0.0], law.cdf(edges), [1.0]])) * len(numbers)
    found = np.histogram(numbers, np.concatenate([[-np.inf], edges + 0.5, [np.inf]]))[0]
    few = expected < 5.0
    found, expected = np.append(found[~few], found[few].sum()), np.append(expected[~few], expected[few].sum() + 1e-9)
    return stats.chi2.sf(((found - expected) ** 2 / expected)[expected > 1e-3].sum(), len(expected) - 2)


@pytest.mark.parametrize(
    ("trials", "chance"),
    [
        (5, 0.3),
        (100, 0.05),
        (100, 0.2),
        (100, 0.97),
        (1000, 0.5),
        (2000, 0.00499),
        (2000, 0.00501),
        (36_864_000, 1.9e-7),
        (36_864_000, 5e-5),
        (10**9, 2e-8),
        (10**9, 0.3),
        (10**9, 0.9999),
        (5 * 10**11, 0.01),
    ],
)
def test_binomial_numbers(trials, chance):
    found = np.empty(N, dtype=np.int64)
    _draw(trials, chance, np.uint64(trials + 11), INVERSES, found)
    law = stats.binom(trials, chance)
    assert p_value(found, law) > 1e-4
    assert abs(found.mean() - law.mean()) < 4.5 * law.std() / np.sqrt(N)
    assert abs(found.var() / law.var() - 1.0) < 5.0 * np.sqrt((2.0 + 1.0 / law.var()) / N)


def test_the_sure_and_the_impossible():
    found = np.empty(3, dtype=np.int64)
    for trials, chance, expected in ((10, 0.0, 0), (10, 1.0, 10), (0, 0.5, 0), (10**9, 1.0, 10**9)):
        _draw(trials, chance, np.uint64(1), INVERSES, found)
        assert found.tolist() == [expected] * 3


@pytest.mark.parametrize("mean", [0.0, 0.4, 9.9, 16.0, 5e3, 2e9])
def test_poisson_numbers(mean):
    found, beams = np.empty(N), np.arange(N, dtype=np.uint64)
    poisson_numbers(np.full(N, mean), np.array([3, 4], dtype=np.uint64), np.uint64(1), beams, INVERSES, found)
    if mean == 0.0:
        assert not found.any()
        return
    assert p_value(found, stats.poisson(mean)) > 1e-4
    assert abs(found.mean() - mean) < 4.5 * np.sqrt(mean / N)


def test_normal_numbers_are_the_inverse_of_the_distribution_function():
    from scipy.special import ndtri

    uniform = np.concatenate(
        [np.linspace(0.0, 1.0, 20_001)[1:-1], 10.0 ** -np.arange(1.0, 16.0), 1.0 - 10.0 ** -np.arange(1.0, 15.0)]
    )
    found = np.empty(len(uniform))
    _normals(uniform, found)
    assert found == pytest.approx(ndtri(uniform), rel=1e-13, abs=1e-15)
    edge = np.empty(1)
    _normals(np.zeros(1), edge)
    assert edge[0] == pytest.approx(ndtri(2.0**-54))
