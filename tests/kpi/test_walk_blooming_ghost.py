import csv
import math

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.kpi.blooming import blooming_profile, target_offset
from lidarcheck.kpi.ghost import ghost, ghost_partners
from lidarcheck.kpi.walk import walk_offset
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor
from places import shared_path

BEAMS = Sensor.of("SLIM").beams


class TestWalk:
    def test_by_hand(self):
        w = walk_offset([0.0, 0.1, 0.3, -0.4], [10, 50, 99.9, 1000], [0.0, -0.2, 0.5], [20, 2000, 100])
        np.testing.assert_array_equal(w.decade, [1, 2, 3])
        np.testing.assert_allclose(w.offset_m, [0.1, np.nan, -0.2])
        np.testing.assert_array_equal(w.n_measured, [3, 0, 1])
        np.testing.assert_array_equal(w.n_simulated, [1, 1, 1])
        assert w.worst_m == pytest.approx(-0.2)

    def test_recovers_a_walk_error_beyond_that_of_the_model(self):
        g = np.random.default_rng(0)
        area = 10 ** g.uniform(1, 4, 60_000)
        pile_up = -0.1 * np.log10(area)
        extra = np.where(area < 100, 0.0, np.where(area < 1000, 0.02, -0.05))
        m = pile_up + extra + g.normal(0, 0.05, area.size)
        w = walk_offset(m, area, pile_up + g.normal(0, 0.05, area.size), area)
        np.testing.assert_allclose(w.offset_m, [0.0, 0.02, -0.05], atol=0.005)

    def test_empty_and_unusable(self):
        w = walk_offset([], [], [], [])
        assert w.decade.size == 0
        assert math.isnan(w.worst_m)
        w = walk_offset([np.nan, 1.0, 1.0], [10, 0, -3], [0.5], [10])
        assert math.isnan(w.offset_m[0])
        assert w.n_measured[0] == 0
        with pytest.raises(UsageError, match="2 residuals and 1 areas"):
            walk_offset([1.0, 2.0], [1.0], [], [])


class TestBlooming:
    def test_by_hand(self):
        p = blooming_profile([0, 0, 3, 6], [100, 300, 20, 5], [0, 3, 9], [20, 20, 1])
        np.testing.assert_array_equal(p.offset, [0, 3, 6, 9])
        np.testing.assert_allclose(p.measured_area, [200, 20, 5, np.nan])
        assert p.rms_log10 == pytest.approx(math.sqrt((1.0**2 + 0.0) / 2))
        assert (p.measured_only, p.simulated_only) == (1, 1)

    def test_bins_are_half_open(self):
        p = blooming_profile([-1, 0, 4.9, 5, 10], [1, 10, 10, 100, 1], [2, 7], [10, 10], edges=[0, 5, 10])
        np.testing.assert_array_equal(p.n_measured, [2, 1])
        assert p.rms_log10 == pytest.approx(math.sqrt(0.5))

    def test_nothing_in_common(self):
        assert math.isnan(blooming_profile([], [], [], []).rms_log10)
        assert math.isnan(blooming_profile([0], [1], [1], [1]).rms_log10)
        assert math.isnan(blooming_profile([0], [0], [0], [1]).rms_log10)
        with pytest.raises(UsageError, match="1 offsets and 2 areas"):
            blooming_profile([0], [1, 2], [], [])

    def test_measured_sign(self):
        with shared_path("data/sign_blooming/vertical_157m.csv").open() as file:
            rows = list(csv.DictReader(file))
        offset = [float(row["offset_spad_rows"]) for row in rows]
        area = np.array([float(row["AREA"]) for row in rows])
        assert blooming_profile(offset, area, offset, area).rms_log10 == 0.0
        assert blooming_profile(offset, area, offset, area / 2).rms_log10 == pytest.approx(math.log10(2))

    def test_offset_by_hand(self):
        layer = np.array([10, 12, 9, 10, 30, 11], dtype=np.int32)
        point = np.array([5, 5, 5, 6, 5, 7], dtype=np.int32)
        t_layer, t_point = np.array([20, 10, 11], dtype=np.int32), np.array([5, 5, 8], dtype=np.int32)
        up, which = target_offset(layer, point, t_layer, t_point, "vertical", BEAMS)
        np.testing.assert_array_equal(up, [0, 2, -1, np.nan, 10, np.nan])
        np.testing.assert_array_equal(which, [1, 1, 1, -1, 0, -1])
        left, which = target_offset(layer, point, t_layer, t_point, "horizontal", BEAMS)
        np.testing.assert_array_equal(left, [0, np.nan, np.nan, 1, np.nan, -1])
        np.testing.assert_array_equal(which, [1, -1, -1, 1, -1, 2])

    def test_offset_without_target(self):
        none = np.zeros(0, dtype=np.int32)
        offset, which = target_offset(
            np.array([1], dtype=np.int32), np.array([1], dtype=np.int32), none, none, "vertical", BEAMS
        )
        assert np.isnan(offset[0])
        assert which[0] == -1


def sign(range_m, layers=20, points=8):
    layer, point = (x.ravel().astype(np.int32) for x in np.meshgrid(np.arange(layers) + 270, np.arange(points) + 390))
    return layer, point, np.full(layer.size, range_m)


class TestGhost:
    def test_twice_the_range_is_twice_the_size(self):
        layer, point, range_m = sign(44.2)
        both = Scan.from_beams(
            np.tile(layer, 2),
            np.tile(point, 2),
            np.concatenate([range_m, 2 * range_m + 0.2]),
            area=np.repeat([5000.0, 200.0], layer.size),
            peak=np.repeat([236.0, 30.0], layer.size),
        )
        target = both.area > 1000
        found = ghost_partners(both, target) >= 0
        np.testing.assert_array_equal(found, ~target)
        xyz = np.stack([both.x_m, both.y_m, both.z_m], axis=-1)
        g = ghost(xyz[target], both.area[target], both.peak[target], xyz[found], both.area[found], both.peak[found])
        assert g.count_ratio == 1.0
        assert g.area_ratio == pytest.approx(0.04)
        assert g.peak_ratio == pytest.approx(30 / 236)
        assert g.range_ratio == pytest.approx(2 + 0.2 / 44.2)
        assert g.size_ratio == pytest.approx(g.range_ratio)

    def test_only_on_the_targets_beams_and_at_twice_the_range(self):
        scan = Scan.from_beams(
            np.array([1, 1, 1, 2, 1], dtype=np.int32),
            np.ones(5, dtype=np.int32),
            np.array([10.0, 20.4, 20.6, 20.0, 19.5]),
        )
        target = np.array([True, False, False, False, False])
        np.testing.assert_array_equal(ghost_partners(scan, target), [-1, 0, -1, -1, 0])

    def test_two_target_echoes_on_a_beam(self):
        scan = Scan.from_beams(
            np.ones(4, dtype=np.int32), np.ones(4, dtype=np.int32), np.array([10.0, 30.0, 20.0, 60.0])
        )
        target = np.array([True, True, False, False])
        np.testing.assert_array_equal(ghost_partners(scan, target), [-1, -1, 0, 1])

    def test_nothing(self):
        none = ghost([], [], [], [], [], [])
        assert none.targets == none.ghosts == 0
        assert math.isnan(none.count_ratio)
        no_ghost = ghost([[10.0, 0.0, 0.0]], [5.0], [5.0], [], [], [])
        assert no_ghost.count_ratio == 0.0
        assert math.isnan(no_ghost.range_ratio)
        one = ghost([[10.0, 0.0, 0.0]], [5.0], [5.0], [[20.0, 0.0, 0.0]], [1.0], [2.0])
        assert one.range_ratio == 2.0
        assert math.isnan(one.size_ratio)
        with pytest.raises(UsageError, match="shape"):
            ghost([1.0, 2.0], [1.0], [1.0], [], [], [])
        scan = Scan.from_beams(np.ones(1, dtype=np.int32), np.ones(1, dtype=np.int32), np.array([3.0]))
        assert ghost_partners(scan, np.array([False]))[0] == -1

    @pytest.mark.parametrize(
        ("name", "range_m", "area", "peak"),
        [("1_25m", 25.6, (706, 841), (83, 96)), ("2_45m", 44.2, (142, 268), (20, 40))],
    )
    def test_printed_rows_of_a_sign(self, name, range_m, area, peak):
        from lidarcheck.formats import load_scan

        scan = load_scan(shared_path(f"samples/{name}.txt"))
        target = scan.peak == 236
        partner = ghost_partners(scan, target)
        found = partner >= 0
        np.testing.assert_array_equal(found, ~target)
        xyz = np.stack([scan.x_m, scan.y_m, scan.z_m], axis=-1)
        rows = np.flatnonzero(target)
        g = ghost(
            *(xyz[rows], scan.area[rows], scan.peak[rows]),
            *(xyz[found], scan.area[found], scan.peak[found]),
            partner=np.searchsorted(rows, partner[found]),
        )
        assert np.median(scan.range_m[target]) == pytest.approx(range_m, abs=0.15)
        assert g.count_ratio == found.sum() / target.sum()
        assert 2 + 0.15 / 45 < g.range_ratio < 2 + 0.33 / 25
        assert area[0] / 6741 < g.area_ratio < area[1] / 4850
        assert peak[0] / 236 <= g.peak_ratio <= peak[1] / 236

    def test_no_ghost_indoors(self):
        from lidarcheck.formats import load_scan

        scan = load_scan(shared_path("data/hesai_xt32/rotation_0.parquet"))
        bright = np.asarray(scan.extra["INTENSITY"]) > 100
        assert bright.sum() > 100
        # The few echoes that stand there by chance are walls: no peak at twice the range against beside it.
        share = (ghost_partners(scan, bright) >= 0).sum() / bright.sum()
        assert share < 0.01
