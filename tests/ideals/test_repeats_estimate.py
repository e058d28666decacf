"""The estimate from repeats against the truth that the repeats were simulated from, its errors against its misses."""

import numpy as np
import pytest

from lidarcheck.ideals.repeats.errors import distance_error_m
from lidarcheck.ideals.repeats.response import response_of
from lidarcheck.ideals.repeats.split import parts_of
from lidarcheck.ideals.repeats.workflow import repeats_of
from repeats_kit import TRUE, certain, counting, frames, names, of_true, room, shipped, signal_of

EVERY = frozenset(TRUE) | {"signal_at_1m", "near_m"}


def estimates(sensor, truth, count, whole=False):
    scans = frames(sensor, truth, count)
    stated = EVERY if sensor.detector == "linear" else frozenset()
    return scans, repeats_of(names(count), scans, sensor, stated, whole=whole)


@pytest.fixture(scope="module")
def photons():
    """Nine frames of a sensor that counts photons, with all its laws known."""
    sensor = counting(**TRUE)
    truth = room(sensor)
    return sensor, truth, *estimates(sensor, truth, 9)


@pytest.mark.parametrize("count", [2, 3, 5, 9, 30])
def test_errors_match_the_misses_and_nothing_is_biased(count):
    sensor = counting(**TRUE)
    truth = room(sensor, layers=24, points=200)
    _, found = estimates(sensor, truth, count, whole=count == 2)
    ideal = (found.whole or found.ideals[0]).ideal
    rows = certain(ideal)
    off = (ideal.distance_m[rows] - of_true(ideal, truth, "distance_m", rows)) / ideal.extra["DistanceError"][rows]
    signal, error = signal_of(sensor, ideal, rows)
    of_signal = (signal - of_true(ideal, truth, "signal", rows)) / error
    assert len(off) > 3000
    for z in (off, of_signal):
        assert abs(z.mean()) < 0.1  # errors follow the estimate: lower ones have smaller errors
        assert z.std() == pytest.approx(1.0, abs=0.05)


def test_weak_rays_are_judged_by_their_losses_too(photons):
    sensor, truth, _, found = photons
    ideal = found.ideals[0].ideal
    rows = certain(ideal)
    signal, error = signal_of(sensor, ideal, rows)
    true = of_true(ideal, truth, "signal", rows)
    margin = response_of(sensor, sensor.features[0]).margin(true)
    weak = (margin > 0.5) & (margin < 2.5)
    off = ((signal - true) / error)[weak]
    assert weak.sum() > 300
    assert abs(off.mean()) < 0.15
    assert off.std() == pytest.approx(1.0, abs=0.12)
    # By the echoes alone the same rays would seem stronger: what lies below the threshold is not among them.
    plain = signal_of(sensor, ideal, rows)[0][weak].mean()
    assert plain == pytest.approx(true[weak].mean(), rel=0.02)


def test_residuals_scatter_as_law_and_error_say(photons):
    sensor, truth, scans, found = photons
    law = response_of(sensor, sensor.features[0])
    seen = foretold = 0.0
    for one in found.ideals:
        place, error = (np.full(truth.distance_m.shape, np.nan) for _ in range(2))
        rows = certain(one.ideal)
        at = one.ideal.layer[rows], one.ideal.point[rows]
        place[at], error[at] = one.ideal.distance_m[rows], one.ideal.extra["DistanceError"][rows]
        scan = scans[one.frame]
        at = scan.layer, scan.point
        off = scan.range_m - place[at]
        own = np.abs(off) < 1.0
        sigma = law.range_sd_m(truth.signal[at], truth.distance_m[at])
        seen += float((off[own] ** 2).sum())
        foretold += float((sigma**2 + error[at] ** 2 + sensor.range_resolution_m**2 / 12.0)[own].sum())
    assert seen / foretold == pytest.approx(1.0, abs=0.03)


def test_each_frame_is_left_out_of_its_own_estimate(photons):
    *_, found = photons
    assert [one.part for one in found.ideals] == ["fit"] * 5 + ["select"] * 2 + ["verify"] * 2
    assert [one.counts.repeats for one in found.ideals] == [6] * 7 + [7] * 2
    first, second = found.ideals[7:]
    assert second.shared == 7
    assert np.array_equal(first.ideal.distance_m, second.ideal.distance_m, equal_nan=True)
    assert not np.array_equal(found.ideals[0].ideal.distance_m, found.ideals[1].ideal.distance_m, equal_nan=True)


def test_the_incidence_follows_from_neighbours(photons):
    _, truth, _, found = photons
    ideal = found.ideals[0].ideal
    rows = certain(ideal)
    off = ideal.incidence_deg[rows] - of_true(ideal, truth, "incidence_deg", rows)
    assert np.median(np.abs(off)) < 1.0


def test_rays_never_seen_meet_nothing_after_nine_repeats():
    sensor = counting(**{**TRUE, "threshold": 60.0})
    truth = room(sensor, layers=32, points=100)
    _, few = estimates(sensor, truth, 3)
    _, many = estimates(sensor, truth, 12)
    assert few.ideals[0].counts.free == 0
    assert few.ideals[0].counts.unknown > 100
    assert many.ideals[0].counts.repeats == 8
    assert many.ideals[-1].counts.free > 100
    ideal = many.ideals[-1].ideal
    assert np.count_nonzero(ideal.distance_m == 0.0) == many.ideals[-1].counts.free


def test_columns_that_do_not_repeat_are_matched_by_direction():
    sensor = shipped("HDL-32E")
    truth = [room(sensor, points=400, frame=k) for k in range(4)]
    scans = frames(sensor, truth, 4)
    found = repeats_of(names(4), scans, sensor, frozenset(type(sensor).numbers()))
    for one in found.ideals:
        rows = certain(one.ideal)
        off = one.ideal.distance_m[rows] - of_true(one.ideal, truth[one.frame], "distance_m", rows)
        z = off / one.ideal.extra["DistanceError"][rows]
        assert rows.sum() > 8000
        assert abs(z.mean()) < 0.05
        assert z.std() == pytest.approx(1.0, abs=0.06)
        assert one.ideal.extra["Azimuth0"][0] == pytest.approx(scans[one.frame].beams.first_azimuth_deg, abs=1e-6)


def test_pile_up_of_spads_is_taken_off_the_distance():
    sensor = shipped("SLIM")
    truth = room(sensor, layers=40, points=100)
    _, found = estimates(sensor, truth, 5)
    ideal = found.ideals[0].ideal
    rows = certain(ideal) & (of_true(ideal, truth, "signal", slice(None)) < 5.0)
    off = (ideal.distance_m - of_true(ideal, truth, "distance_m", slice(None)))[rows]
    z = off / ideal.extra["DistanceError"][rows]
    law = response_of(sensor, sensor.feature("AREA"))
    assert np.abs(law.shift_m(of_true(ideal, truth, "signal", rows))).mean() > 0.1
    assert abs(off.mean()) < 0.005
    assert z.std() == pytest.approx(1.0, abs=0.1)


def test_the_counts_under_an_echo_stand_for_a_chips_amplitude():
    from lidarcheck.model import Model, simulate
    from lidarcheck.scan import IdealScan
    from lidarcheck.sensor import Material

    sensor = shipped("TMF8820-short")
    layer, point = sensor.beams.every()
    away = np.full(9, 0.3)
    truth = IdealScan(layer, point, away, np.ones(9, dtype=int), np.zeros(9), beams=sensor.beams)
    scans = [simulate(truth, Model(sensor, {1: Material("a", 0.5)}), frame=k) for k in range(12)]
    found = repeats_of(names(12), scans, sensor, frozenset(type(sensor).numbers()))
    ideal = found.ideals[0].ideal
    assert found.feature == "HISTOGRAM"
    np.testing.assert_allclose(ideal.distance_m, 0.3, atol=0.0015)
    reflectance = ideal.extra["Reflectance"] * np.cos(np.deg2rad(ideal.incidence_deg))
    np.testing.assert_allclose(reflectance, 0.5, rtol=0.03)


@pytest.mark.parametrize(("sigma_m", "step_m", "hits"), [(0.01, 0.004, 3), (0.002, 0.01, 5), (0.03, 0.0, 2)])
def test_the_error_of_a_median_is_that_of_draws(sigma_m, step_m, hits):
    rng = np.random.default_rng(5)
    true = rng.random((40_000, 1)) * 10.0
    ranges = true + sigma_m * rng.standard_normal((40_000, hits))
    if step_m > 0.0:
        ranges = np.rint(ranges / step_m) * step_m + step_m * (rng.random(ranges.shape) - 0.5)
    drawn = np.sqrt(np.mean((np.median(ranges, axis=1) - true[:, 0]) ** 2))
    stated = distance_error_m(np.array([sigma_m]), np.array([hits]), step_m)[0]
    assert stated == pytest.approx(drawn, rel=0.04)


@pytest.mark.parametrize(
    ("count", "parts", "estimating"),
    [(2, (2, 0, 0), 2), (3, (1, 1, 1), 3), (4, (2, 1, 1), 3), (9, (5, 2, 2), 7), (30, (16, 7, 7), 23)],
)
def test_frames_are_split_in_time(count, parts, estimating):
    found = parts_of(count)
    assert tuple(found.names.count(part) for part in ("fit", "select", "verify")) == parts
    assert list(found.names) == sorted(found.names, key=["fit", "select", "verify"].index)
    assert len(found.estimating) == estimating
    assert all(frame not in found.others(frame) for frame in range(count))


def test_what_a_classifier_is_told_of_a_ray_is_what_stands_beside_it():
    """On a level floor a whole layer has one distance: in a ray's own, the error of its estimate could be read off."""
    from types import SimpleNamespace

    from lidarcheck.inference.classifier import _known

    row, column = (a.ravel() for a in np.mgrid[:4, :5])
    columns = {name: np.full(20, value) for name, value in (("distance_m", 8.0), ("signal", 30.0))}
    told = []
    for off in (0.0, 0.02):
        own = {name: np.where((row == 2) & (column == 2), (1.0 + off) * one, one) for name, one in columns.items()}
        beams = SimpleNamespace(
            frame=np.zeros(20, dtype=int), layer=row, point=column, incidence_deg=np.zeros(20), material_id=row, **own
        )
        told.append(_known(beams, (row, column), repeated=True))
    middle = (row == 2) & (column == 2)
    assert np.array_equal(told[0][middle], told[1][middle])
    assert not np.array_equal(told[0], told[1])
    assert told[0][0, :2] == pytest.approx([8.0, np.log1p(30.0)])
