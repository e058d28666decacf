"""The compiled sums of explaining against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest

from lidarcheck.inference.observed.kernels import add_up, write_nearest, write_residuals, write_scatter

RNG = np.random.default_rng(12)


def test_sums_over_bins_are_those_of_a_matrix_of_ones() -> None:
    labels = RNG.integers(-1, 9, (3, 500)).astype(np.int32)
    values, columns = RNG.normal(size=(500, 6)), np.array([4, 0])
    total = np.zeros((9, 2))
    add_up(labels, values, columns, total)
    ones = sum((labels[d] == np.arange(9)[:, None]).astype(float) for d in range(3))
    assert total == pytest.approx(ones @ values[:, columns])


def test_residuals_are_cut_and_nothing_where_not_valid() -> None:
    valid, feature = RNG.random(200) < 0.7, RNG.normal(size=(200, 4))
    mean, spread, value = RNG.normal(size=(200, 4)), RNG.uniform(0.1, 2.0, (200, 4)), np.full((200, 9), 7.0)
    write_residuals(valid, feature, mean, spread, 2.0, value)
    expected = np.clip((feature - mean) / spread, -2.0, 2.0)
    assert value[:, :4] == pytest.approx(np.where(valid[:, None], expected, 0.0))
    assert (np.abs(expected) == 2.0).any()
    assert (value[:, 4:] == 7.0).all()


def test_scatter_is_half_the_squared_difference_of_valid_neighbours() -> None:
    valid, value, weight = RNG.random(100) < 0.8, RNG.normal(size=(100, 9)), np.zeros((100, 9))
    value[:, 5] = 0.0
    mine, other = np.arange(0, 100, 2), np.arange(1, 100, 2)
    write_scatter(valid, mine, other, 1, 5, 0.9, 1.3, 1.5, value, weight)
    both = valid[mine] & valid[other]
    expected = (np.minimum(0.5 * (value[mine, 1] - value[other, 1]) ** 2, 1.5) - 0.9) / 1.3
    assert value[mine, 5] == pytest.approx(np.where(both, expected, 0.0))
    assert weight[mine, 5].tolist() == both.tolist()
    assert not value[other, 5].any()
    assert not weight[other].any()


def test_the_nearest_echo_of_each_beam_in_whatever_order_echoes_come() -> None:
    beam, apart = RNG.integers(0, 40, 150), RNG.uniform(0.0, 3.0, 150)
    beam, reach = beam[beam != 7], RNG.uniform(0.0, 2.0, 40)
    apart, nearest = apart[: len(beam)], np.full(40, -1)
    write_nearest(beam, apart, reach, nearest)
    for i in range(40):
        own = np.flatnonzero((beam == i) & (apart <= reach[i]))
        assert nearest[i] == (own[np.argmin(apart[own])] if len(own) else -1)
    assert nearest[7] == -1
