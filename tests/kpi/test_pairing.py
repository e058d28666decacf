import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.kpi.detection import detection_probability, false_alarms, range_edges, wilson
from lidarcheck.kpi.pairing import pair_echoes, pair_with_ideal, ranges, surface_window_m
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import VARIANTS, Sensor


def ideal_of(rows):
    layer, point, distance = (np.array(x) for x in zip(*rows, strict=True))
    return IdealScan(layer, point, distance, np.ones(len(rows), dtype=int), np.zeros(len(rows)))


def scan_of(rows):
    layer, point, range_m = (np.array(x) for x in zip(*rows, strict=True)) if rows else (np.zeros(0),) * 3
    return Scan.from_beams(layer.astype(np.int32), point.astype(np.int32), range_m)


IDEAL = ideal_of([(7, 3, 40.0), (5, 9, 0.0), (5, 8, 20.0), (7, 3, 10.0), (6, 1, 0.0), (6, 1, 12.0)])
# Beams in order: (5, 8) at 20, (5, 9) nothing, (6, 1) nothing and 12, (7, 3) 10 and 40.


class TestPairing:
    def test_by_hand(self):
        scan = scan_of([(7, 3, 9.8), (7, 3, 39.0), (5, 9, 3.0), (5, 8, 20.5), (6, 1, 100.0)])
        p = pair_with_ideal(IDEAL, scan)
        assert list(zip(p.layer, p.point, strict=True)) == [(5, 8), (5, 9), (6, 1), (7, 3)]
        np.testing.assert_array_equal(p.distance_m, [20.0, 0.0, 12.0, 10.0])
        np.testing.assert_array_equal(p.detected, [True, False, False, True])
        np.testing.assert_array_equal(p.echo_beam, [3, 3, 1, 0, 2])
        np.testing.assert_allclose(p.residual_m, [-0.2, -1.0, np.nan, 0.5, 88.0], atol=1e-9)
        np.testing.assert_array_equal(p.on_surface, [True, False, False, True, False])
        np.testing.assert_array_equal(p.of_surface, [True, True, False, True, False])
        np.testing.assert_array_equal(p.surface, [3, 0, -1, 2, 5])

    def test_residual_is_to_the_nearest_of_many_surfaces(self):
        g = np.random.default_rng(0)
        beams = g.integers(0, 20, 300)
        ideal = ideal_of(list(zip(beams // 5, beams % 5, g.uniform(0, 300, 300), strict=True)))
        echo = g.choice(np.unique(beams), 500)
        scan = scan_of(list(zip(echo // 5, echo % 5, g.uniform(0, 350, 500), strict=True)))
        p = pair_with_ideal(ideal, scan)
        for i in range(500):
            gaps = ranges(scan)[i] - ideal.distance_m[beams == echo[i]]
            assert p.residual_m[i] == pytest.approx(gaps[np.argmin(np.abs(gaps))])

    def test_no_echo_and_no_surface(self):
        p = pair_with_ideal(IDEAL, scan_of([]))
        assert not p.detected.any()
        assert p.residual_m.size == 0
        p = pair_with_ideal(ideal_of([(1, 1, 0.0)]), scan_of([(1, 1, 5.0)]))
        assert np.isnan(p.residual_m[0])
        assert p.surface[0] == -1
        assert false_alarms(p).per_beam == 1.0

    def test_a_beam_that_was_not_fired_is_named(self):
        with pytest.raises(UsageError, match="Layer 5, Point 10,"):
            pair_with_ideal(IDEAL, scan_of([(5, 8, 20.0), (5, 10, 1.0), (4, 1, 1.0)]))
        with pytest.raises(UsageError, match="Layer 5, Point 8,"):
            pair_with_ideal(IDEAL.take(np.zeros(0, dtype=int)), scan_of([(5, 8, 20.0)]))
        with pytest.raises(UsageError, match="Layer -1, Point -1"):
            pair_with_ideal(IDEAL, scan_of([(-1, -1, 20.0)]))


class TestPairEchoes:
    def test_by_hand(self):
        measured = scan_of([(1, 1, 10.1), (1, 1, 50.0), (2, 2, 30.0), (3, 3, 7.0), (-1, -1, 4.0)])
        simulated = scan_of([(2, 2, 36.0), (1, 1, 49.9), (1, 1, 10.0), (4, 4, 1.0), (-1, -1, 4.0)])
        pairs = pair_echoes(measured, simulated)
        np.testing.assert_array_equal(pairs.measured, [0, 1])
        np.testing.assert_array_equal(pairs.simulated, [2, 1])
        np.testing.assert_allclose(pairs.difference_m, [0.1, 0.1])
        assert (pairs.beams_both, pairs.beams_measured, pairs.beams_simulated) == (2, 1, 1)

    def test_empty(self):
        assert pair_echoes(scan_of([]), scan_of([])).measured.size == 0
        assert pair_echoes(scan_of([(1, 1, 2.0)]), scan_of([])).beams_measured == 1
        assert pair_echoes(scan_of([]), scan_of([(1, 1, 2.0)])).beams_simulated == 1


class TestDetection:
    def test_by_hand(self):
        distance = [5.0, 5.0, 9.999, 10.0, 0.0, 31.0]
        seen = [True, False, True, True, False, False]
        d = detection_probability(distance, seen)
        np.testing.assert_array_equal(d.edges_m, [0, 10, 20, 30, 40])
        np.testing.assert_array_equal(d.beams, [3, 1, 0, 1])
        np.testing.assert_array_equal(d.detected, [2, 1, 0, 0])
        np.testing.assert_allclose(d.probability, [2 / 3, 1.0, np.nan, 0.0])
        assert (d.low[2], d.high[2]) == (0.0, 1.0)
        assert d.overall == 3 / 5

    def test_sub_beams_count_once_in_the_bin_of_the_nearest(self):
        p = pair_with_ideal(IDEAL, scan_of([(7, 3, 40.2), (7, 3, 10.0), (6, 1, 12.4)]))
        d = detection_probability(p.distance_m, p.detected, edges_m=[0.0, 15.0, 50.0])
        np.testing.assert_array_equal(d.beams, [2, 1])
        np.testing.assert_array_equal(d.detected, [2, 0])

    def test_half_a_pulse_is_the_limit(self):
        """c·FWHM/2 = 0.299792458 · 5 / 2 = 0.749481 m for both variants; of another pulse as much more."""
        for range_m, seen in ((19.2506, True), (20.7494, True), (20.7495, False), (19.2505, False)):
            assert pair_with_ideal(IDEAL, scan_of([(5, 8, range_m)])).detected[0] == seen
        assert [surface_window_m(Sensor.of(name)) for name in VARIANTS] == pytest.approx([0.749481145] * 2, abs=1e-9)
        longer = Sensor.of("SLIM", pulse_fwhm_ns=10.0)
        assert pair_with_ideal(IDEAL, scan_of([(5, 8, 21.4)]), longer).detected[0]

    def test_nothing_to_see(self):
        d = detection_probability([0.0, 0.0], [False, False])
        assert np.isnan(d.overall)
        assert detection_probability([], []).beams.sum() == 0

    def test_refuses(self):
        with pytest.raises(UsageError, match="ascend"):
            detection_probability([1.0], [True], edges_m=[3.0, 2.0])
        with pytest.raises(UsageError, match="2 distances and 1 detections"):
            detection_probability([1.0, 2.0], [True])

    def test_edges_hold_every_distance(self):
        np.testing.assert_array_equal(range_edges([0.0]), [0.0, 10.0])
        np.testing.assert_array_equal(range_edges([20.0, 30.0]), [20.0, 30.0, 40.0])

    def test_a_stray_distance_makes_bins_wider_not_countless(self):
        edges = range_edges([5.0, 1e9])
        assert edges.size <= 1002
        assert edges[0] <= 5.0
        assert edges[-1] > 1e9
        found = detection_probability([5.0, 1e9], [True, False])
        assert found.beams.sum() == 2


class TestWilson:
    def test_published_values(self):
        # Newcombe, Stat. Med. 17 (1998), table I, method 3.
        for k, n, low, high in (
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ):
            assert [float(x) for x in wilson(k, n)] == pytest.approx([low, high], abs=5e-5)

    def test_agrees_with_scipy(self):
        from scipy.stats import binomtest

        for k, n in ((0, 1), (1, 1), (3, 7), (50, 50), (499, 1000)):
            expected = binomtest(k, n).proportion_ci(method="wilson")
            assert [float(x) for x in wilson(k, n)] == pytest.approx([expected.low, expected.high], abs=1e-9)

    def test_holds_the_share_and_knows_nothing_of_nothing(self):
        low, high = wilson([0, 0, 5, 3], [0, 9, 5, 6])
        np.testing.assert_array_equal(low[:2], [0.0, 0.0])
        assert high[0] == high[2] == 1.0
        assert low[3] < 0.5 < high[3]


def test_false_alarms_by_hand():
    scan = scan_of([(7, 3, 10.0), (7, 3, 25.0), (5, 9, 3.0), (5, 8, 20.8), (6, 1, 12.0)])
    alarms = false_alarms(pair_with_ideal(IDEAL, scan))
    assert (alarms.echoes, alarms.beams, alarms.per_beam) == (3, 4, 0.75)
    none = false_alarms(pair_with_ideal(IDEAL.take(np.zeros(0, dtype=int)), scan_of([])))
    assert none.beams == 0
    assert np.isnan(none.per_beam)


def test_ranges_ignore_the_rounding_of_a_text_file():
    g = np.random.default_rng(1)
    layer, point = g.integers(0, 520, 1000).astype(np.int32), g.integers(0, 960, 1000).astype(np.int32)
    scan = Scan.from_beams(layer, point, np.round(g.uniform(1, 300, 1000), 2))
    read = Scan(
        *(np.round(x, 6) for x in (scan.x_m, scan.y_m, scan.z_m)),
        layer,
        point,
        scan.echo_number,
        scan.width_ns,
        scan.area,
        scan.peak,
    )
    np.testing.assert_array_equal(ranges(scan), ranges(read))
