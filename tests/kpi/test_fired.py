import numpy as np
import pytest

from lidarcheck.beams import Fired
from lidarcheck.kpi.compare import compare
from lidarcheck.kpi.detection import detection_probability, false_alarms
from lidarcheck.kpi.fired import fired_beams, judged_beams
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.scan import IdealScan, Scan

LAYER, POINT = (a.ravel() for a in np.mgrid[100:104, 200:205])


def ideal(distance_m=20.0):
    n = len(LAYER)
    return IdealScan(LAYER, POINT, np.broadcast_to(distance_m, n), np.ones(n, int), np.zeros(n))


def scan(mask, *, fired=None, defaulted=()):
    made = Scan.from_beams(LAYER[mask], POINT[mask], np.full(int(np.sum(mask)), 20.0))
    return Scan(**{**vars(made), "fired": fired, "defaulted": (*made.defaulted, *defaulted)})


SEEN = np.arange(20) < 12


class TestWhoKnows:
    def test_the_scan_itself_first(self):
        own = Fired(LAYER[POINT != 203], POINT[POINT != 203])
        assert fired_beams(scan(SEEN, fired=own), ideal()) is own

    def test_then_the_ideal_scan(self):
        fired = fired_beams(scan(SEEN), ideal())
        assert fired.source == "ideal"
        np.testing.assert_array_equal(fired.layer, LAYER)
        np.testing.assert_array_equal(fired.point, POINT)

    def test_then_the_sensors_grid_within_what_the_file_shows(self):
        fired = fired_beams(scan(SEEN))
        assert fired.source == "sensor"
        assert sorted(zip(fired.layer, fired.point, strict=True)) == sorted(zip(LAYER[:15], POINT[:15], strict=True))

    @pytest.mark.parametrize("defaulted", ["Layer", "Point"])
    def test_else_nobody(self, defaulted):
        assert fired_beams(scan(SEEN, defaulted=(defaulted,))) is None
        assert fired_beams(scan(SEEN & False)) is None

    def test_beams_of_another_sensor_are_on_no_grid(self):
        other = Scan.from_beams(np.array([3]), np.array([960]), np.array([5.0]))
        assert fired_beams(other) is None

    def test_a_file_that_leaves_out_a_layer_or_a_beam_does_not_know(self):
        for left_out in (LAYER == 102, (LAYER == 102) & (POINT == 202)):
            own = Fired(LAYER[~left_out], POINT[~left_out])
            fired = fired_beams(scan(SEEN & ~left_out, fired=own), ideal())
            assert (fired.source, len(fired)) == ("ideal", 20)

    def test_lost_columns_and_one_that_is_cut_off_were_not_fired(self):
        lost = (POINT == 202) | ((POINT == 204) & (LAYER > 101))
        own = Fired(LAYER[~lost], POINT[~lost])
        assert fired_beams(scan(SEEN & ~lost, fired=own), ideal()) is own


class TestDetection:
    def test_beams_that_were_not_fired_are_not_missed(self):
        fired = Fired(LAYER[POINT != 203], POINT[POINT != 203])
        found = compare(scan(SEEN, fired=fired), scan(SEEN), ideal())
        assert found.surfaces.detection_measured.overall == 10 / 16
        assert found.surfaces.detection_simulated.overall == 12 / 20

    def test_a_beam_of_which_nobody_knows_what_it_meets_is_left_out(self):
        distance = np.full(20, 20.0)
        distance[[0, 19]] = np.nan
        distance[1] = 50.0
        paired = pair_with_ideal(ideal(distance), scan(SEEN))
        judged = paired.judged
        assert detection_probability(paired.distance_m[judged], paired.detected[judged]).overall == 10 / 18
        assert false_alarms(paired).echoes == 1
        assert false_alarms(paired).beams == 18

    def test_a_partly_known_beam_is_left_out_too(self):
        rows = IdealScan([5, 5], [7, 7], [10.0, np.nan], [1, 1], [0.0, 0.0])
        paired = pair_with_ideal(rows, Scan.from_beams([5], [7], [33.0]))
        assert not paired.judged.any()
        assert false_alarms(paired).echoes == 0


def test_picking_echoes_keeps_the_fired_beams():
    fired = Fired(LAYER, POINT, np.repeat([0, 1], 10))
    picked = scan(SEEN, fired=fired).take(np.array([0, 3]))
    assert len(picked) == 2
    assert picked.fired is fired
    assert len(fired.of_frame(1)) == 10
    assert fired.of_frame(1).frame is None
    np.testing.assert_array_equal(fired.of_frame(1).has(LAYER, POINT), np.arange(20) >= 10)


class TestJudged:
    def test_beams_that_say_nothing_are_left_out_of_both(self):
        distance = np.full(20, 20.0)
        distance[3] = np.nan
        rows, echoes = judged_beams(ideal(distance), scan(SEEN, fired=Fired(LAYER[POINT != 204], POINT[POINT != 204])))
        assert len(rows) == 15
        assert len(echoes) == 9

    def test_where_all_count_nothing_changes(self):
        rows, echoes = ideal(), scan(SEEN)
        assert judged_beams(rows, echoes) == (rows, echoes)
