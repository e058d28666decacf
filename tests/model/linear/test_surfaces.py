"""Several surfaces in one beam: what merges, what survives, and draws that do not depend on others."""

import itertools

import numpy as np
import pytest
from scipy import stats

import slow_linear
from any_detector_kit import light, same, sensor
from lidarcheck.model.linear.echoes import linear_echoes
from lidarcheck.model.picks import KEEP_CODES, pick
from lidarcheck.scan import PulseShape, light_of_beams
from lidarcheck.sensor.feature import Feature

EXACT = {"range_floor_m": 0.0, "edge_factor": 0.0, "noise": 0.0, "threshold": 5.0, "range_resolution_m": 0.0}


def test_surfaces_nearer_than_the_separation_are_one_in_chains():
    detector = sensor(min_separation_m=1.0, max_echoes=5, **EXACT)
    found = linear_echoes(
        same(1, [12.3, 10.0, 10.8, 11.6, 30.0, 31.0], [40.0, 10.0, 20.0, 30.0, 6.0, 7.0]), detector, threads=1
    )
    one = (10.0 * 10 + 10.8 * 20 + 11.6 * 30 + 12.3 * 40) / 100
    assert found.range_m == pytest.approx([one, 30.0, 31.0], abs=1e-12)
    assert found.amplitude == pytest.approx([100.0, 6.0, 7.0], abs=1e-12)
    assert found.echo_number.tolist() == [1, 2, 3]


def test_light_comes_first_then_noise():
    """Two halves of a beam's light at one place are detected as one surface is, with one draw."""
    detector = sensor(excess=0.3)
    whole = linear_echoes(same(5000, 50.0, 6.0), detector, threads=1)
    halves = linear_echoes(same(5000, [50.0, 50.0], [3.0, 3.0]), detector, threads=1)
    assert np.array_equal(whole.amplitude, halves.amplitude)
    assert np.array_equal(whole.range_m, halves.range_m)


def test_a_longer_pulse_merges_what_stands_farther_apart():
    detector = sensor(max_echoes=2, **EXACT)
    apart = 1.5 * detector.separation_m
    assert len(linear_echoes(same(1, [50.0, 50.0 + apart], 100.0), detector, threads=1)) == 2
    assert len(linear_echoes(same(1, [50.0, 50.0 + apart], 100.0, shape=PulseShape(10.0)), detector, threads=1)) == 1


@pytest.mark.parametrize("keep", KEEP_CODES)
def test_what_is_kept_is_what_a_slow_choice_keeps(keep):
    order = np.empty(8, dtype=np.int64)
    for n in range(5):
        for strengths in itertools.product((1.0, 2.0, 3.0), repeat=n):
            echoes = [{"path": float(i), "a": a} for i, a in enumerate(strengths)]
            for most in (1, 2, 3):
                expected = [int(echo["path"]) for echo in slow_linear.kept(keep, most, echoes)]
                held = pick(KEEP_CODES[keep], most, n, np.array([*strengths, 9.9]), order)
                assert order[:held].tolist() == expected, (strengths, most)


@pytest.mark.parametrize("keep", KEEP_CODES)
def test_numbers_go_by_range_and_picks_by_the_words_of_keep(keep):
    detector = sensor(max_echoes=2, keep=keep, return_order="as_kept", **EXACT)
    found = linear_echoes(same(3, [80.0, 20.0, 50.0], [30.0, 20.0, 10.0]), detector, threads=1)
    expected = {
        "strongest": [(20.0, 1), (80.0, 0)],
        "first": [(20.0, 0), (50.0, 1)],
        "last": [(50.0, 1), (80.0, 0)],
        "strongest_last": [(20.0, 1), (80.0, 0)],
        "first_last": [(20.0, 0), (80.0, 1)],
        "first_strongest": [(20.0, 0), (80.0, 1)],
        "strongest_second": [(20.0, 1), (80.0, 0)],
    }[keep]
    assert list(zip(found.range_m.tolist(), found.pick.tolist(), strict=True)) == expected * 3
    assert found.echo_number.tolist() == [1, 2] * 3
    assert np.array_equal(found.made_number, found.pick + 1)
    by_range = linear_echoes(same(3, [80.0, 20.0], 30.0), sensor(max_echoes=2, keep=keep, **EXACT), threads=1)
    assert np.array_equal(by_range.made_number, by_range.echo_number)


@pytest.mark.parametrize(
    ("numbers", "surfaces", "ambient"),
    [
        ({"keep": "strongest", "threshold": 3.2}, [(60.0, 6.0), (61.0, 5.0)], 0.3),
        (
            {"keep": "strongest_last", "excess": 0.5, "relative": 0.1},
            [(20.0, 8.0), (20.5, 3.0), (50.0, 7.0), (120.0, 6.0)],
            0.0,
        ),
        (
            {"keep": "first_strongest", "range_law": "power", "range_at_threshold_m": 0.3},
            [(298.9, 9.0), (150.0, 6.0)],
            0.0,
        ),
        (
            {"keep": "last", "walk_m_per_decade": 0.5, "saturation": 60.0, "false_rate_hz": 2e5},
            [(0.1, 50.0), (9.0, 7.0)],
            0.0,
        ),
        (
            {"keep": "strongest_second", "range_offset_m": -0.4, "min_range_m": 1.0},
            [(1.2, 9.0), (2.6, 8.0), (8.0, 8.0)],
            0.0,
        ),
    ],
)
def test_echoes_are_those_of_a_slow_simulator(numbers, surfaces, ambient):
    """Counts by number and pick as z, ranges and amplitudes by Kolmogorov–Smirnov, against a loop in plain Python."""
    detector = sensor(max_echoes=2, **numbers)
    slow_beams, fast_beams = 6000, 60_000
    _, number, place, range_m, amplitude = slow_linear.frame(detector, surfaces, ambient, slow_beams, seed=5)
    fast = linear_echoes(same(fast_beams, *np.array(surfaces).T, background=ambient), detector, seed=9, threads=1)
    for wanted in itertools.product((1, 2), (0, 1)):
        rows, ours = (
            (number == wanted[0]) & (place == wanted[1]),
            (fast.echo_number == wanted[0]) & (fast.pick == wanted[1]),
        )
        share = max(ours.sum(), 1) / fast_beams
        spread = np.sqrt(share * (1.0 - share) * (1.0 / slow_beams + 1.0 / fast_beams)) + 1e-9
        assert abs(rows.sum() / slow_beams - ours.sum() / fast_beams) < 4.5 * spread + 0.5 / slow_beams
        if rows.sum() >= 30:
            assert stats.ks_2samp(range_m[rows], fast.range_m[ours]).pvalue > 1e-4
            assert stats.ks_2samp(amplitude[rows], fast.amplitude[ours]).pvalue > 1e-4


def test_threads_chunks_and_the_order_of_beams_change_nothing():
    detector = sensor(threshold=3.5, max_echoes=2, features=(Feature("AMBIENT", "background"),))
    rng = np.random.default_rng(1)
    n = 20_000
    ranges, signals = rng.uniform(5.0, 200.0, (n, 2)), rng.uniform(0.0, 20.0, (n, 2))
    asked = light(ranges, signals, background=rng.uniform(0.0, 0.5, n))
    one, several = (linear_echoes(asked, detector, seed=3, frame=2, threads=threads) for threads in (1, 3))
    assert one.range_m.tobytes() == several.range_m.tobytes()
    assert one.amplitude.tobytes() == several.amplitude.tobytes()
    assert one.features["AMBIENT"].tobytes() == several.features["AMBIENT"].tobytes()
    part = slice(9000, 9100)
    alone = linear_echoes(light_of_beams(asked, np.isin(np.arange(n), np.arange(n)[part])), detector, seed=3, frame=2)
    rows = (one.beam >= part.start) & (one.beam < part.stop)
    assert alone.range_m.tobytes() == one.range_m[rows].tobytes()
    assert alone.features["AMBIENT"].tobytes() == one.features["AMBIENT"][rows].tobytes()
    assert linear_echoes(asked, detector, seed=4, frame=2).range_m[:50].tobytes() != one.range_m[:50].tobytes()
    assert linear_echoes(asked, detector, seed=3, frame=1).range_m[:50].tobytes() != one.range_m[:50].tobytes()


def test_a_further_pulse_leaves_the_draws_of_others():
    detector = sensor(max_echoes=3, false_rate_hz=0.0)
    before = same(3000, 80.0, 8.0)
    after = before.with_pulses(np.arange(3000), 20.0, 1000.0)
    one, two = linear_echoes(before, detector, threads=1), linear_echoes(after, detector, threads=1)
    assert np.array_equal(one.range_m, two.range_m[two.range_m > 50.0])


def test_no_beams_no_echoes():
    assert len(linear_echoes(light(np.empty((0, 1)), 1.0), sensor())) == 0
