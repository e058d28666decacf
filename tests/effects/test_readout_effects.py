"""Jitter, walk and moved ranges: what they do to echoes, and the order that echoes keep."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import optimize, stats

from effect_kit import Around, echoes, empty, wall
from lidarcheck import effects
from lidarcheck.effects.base import ReadoutEffect
from lidarcheck.effects.shared.ranges import at_range
from lidarcheck.scan import Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Sensor

FINE = Around(empty(), sensor=Sensor.of("SMART", range_resolution_m=0.0))
COARSE = Around(empty())
NEUTRAL = {
    "timing_jitter": {"sigma_ns": 0.0, "uniform_ns": 0.0},
    "walk_error": {"per_decade_m": 0.0, "bend_m": 0.0},
    "range_offset": {"offset_m": 0.0},
    "range_scale": {"fraction": 0.0},
}


def read(name: str, scan: Scan, around: Around = FINE, **setting: float) -> Scan:
    effect = effects.make(name, setting)
    assert isinstance(effect, ReadoutEffect)
    return effect.readout(scan, around)


def frame(beams: int, echoes_each: int = 1) -> Scan:
    """Echoes at 20, 40, 60 m of every beam."""
    beam = np.repeat(np.arange(beams), echoes_each)
    number = np.tile(np.arange(echoes_each) + 1, beams)
    return echoes([(b // 960, b % 960) for b in beam.tolist()], number.tolist(), (20.0 * number).tolist())


@pytest.mark.parametrize("name", NEUTRAL)
def test_no_strength_gives_back_the_same_object(name: str) -> None:
    scan = frame(3)
    assert read(name, scan, **NEUTRAL[name]) is scan


@pytest.mark.parametrize("name", NEUTRAL)
def test_a_scan_without_echoes_is_no_trouble(name: str) -> None:
    assert len(read(name, echoes([], [], []))) == 0


# jitter


def test_jitter_is_normal_and_its_own_for_every_echo() -> None:
    scan = frame(6000, 3)
    late_m = read("timing_jitter", scan, sigma_ns=0.8).range_m - scan.range_m
    sigma_m = 0.8 * 0.5 * LIGHT_SPEED_M_PER_NS
    assert stats.kstest(late_m, stats.norm(0.0, sigma_m).cdf).pvalue > 1e-3
    assert late_m.std() == pytest.approx(sigma_m, rel=4 / math.sqrt(2 * len(late_m)))
    per_beam = late_m.reshape(-1, 3)
    assert np.abs(np.corrcoef(per_beam.T) - np.eye(3)).max() < 4 / math.sqrt(6000)


def test_uniform_jitter_is_uniform() -> None:
    scan = frame(6000)
    late_m = read("timing_jitter", scan, sigma_ns=0.0, uniform_ns=2.0).range_m - scan.range_m
    assert stats.kstest(late_m, stats.uniform(-LIGHT_SPEED_M_PER_NS, 2 * LIGHT_SPEED_M_PER_NS).cdf).pvalue > 1e-3
    both = read("timing_jitter", scan, sigma_ns=1.0, uniform_ns=2.0).range_m - scan.range_m
    assert both.var() == pytest.approx((0.5 * LIGHT_SPEED_M_PER_NS) ** 2 * (1.0 + 4.0 / 3.0), rel=0.08)


def test_jitter_of_an_echo_does_not_depend_on_other_rows() -> None:
    scan = frame(500, 3)
    picked = np.flatnonzero(np.arange(1500) % 4 == 1)[::-1]
    whole = read("timing_jitter", scan, sigma_ns=0.5)
    part = read("timing_jitter", scan.take(picked), sigma_ns=0.5)
    assert np.array_equal(part.range_m, whole.range_m[picked])


# walk


def test_walk_goes_by_the_logarithm_of_area() -> None:
    area = [1.0, 100.0, 1000.0, 31622.7766]
    scan = dataclasses.replace(frame(4), area=np.array(area))
    shift = read("walk_error", scan, per_decade_m=0.1, bend_m=-0.02, reference_area=100.0).range_m - 20.0
    decades = np.array([-2.0, 0.0, 1.0, 2.5])
    assert shift == pytest.approx(0.1 * decades - 0.02 * decades**2, abs=1e-9)
    assert read("walk_error", scan).range_m - 20.0 == pytest.approx(0.05 * (decades - 1.0), abs=1e-9)


def test_walk_of_an_area_of_nothing_is_that_of_one() -> None:
    scan = dataclasses.replace(frame(3), area=np.array([0.0, 0.5, 1.0]))
    for power in (0.0, -1.0, 1.0):
        moved = read("walk_error", scan, power=power).range_m
        assert np.isfinite(moved).all()
        assert np.ptp(moved) < 1e-12


@pytest.mark.parametrize("power", [-2.0, -0.5, 0.7])
def test_walk_by_a_power_is_that_power(power: float) -> None:
    area = np.array([90.0, 400.0, 5000.0])
    scan = dataclasses.replace(frame(3), area=area)
    shift = read("walk_error", scan, per_decade_m=0.01, reference_area=400.0, power=power).range_m - 20.0
    assert shift == pytest.approx(0.01 * ((area / 400.0) ** power - 1.0) / (power * math.log(10)), abs=1e-9)


def test_a_table_of_shifts_is_added_to_the_walk_s_curve() -> None:
    """At whole quarters of a decade its own numbers, between them linear in log AREA, beyond its end the last one."""
    area = np.array([1.0, 10.0**0.25, 10.0**0.375, 10.0**0.5, 1e3])
    scan = dataclasses.replace(frame(5), area=area)
    plain = read("walk_error", scan, per_decade_m=0.01).range_m
    table = read("walk_error", scan, per_decade_m=0.01, shifts_m=(0.0, 0.1, 0.3)).range_m
    assert table - plain == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.3], abs=1e-9)
    alone = read("walk_error", scan, per_decade_m=0.0, bend_m=0.0, shifts_m=(0.1,)).range_m
    assert alone == pytest.approx(np.full(5, 20.1))


def test_a_small_power_is_nearly_the_logarithm() -> None:
    scan = dataclasses.replace(frame(3), area=np.array([90.0, 400.0, 5000.0]))
    logarithm = read("walk_error", scan, power=0.0).range_m
    assert read("walk_error", scan, power=1e-4).range_m == pytest.approx(logarithm, abs=1e-4)
    assert read("walk_error", scan, power=-2e-6).range_m == pytest.approx(logarithm, abs=1e-6)


@pytest.mark.parametrize("exponent", [0.25, 0.5, 1.0])
def test_walk_can_follow_another_simulator_s_curve(exponent: float) -> None:
    """a / AREA^p, 10 cm at AREA 90, over all areas that echoes have."""
    area = np.geomspace(90.0, 5000.0, 40)
    target = 0.1 * (area / 90.0) ** -exponent
    scan = dataclasses.replace(frame(40), area=area)

    def misfit(at: np.ndarray) -> np.ndarray:
        return (
            read(
                "walk_error",
                scan,
                per_decade_m=float(at[0]),
                bend_m=float(at[1]),
                reference_area=float(10 ** at[2]),
                power=-exponent,
            ).range_m
            - 20.0
            - target
        )

    fit = optimize.least_squares(misfit, [-0.05, 0.0, 4.0], bounds=([-2, -2, 2], [2, 2, 6]), x_scale=[0.01, 0.01, 1])
    assert np.abs(fit.fun).max() < 0.003


# moving echoes


def test_ranges_are_never_behind_the_sensor_and_rounded_by_the_model_alone() -> None:
    scan = echoes([(1, 1), (1, 2), (1, 3)], [1, 1, 1], [0.3, 5.0, 0.5])
    moved = read("range_offset", scan, COARSE, offset_m=-0.496)
    assert moved.range_m == pytest.approx([0.0, 4.504, 0.004], abs=1e-12)
    assert moved.layer.tolist() == [1, 1, 1]
    assert not np.signbit(moved.x_m).any()


def test_echoes_that_keep_their_places_keep_their_rows_bit_by_bit() -> None:
    scan = frame(50, 3)
    moved = at_range(scan, scan.range_m + 0.25)
    along = Scan.from_beams(scan.layer, scan.point, scan.range_m + 0.25)
    for column in ("x_m", "y_m", "z_m"):
        assert getattr(moved, column).tobytes() == getattr(along, column).tobytes()
    assert np.array_equal(moved.echo_number, scan.echo_number)
    assert np.array_equal(moved.extra["mark"], np.arange(150))


def test_echoes_that_change_places_are_numbered_by_range_again() -> None:
    scan = echoes([(0, 1), (0, 1), (0, 2), (0, 2), (0, 2), (7, 0)], [1, 2, 1, 2, 3, 1], [10, 20, 10, 20, 30, 5])
    moved = at_range(scan, np.array([11.0, 21.0, 25.0, 31.0, 12.0, 5.0]))
    assert moved.range_m == pytest.approx([11, 21, 12, 25, 31, 5])
    assert moved.echo_number.tolist() == [1, 2, 1, 2, 3, 1]
    assert moved.extra["mark"].tolist() == [0, 1, 4, 2, 3, 5]
    assert moved.area.tolist() == [100, 101, 104, 102, 103, 105]


def test_a_beam_whose_rows_stand_in_any_order_of_its_echoes_keeps_them_where_no_echo_changes_places() -> None:
    scan = echoes([(0, 1), (0, 1), (0, 2)], [2, 1, 1], [20, 10, 5])
    moved = at_range(scan, np.array([21.0, 11.0, 6.0]))
    assert moved.range_m == pytest.approx([21, 11, 6])
    assert moved.echo_number.tolist() == [2, 1, 1]
    assert moved.extra["mark"].tolist() == [0, 1, 2]


def test_a_table_in_any_order_gets_its_echoes_in_order() -> None:
    rng = np.random.default_rng(4)
    scan = frame(200, 3)
    mixed = scan.take(rng.permutation(600))
    wanted = rng.uniform(1.0, 100.0, 600)
    moved = at_range(mixed, wanted)
    assert np.array_equal(moved.layer * 960 + moved.point, mixed.layer * 960 + mixed.point)
    assert np.array_equal(moved.echo_number, mixed.echo_number)
    for beam in range(200):
        rows = np.flatnonzero(moved.point == beam)
        by_number = rows[np.argsort(moved.echo_number[rows])]
        before = np.flatnonzero(mixed.point == beam)
        assert moved.range_m[by_number] == pytest.approx(np.sort(wanted[before]))
        by_wanted = before[np.argsort(wanted[before])]
        assert np.array_equal(moved.extra["mark"][by_number], mixed.extra["mark"][by_wanted])


def test_strong_jitter_leaves_a_frame_in_order() -> None:
    scan = frame(2000, 3)
    moved = read("timing_jitter", scan, sigma_ns=100.0)
    ranges = moved.range_m.reshape(-1, 3)
    assert (np.diff(ranges, axis=1) >= 0).all()
    assert (ranges >= 0).all()
    assert np.array_equal(moved.echo_number, scan.echo_number)
    assert not np.array_equal(moved.extra["mark"], np.arange(6000))


def test_one_beam_is_a_table_too() -> None:
    assert wall(1).layer.tolist() == [0]
    assert read("timing_jitter", frame(1), sigma_ns=1.0).range_m[0] != 20.0
