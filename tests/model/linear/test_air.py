"""Fog before a linear detector: one soft echo at the maximum of what the pulse makes of the profile."""

import numpy as np
import pytest

from any_detector_kit import light, same, sensor
from lidarcheck.model.linear.air import air_echoes
from lidarcheck.model.linear.echoes import linear_echoes
from lidarcheck.scan import Haze

STEP_M, SIGMA_M = 0.05, 0.3182
EXACT = {"range_floor_m": 0.0, "edge_factor": 0.0, "noise": 0.0, "range_resolution_m": 0.0, "max_echoes": 3}


def profile(peak_m=4.0, cells=400):
    middle = (np.arange(cells) + 0.5) * STEP_M
    return 9.0 * np.exp(-0.5 * ((middle - peak_m) / 1.5) ** 2)


def brute_force(density, end_m):
    """Height and place of the maximum of the profile up to `end_m`, convolved on a fine grid."""
    fine = 20
    at = (np.arange(len(density) * fine) + 0.5) * STEP_M / fine
    light_ = np.repeat(density, fine) * (at < end_m) * STEP_M / fine
    places = np.arange(0.0, 12.0, 0.004)
    amplitude = (np.exp(-0.5 * ((places[:, None] - at) / SIGMA_M) ** 2) * light_).sum(axis=1)
    return amplitude.max(), places[amplitude.argmax()]


def test_the_airs_echo_is_the_maximum_of_the_convolved_profile_wherever_it_ends():
    haze = Haze(STEP_M, profile(), np.array([0]), np.empty(0), np.empty(0))
    signal, range_m = air_echoes(haze, SIGMA_M)
    for end in (400, 120, 80, 60, 40, 10, 1):
        height, place = brute_force(profile(), end * STEP_M)
        assert signal[end] == pytest.approx(height, rel=2e-3)
        assert range_m[end] == pytest.approx(place, abs=0.01)
    assert signal[0] == 0.0


def test_air_is_a_surface_of_its_own_and_ends_where_the_beam_does():
    haze = Haze(STEP_M, profile(), np.array([0, 1, 2, 3]), np.array([20.0, 2.02, 20.0]), np.array([1.0, 1.0, 0.1]))
    asked = light([[50.0], [2.02], [50.0]], [[40.0], [90.0], [40.0]], haze=haze)
    found = linear_echoes(asked, sensor(threshold=5.0, **EXACT), threads=1)
    whole, at = brute_force(profile(), 20.0)
    cut, near = brute_force(profile(), 2.02)
    assert found.beam.tolist() == [0, 0, 1, 2]
    merged = (near * cut + 2.02 * 90.0) / (cut + 90.0)
    assert found.amplitude == pytest.approx([whole, 40.0, cut + 90.0, 40.0], rel=5e-3)
    assert found.range_m == pytest.approx([at, 50.0, merged, 50.0], abs=0.02)


def test_near_air_takes_the_place_of_far_surfaces_where_the_first_is_kept():
    n = 2000
    haze = Haze(STEP_M, profile(), np.arange(n + 1), np.full(n, 20.0), np.full(n, 3.0))
    first = linear_echoes(same(n, 50.0, 40.0, haze=haze), sensor(keep="first"), threads=1)
    assert np.all(np.abs(first.range_m - 4.0) < 2.0)
    last = linear_echoes(same(n, 50.0, 40.0, haze=haze), sensor(keep="last"), threads=1)
    assert np.all(np.abs(last.range_m - 50.0) < 2.0)


def test_air_without_light_changes_no_draw():
    n = 500
    haze = Haze(STEP_M, np.zeros(10), np.arange(n + 1), np.full(n, 20.0), np.ones(n))
    one, two = (linear_echoes(same(n, 50.0, 8.0, haze=h), sensor(), threads=1) for h in (None, haze))
    assert np.array_equal(one.range_m, two.range_m)
