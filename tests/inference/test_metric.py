"""A factored covariance against the matrix that it stands for."""

import numpy as np
import pytest

from lidarcheck.inference.metric import Metric

RNG = np.random.default_rng(4)
METRIC = Metric(RNG.uniform(0.5, 2.0, 30), RNG.normal(size=(30, 4)))
DENSE = np.diag(METRIC.diagonal) + METRIC.factors @ METRIC.factors.T


def test_it_solves_with_the_covariance() -> None:
    one, several = RNG.normal(size=30), RNG.normal(size=(30, 3))
    assert METRIC.times(one) == pytest.approx(np.linalg.solve(DENSE, one))
    assert METRIC.times(several) == pytest.approx(np.linalg.solve(DENSE, several))
    assert METRIC.inner(one, several[:, 0]) == pytest.approx(one @ np.linalg.solve(DENSE, several[:, 0]))
    assert METRIC.square(one) == METRIC.inner(one, one)
    assert METRIC.spread == pytest.approx(np.sqrt(np.diag(DENSE)))


def test_more_scatter_makes_what_is_along_it_nearer() -> None:
    run = RNG.normal(size=30)
    wider = METRIC.widened(10.0 * run[:, None])
    assert wider.square(run) < 0.01 < 0.1 * METRIC.square(run)
    rows = np.array([3, 7, 8])
    r = RNG.normal(size=3)
    assert METRIC.of_rows(rows).square(r) == pytest.approx(r @ np.linalg.solve(DENSE[np.ix_(rows, rows)], r))


@pytest.mark.parametrize("draws", [3, 200])
def test_shrunk_correlations_keep_the_variances(draws: int) -> None:
    found = RNG.normal(size=(draws, 12)) * np.geomspace(0.1, 100.0, 12)
    found[:, 5] = 0.0
    covariance, least = found.T @ found / draws, np.full(12, 4.0)
    dense = 0.9 * covariance
    np.fill_diagonal(dense, np.maximum(np.diag(covariance), least))
    metric = Metric.shrunk(covariance, least, 0.1)
    assert np.diag(metric.diagonal) + metric.factors @ metric.factors.T == pytest.approx(dense)
    r = RNG.normal(size=12)
    assert metric.square(r) == pytest.approx(r @ np.linalg.solve(dense, r))
