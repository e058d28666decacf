import math

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.kpi.scatter import central_half_width, range_scatter


def scans(n=60_000, *, scale=0.2, floor=0.0, step=0.0, seed=0, signal=(5.0, 5000.0)):
    g = np.random.default_rng(seed)
    s = np.exp(g.uniform(*np.log(signal), n))
    sigma = np.sqrt(scale**2 / s + floor**2)
    truth = g.uniform(5.0, 50.0, n)
    a, b = (truth + g.normal(size=n) * sigma for _ in range(2))
    if step:
        a, b = np.round(a / step) * step, np.round(b / step) * step
    return a, b, s


def test_recovers_photon_statistics():
    r = range_scatter(*scans())
    np.testing.assert_allclose(r.sigma_m * np.sqrt(r.signal), 0.2, rtol=0.06)
    assert r.scale_m == pytest.approx(0.2, rel=0.01)
    assert r.slope == pytest.approx(-0.5, abs=0.01)
    assert r.floor_m < 0.0015


def test_recovers_a_floor():
    r = range_scatter(*scans(floor=0.01))
    assert r.floor_m == pytest.approx(0.01, rel=0.05)
    assert r.slope > -0.45


@pytest.mark.parametrize("step", [0.001, 0.01])
def test_the_resolution_does_not_show(step):
    # At a step of 1 cm the strongest signals scatter by 4 mm: well below the step.
    r = range_scatter(*scans(step=step, signal=(5.0, 2500.0)), resolution_m=step)
    np.testing.assert_allclose(r.sigma_m * np.sqrt(r.signal), 0.2, rtol=0.08)


def test_outliers_do_not_count():
    a, b, s = scans()
    b[::20] += 0.5
    assert range_scatter(a, b, s).scale_m == pytest.approx(0.2, rel=0.12)


def test_little_data():
    r = range_scatter([], [], [])
    assert r.signal.size == 0
    assert math.isnan(r.scale_m)
    r = range_scatter(*scans(49, signal=(4.0, 5.0)))
    assert r.signal.size == 0
    r = range_scatter(*scans(500, signal=(4.0, 7.9)))
    assert r.scale_m == pytest.approx(0.2, rel=0.15)
    assert math.isnan(r.slope)
    still = np.full(100, 7.0)
    r = range_scatter(still, still, still)
    np.testing.assert_array_equal(r.sigma_m, [0.0])
    assert math.isnan(r.scale_m)
    assert range_scatter(still, still, np.zeros(100)).signal.size == 0
    with pytest.raises(UsageError, match="number"):
        range_scatter([1.0], [1.0, 2.0], [1.0])


def test_half_width_by_hand():
    # Values on a grid of 2: 0 fills 0 ... 1, 2 fills 1 ... 3.
    assert central_half_width([0, 0, 2, 2], share=0.5, step=2.0) == pytest.approx(1.0)
    assert central_half_width([0, 0, 2, 2], share=0.75, step=2.0) == pytest.approx(2.0)
    assert central_half_width([0, 0, 2, 2], share=0.25, step=2.0) == pytest.approx(0.5)
    assert central_half_width([1.0, 2.0, 3.0], share=0.5) == 2.0
