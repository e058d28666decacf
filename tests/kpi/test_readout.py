"""Directions, positions, echo numbers, percentiles and steps, each against a closed form, and on nothing."""

import math

import numpy as np
import pytest

from lidarcheck.kpi.direction import off_beam, surface_points
from lidarcheck.kpi.numbering import beams_in_order, number_share
from lidarcheck.kpi.percentiles import percentile, percentiles
from lidarcheck.kpi.quantisation import quantisation_step
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor

BEAMS = Sensor.of("SLIM").beams
LAYER, POINT = (grid.ravel() for grid in np.meshgrid(np.arange(0, 520, 3), np.arange(0, 960, 7), indexing="ij"))


def at(azimuth_deg: np.ndarray, elevation_deg: np.ndarray, range_m: object = 30.0) -> tuple[np.ndarray, ...]:
    left, up = np.deg2rad(azimuth_deg), np.deg2rad(elevation_deg)
    return range_m * np.cos(left) * np.cos(up), range_m * np.sin(left) * np.cos(up), range_m * np.sin(up)


AZIMUTH, ELEVATION = (POINT - 479.5) * 0.125, (LAYER - 259.5) * 0.05


@pytest.mark.parametrize(("left", "up"), [(0.0, 0.0), (0.0625, 0.025), (-0.7, 0.9), (3.0, -2.0), (40.0, 0.0)])
def test_a_turn_is_found_whatever_the_beam(left: float, up: float) -> None:
    found = off_beam(*at(AZIMUTH + left, ELEVATION + up), LAYER, POINT, BEAMS)
    assert np.abs(found.azimuth_deg - left).max() <= 0.00051
    assert np.abs(found.elevation_deg - up).max() <= 0.00051


def test_on_its_beam_an_echo_is_off_by_nothing_at_all() -> None:
    x, y, z = (np.round(axis, 5) for axis in at(AZIMUTH, ELEVATION, np.linspace(5.0, 250.0, LAYER.size)))
    for angle in off_beam(x, y, z, LAYER, POINT, BEAMS):
        assert not angle.any()
        assert not np.signbit(angle).any()


def test_a_mirrored_axis_turns_by_twice_the_angle() -> None:
    x, y, z = at(AZIMUTH, ELEVATION)
    assert off_beam(x, -y, z, LAYER, POINT, BEAMS).azimuth_deg == pytest.approx(-2.0 * AZIMUTH, abs=0.0006)
    assert off_beam(x, y, -z, LAYER, POINT, BEAMS).elevation_deg == pytest.approx(-2.0 * ELEVATION, abs=0.0006)
    behind = off_beam(-x, y, z, LAYER, POINT, BEAMS).azimuth_deg
    assert np.abs(behind) == pytest.approx(180.0 - 2.0 * np.abs(AZIMUTH), abs=0.0006)


def test_no_beam_and_no_range_have_no_direction() -> None:
    x, y, z = at(np.zeros(4), np.zeros(4), np.array([10.0, 10.0, 10.0, 0.0]))
    found = off_beam(x, y, z, np.array([-1, 520, 100, 100]), np.array([5, 5, 960, 5]), BEAMS)
    assert np.isnan(found.elevation_deg).all()
    assert np.isnan(found.azimuth_deg[:3]).all()


def test_surface_points_are_the_files_own_where_it_has_them() -> None:
    zeros = np.zeros(2)
    table = (np.array([0, 519]), np.array([0, 959]), np.array([10.0, 20.0]), zeros, zeros)
    along = surface_points(IdealScan(*table))
    assert np.linalg.norm(along, axis=1) == pytest.approx([10.0, 20.0])
    assert along[0] == pytest.approx([*map(float, at(np.array(-59.9375), np.array(-12.975), 10.0))])
    own = {"X": np.array([1.0, 2.0]), "y": np.array([3.0, 4.0]), "Z": np.array([5.0, 6.0])}
    assert surface_points(IdealScan(*table, extra=own)).tolist() == [[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]


def test_order_is_of_beams_with_several_echoes() -> None:
    beam = np.array([9, 9, 4, 4, 4, 7, 2, 2, 3, 3])
    number = np.array([1, 2, 3, 1, 2, 5, 1, 1, 0, 8])
    range_m = np.array([30.0, 20.0, 30.0, 10.0, 20.0, 9.0, 5.0, 6.0, 7.0, 7.0])
    #       2: one number twice, 3: one range, 4: in order though the rows are not, 7: alone, 9: reversed
    assert beams_in_order(beam, number, range_m).tolist() == [False, True, True, False]
    nothing = np.zeros(0)
    assert beams_in_order(nothing, nothing, nothing).tolist() == []


def test_the_share_of_a_number() -> None:
    assert number_share(np.array([0, 1, 1, 2]), 1) == 0.5
    assert number_share(np.array([0, 1, 1, 2]), 3) == 0.0
    assert math.isnan(number_share(np.zeros(0), 1))


def test_percentiles_and_their_intervals() -> None:
    values = np.random.default_rng(0).permutation(np.arange(1.0, 1001.0))
    found = percentiles(values)
    assert list(found) == [5, 50, 95]
    for level, one in found.items():
        assert one.value == percentile(values, level) == pytest.approx(np.percentile(values, level, method="hazen"))
        half = 1.96 * math.sqrt(10.0 * level * (1.0 - level / 100.0))
        assert (one.value - one.low, one.high - one.value) == pytest.approx((half, half), rel=1e-4)
    few = percentiles(np.arange(20.0))
    assert math.isnan(few[5].low)
    assert math.isnan(few[95].high)
    assert few[50].low < few[50].value < few[50].high
    assert percentiles(np.full(200, 3.0))[50] == (3.0, 3.0, 3.0)
    assert percentile([7.0], 95) == 7.0
    assert all(math.isnan(number) for one in percentiles([]).values() for number in one)


def test_a_percentile_of_a_feature_in_steps_lies_between_them() -> None:
    # A quarter is 1 and three quarters are 2: their middles lie at 12.5 % and 62.5 %.
    steps = np.array([1.0, 2.0, 2.0, 2.0])
    assert percentile(steps, 37.5) == 1.5
    assert percentile(steps, 5) == 1.0
    assert percentile(steps, 95) == 2.0
    rng = np.random.default_rng(2)
    moved = [percentile(np.rint(rng.normal(10.0 + by, 1.0, 200_000)), 50) for by in (0.0, 0.1, 0.2, 0.3)]
    assert moved == pytest.approx([10.0, 10.1, 10.2, 10.3], abs=0.03)


def test_intervals_hold_the_truth_in_95_of_100_samples() -> None:
    rng = np.random.default_rng(1)
    truth = {5: -math.log(0.95), 50: math.log(2.0), 95: -math.log(0.05)}
    held = dict.fromkeys(truth, 0)
    for _ in range(1000):
        for level, found in percentiles(rng.exponential(size=200)).items():
            held[level] += found.low <= truth[level] <= found.high
    assert all(930 <= number <= 985 for number in held.values()), held


RNG = np.random.default_rng(3)
RANGES_M = RNG.uniform(15.0, 120.0, 3000)


@pytest.mark.parametrize("number", [60, 3000])
@pytest.mark.parametrize("step_m", [0.01, 0.02, 0.004, 0.0375])
def test_the_step_of_ranges(step_m: float, number: int) -> None:
    for whole in (np.rint, np.floor):
        found = quantisation_step(whole(RANGES_M[:number] / step_m) * step_m, 1e-4)
        assert found == pytest.approx(step_m, rel=1e-5)


def test_a_hundredth_may_lie_off_the_step_and_no_more() -> None:
    values = np.rint(RANGES_M / 0.01) * 0.01
    for off, step_m in ((0.008, 0.01), (0.03, 0.0)):
        mixed = np.where(np.arange(3000) < off * 3000, RANGES_M, values)
        assert quantisation_step(mixed, 1e-4) == pytest.approx(step_m)
    rounded = np.round(values + RNG.uniform(-5e-5, 5e-5, 3000), 4)
    assert quantisation_step(rounded, 1e-4) == pytest.approx(0.01, rel=1e-4)


@pytest.mark.parametrize("step", [1.0, 2.0, 3.0, 0.5, 7.0])
def test_the_step_of_counts(step: float) -> None:
    counts = RNG.poisson(60.0, 2000)
    assert quantisation_step(step * counts) == step
    assert quantisation_step(step * (counts % 5)) == step
    assert quantisation_step(-step * counts) == step


def test_samples_without_a_step() -> None:
    assert quantisation_step(RANGES_M, 1e-4) == 0.0
    assert quantisation_step(np.full(5, 50.0)) == 50.0
    assert quantisation_step([6.0, 10.0, 15.0]) == 1.0
    assert math.isnan(quantisation_step([]))
    assert math.isnan(quantisation_step([0.0, 0.0]))
    # Zeros are multiples of everything.
    assert quantisation_step([0.0] * 990 + [4.0] * 10) == 4.0
