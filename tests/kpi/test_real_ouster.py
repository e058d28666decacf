"""Two scans of a static scene by a real sensor: the range scatter over the signal, and the comparison of the two."""

import json

import numpy as np
import pytest

from lidarcheck.formats import load_scan
from lidarcheck.kpi.compare import compare
from lidarcheck.kpi.pairing import pair_echoes
from lidarcheck.kpi.scatter import range_scatter
from places import shared_path

RESOLUTION_M = 0.001
SAME_SURFACE_M = 0.5


@pytest.fixture(scope="module")
def scans():
    return tuple(load_scan(shared_path(f"data/ouster_os0_128/scan_{i}.parquet")) for i in (0, 1))


def test_range_scatter_is_that_of_photons(scans):
    first, second = scans
    pairs = pair_echoes(first, second, tolerance_m=SAME_SURFACE_M)
    assert pairs.measured.size > 32_000
    a, b = first.extra["RANGE"][pairs.measured], second.extra["RANGE"][pairs.simulated]
    signal = 0.5 * (first.extra["SIGNAL"][pairs.measured] + second.extra["SIGNAL"][pairs.simulated])
    scatter = range_scatter(a, b, signal, resolution_m=RESOLUTION_M)
    assert scatter.scale_m == pytest.approx(0.175, rel=0.1)
    assert scatter.slope == pytest.approx(-0.57, abs=0.02)
    assert scatter.floor_m < 0.0005
    assert scatter.sigma_m[0] == pytest.approx(0.043, rel=0.1)
    assert scatter.sigma_m[-1] == pytest.approx(0.0021, rel=0.15)


def test_compare_without_peak_and_area(scans):
    found = compare(*scans)
    assert set(found.features) == {"SIGNAL", "REFLECTIVITY"}
    assert {"PEAK", "AREA", "WIDTH", "range_residual"} <= set(found.left_out)
    assert found.features["SIGNAL"].ks < 0.01
    assert found.paired.median_m == pytest.approx(0.0, abs=1e-4)
    assert found.overlap.measured_share > 0.98
    json.dumps(found.to_dict(), allow_nan=False)


def test_compare_two_rotations_of_a_dual_return_sensor():
    rotations = [load_scan(shared_path(f"data/hesai_xt32/rotation_{i}.parquet")) for i in (0, 1)]
    found = compare(*rotations)
    assert set(found.features) == {"INTENSITY"}
    assert found.features["INTENSITY"].ks < 0.01
    assert found.paired.pairs > 60_000
    assert found.paired.spread_m < 0.011
    assert np.isfinite([row.value for row in found.rows() if row.kpi == "wasserstein"]).all()
