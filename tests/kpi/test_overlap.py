import math

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.kpi.overlap import overlap


def test_by_hand():
    m = [[0.0, 0, 0], [1, 0, 0], [5, 0, 0]]
    s = [[0.0, 0.05, 0], [1.3, 0, 0]]
    o = overlap(m, s, radius_m=0.1)
    assert o.measured_share == 1 / 3
    assert o.simulated_share == 1 / 2
    assert o.chamfer_m == pytest.approx(0.5 * ((0.05 + 0.3 + 3.7) / 3 + (0.05 + 0.3) / 2))


def test_the_radius_belongs_to_the_cover():
    assert overlap([[0.0, 0, 0]], [[0.25, 0, 0]], radius_m=0.25).measured_share == 1.0


def test_agrees_with_all_pairs():
    g = np.random.default_rng(0)
    m, s = g.normal(size=(150, 3)), g.normal(size=(120, 3))
    gaps = np.linalg.norm(m[:, None] - s[None], axis=2)
    o = overlap(m, s, radius_m=0.4)
    assert o.measured_share == np.mean(gaps.min(axis=1) <= 0.4)
    assert o.simulated_share == np.mean(gaps.min(axis=0) <= 0.4)
    assert o.chamfer_m == pytest.approx(0.5 * (gaps.min(axis=1).mean() + gaps.min(axis=0).mean()))


def test_same_cloud_and_one_point_many_times():
    cloud = np.random.default_rng(1).normal(size=(1000, 3))
    assert overlap(cloud, cloud)[:3] == (1.0, 1.0, 0.0)
    assert overlap(np.ones((20_000, 3)), np.ones((20_000, 3)))[:3] == (1.0, 1.0, 0.0)


def test_empty():
    one = [[1.0, 2.0, 3.0]]
    measured, simulated, chamfer, _ = overlap([], one)
    assert math.isnan(measured)
    assert simulated == 0.0
    assert math.isnan(chamfer)
    assert overlap(one, []).measured_share == 0.0
    assert all(math.isnan(x) for x in overlap([], [])[:3])
    with pytest.raises(UsageError, match="shape"):
        overlap([1.0, 2.0, 3.0], one)
    with pytest.raises(UsageError, match="not finite"):
        overlap([[math.nan, 2.0, 3.0]], one)


def test_a_part_of_the_points_looks_at_all_of_the_other():
    g = np.random.default_rng(1)
    m, s = g.normal(size=(500, 3)), g.normal(size=(400, 3))
    part = overlap(m, s, radius_m=0.4, every=7)
    assert part.measured_share == overlap(m[::7], s, radius_m=0.4).measured_share
    assert part.simulated_share == overlap(m, s[::7], radius_m=0.4).simulated_share
