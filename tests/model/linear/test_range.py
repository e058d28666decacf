"""The range of a linear detector: its noise by three laws, walk, constant errors, the step and the gate."""

import numpy as np
import pytest
from scipy import stats

from any_detector_kit import LIGHT_SPEED, light, same, sensor
from lidarcheck.model.linear.echoes import linear_echoes
from lidarcheck.scan import PulseShape

N = 40_000
EXACT = {"range_floor_m": 0.0, "edge_factor": 0.0, "noise": 0.0, "threshold": 5.0}


@pytest.mark.parametrize(
    ("numbers", "shape", "expected"),
    [
        ({}, None, lambda s: np.hypot(0.01, LIGHT_SPEED / 2 * 5.0 / 2.3548 * 1.0 / s)),
        (
            {"edge_factor": 1.65, "excess": 0.5},
            None,
            lambda s: np.hypot(0.01, LIGHT_SPEED / 2 * 1.65 * 5.0 / 2.3548 * np.sqrt(1 + 0.5 * s) / s),
        ),
        ({}, PulseShape(8.0), lambda s: np.hypot(0.01, LIGHT_SPEED / 2 * 8.0 / 2.3548 * 1.0 / s)),
        (
            {"range_law": "power", "range_at_threshold_m": 0.2, "range_power": 0.5},
            None,
            lambda s: np.hypot(0.01, 0.2 * np.sqrt(5.5 / s)),
        ),
        ({"range_law": "distance", "range_base_m": 0.02, "range_slope": 0.001}, None, lambda s: 0.02 + 0.001 * 80.0),
    ],
)
@pytest.mark.parametrize("signal", [20.0, 400.0])
def test_range_noise_follows_its_law(numbers, shape, expected, signal):
    detector = sensor(range_resolution_m=0.0, false_rate_hz=0.0, **numbers)
    found = linear_echoes(same(N, 80.0, signal, shape=shape), detector, threads=1)
    assert len(found) == N
    assert stats.kstest(found.range_m, stats.norm(80.0, expected(signal)).cdf).pvalue > 1e-4
    assert abs(found.range_m.std() / expected(signal) - 1.0) < 4.0 / np.sqrt(2.0 * N)


def test_walk_moves_a_range_by_the_recorded_amplitude():
    detector = sensor(walk_m_per_decade=0.1, saturation=5e4, range_resolution_m=0.0, **EXACT)
    found = linear_echoes(light([[50.0]] * 3, [[50.0], [500.0], [5e6]]), detector, threads=1)
    assert found.range_m == pytest.approx([50.0, 49.9, 49.7], abs=1e-12)
    own = sensor(walk_m_per_decade=0.1, walk_reference=500.0, range_resolution_m=0.0, **EXACT)
    assert linear_echoes(same(1, 50.0, 50.0), own, threads=1).range_m == pytest.approx([50.1], abs=1e-12)


def test_ranges_are_rounded_to_the_step_halves_to_the_even_one():
    detector = sensor(range_resolution_m=0.25, **EXACT)
    asked = np.array([10.125, 10.375, 10.1, 10.13, 10.625])
    assert linear_echoes(light(asked[:, None], 1e3), detector, threads=1).range_m.tolist() == [
        10.0,
        10.5,
        10.0,
        10.25,
        10.5,
    ]


def test_a_constant_error_is_added_before_rounding_and_left_out_of_unrounded_ranges():
    detector = sensor(range_resolution_m=0.25, range_offset_m=0.2, **EXACT)
    echoes = same(1, 10.0, 1e3)
    assert linear_echoes(echoes, detector, threads=1).range_m.tolist() == [10.25]
    assert linear_echoes(echoes, detector, threads=1, rounded=False).range_m.tolist() == [10.0]


def test_a_channels_range_offset_is_in_the_range_and_not_in_the_laws(monkeypatch):
    from lidarcheck.sensor.feature import Feature

    detector = sensor(features=(Feature("P", "calibrated_reflectivity"),), range_resolution_m=0.0, **EXACT)
    monkeypatch.setattr(type(detector.beams), "range_offset_m", lambda self, layer: np.full(len(layer), 0.5))
    found = linear_echoes(same(1, 100.0, 5.0001), detector, threads=1)
    assert found.range_m == pytest.approx([100.5])
    assert found.features["P"] == pytest.approx([50.001])


def test_what_the_rounded_range_puts_outside_the_gate_is_no_detection():
    detector = sensor(min_range_m=1.0, max_range_m=10.0, range_resolution_m=0.5, **EXACT)
    asked = np.array([0.74, 0.76, 1.2, 10.2, 10.3])
    found = linear_echoes(light(asked[:, None], 1e3), detector, threads=1)
    assert found.beam.tolist() == [1, 2, 3]
    assert found.range_m.tolist() == [1.0, 1.0, 10.0]
    again = linear_echoes(light(asked[:, None], 1e3), detector, threads=1, rounded=False)
    assert again.range_m == pytest.approx([0.76, 1.2, 10.2])


def test_what_lies_outside_of_the_gate_takes_no_place_from_others():
    detector = sensor(min_range_m=5.0, **EXACT)
    assert linear_echoes(same(1, [2.0, 50.0], [1e6, 1e3]), detector, threads=1).range_m.tolist() == [50.0]


def test_limits_of_the_gate_that_are_multiples_of_the_step_lie_inside():
    detector = sensor(min_range_m=0.3, max_range_m=100.0, range_resolution_m=0.002, **EXACT)
    found = linear_echoes(light([[0.3], [100.0], [0.2985], [100.0015]], 1e6), detector, threads=1)
    assert found.beam.tolist() == [0, 1]
