import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from lidarcheck.errors import UsageError
from lidarcheck.formats import load_scan, save_scan
from lidarcheck.kpi.compare import compare, feature_gap
from lidarcheck.kpi.direction import off_surface, surface_points
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.kpi.percentiles import percentile
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor, shipped
from places import shared_path

MODEL = Model(Sensor.of("SMART"), {1: Material("wall", 0.5), 2: Material("sign", 0.6, kind="retro", retro_gain=900.0)})


def street(layers=30, points=40):
    """A wall at 60 m, in its middle a sign at 25 m, and sky above."""
    layer, point = (
        x.ravel().astype(np.int32) for x in np.meshgrid(np.arange(layers), np.arange(points), indexing="ij")
    )
    on_sign = (abs(layer - 15) < 3) & (abs(point - 20) < 4)
    distance = np.where(on_sign, 25.0, np.where(layer > 25, 0.0, 60.0))
    return IdealScan(layer, point, distance, np.where(on_sign, 2, 1), np.zeros(layer.size))


def echoes(ideal, seed=0, *, shift_m=0.0, gain=1.0, ghost_area=0.0, bloom_area=0.0):
    g = np.random.default_rng(seed)
    rows = np.flatnonzero((ideal.distance_m > 0) & (g.random(len(ideal)) < 0.9))
    sign = ideal.material_id[rows] == 2
    area = np.where(sign, 2000, 300) * gain * g.uniform(0.9, 1.1, rows.size)
    parts = [(rows, ideal.distance_m[rows] + shift_m + g.normal(0, 0.02, rows.size), area)]
    if ghost_area:
        parts.append((rows[sign], 50.2 + np.zeros(sign.sum()), np.full(sign.sum(), ghost_area)))
    if bloom_area:
        beside = np.flatnonzero((ideal.material_id == 1) & (abs(ideal.point - 20) < 4) & (abs(ideal.layer - 15) < 6))
        parts.append((beside, np.full(beside.size, 25.0), np.full(beside.size, bloom_area)))
    row, range_m, area = (np.concatenate(x) for x in zip(*parts, strict=True))
    return Scan.from_beams(
        ideal.layer[row],
        ideal.point[row],
        range_m,
        echo_number=np.ones(row.size, dtype=np.int32),
        width_ns=np.rint(g.uniform(8, 12, row.size)),
        area=np.rint(area),
        peak=np.minimum(np.rint(area / 9), 135),
    )


def test_features_are_the_distances_of_the_columns():
    ideal = street()
    m, s = echoes(ideal, 1), echoes(ideal, 2, gain=1.1, shift_m=0.05)
    found = compare(m, s, ideal)
    assert list(found.features) == ["range_residual", "PEAK", "AREA", "WIDTH"]
    assert found.features["AREA"].wasserstein == pytest.approx(stats.wasserstein_distance(m.area, s.area))
    assert found.features["WIDTH"].energy == pytest.approx(stats.energy_distance(m.width_ns, s.width_ns))
    assert found.features["PEAK"].dvm_bias == pytest.approx(m.peak.mean() - s.peak.mean())
    residual = found.features["range_residual"]
    assert residual.dvm_bias == pytest.approx(-0.05, abs=0.005)
    assert residual.dvm_scatter < 0.005
    assert residual.n_measured == len(m)
    assert found.paired.median_m == pytest.approx(-0.05, abs=0.005)


def test_same_scan_twice_has_no_gap():
    ideal = street()
    m = echoes(ideal, 1, ghost_area=50, bloom_area=80)
    found = compare(m, m, ideal, model=MODEL)
    for gap in found.features.values():
        assert (gap.wasserstein, gap.ks, gap.energy, gap.js, gap.dvm_bias) == (0, 0, 0, 0, 0)
    assert found.overlap[:3] == (1.0, 1.0, 0.0)
    np.testing.assert_array_equal(found.surfaces.walk.offset_m, 0.0)
    assert found.target.vertical.rms_log10 == 0.0


def test_surfaces():
    ideal = street()
    s = echoes(ideal, 2)
    near_sign = (ideal.material_id == 2)[np.searchsorted(ideal.layer * 40 + ideal.point, s.layer * 40 + s.point)]
    m = s.take(~near_sign)
    found = compare(m, s, ideal).surfaces
    np.testing.assert_array_equal(found.detection_measured.beams, [35, 0, 0, 0, 1005])
    assert found.detection_measured.probability[0] == 0.0
    assert found.detection_simulated.probability[0] == near_sign.sum() / 35
    assert found.false_alarms_measured.echoes == 0


def test_target():
    ideal = street()
    m = echoes(ideal, 1, ghost_area=100, bloom_area=80)
    s = echoes(ideal, 2, ghost_area=50, bloom_area=40)
    found = compare(m, s, ideal, model=MODEL).target
    assert found.ghost_measured.count_ratio == 1.0
    assert found.ghost_measured.range_ratio == pytest.approx(2.008, abs=0.002)
    assert found.ghost_measured.size_ratio == pytest.approx(2.0, abs=0.05)
    assert found.ghost_measured.area_ratio == pytest.approx(0.05, rel=0.05)
    assert found.ghost_simulated.area_ratio == pytest.approx(0.025, rel=0.05)
    vertical = found.vertical
    np.testing.assert_array_equal(vertical.offset, [-9, -6, -3, 0, 3, 6, 9])
    # Off the sign the blooming differs by two; on it, hardly.
    assert vertical.rms_log10 == pytest.approx(math.log10(2) * math.sqrt(6 / 7), abs=0.01)
    mask = ideal.material_id == 2
    assert compare(m, s, ideal, target=mask).target.ghost_measured == found.ghost_measured
    assert compare(m, s, ideal, target=np.zeros(len(ideal), dtype=bool)).target is None
    with pytest.raises(UsageError, match="mask"):
        compare(m, s, ideal, target=[True])


def scene(rows):
    """An ideal scan of (layer, distance [m], material) on one point column, and an echo on each of its surfaces."""
    layer, distance, material = (np.array(column) for column in zip(*rows, strict=True))
    point = np.full(len(rows), 20)
    ideal = IdealScan(layer, point, distance, material, np.zeros(len(rows)))
    return ideal, Scan.from_beams(layer, point, distance, area=np.full(len(rows), 50.0), peak=np.full(len(rows), 9.0))


def test_a_surface_at_twice_the_range_is_no_ghost():
    ideal, scan = scene([(15, 25.0, 2), (15, 50.0, 1), (16, 25.0, 2)])
    found = compare(scan, scan, ideal, model=MODEL).target
    assert (found.ghost_measured.targets, found.ghost_measured.ghosts) == (2, 0)


def test_a_surface_beside_the_target_is_no_blooming():
    ideal, scan = scene([(15, 25.0, 2), (16, 25.5, 1), (17, 60.0, 1)])
    found = compare(scan, scan, ideal, model=MODEL).target
    np.testing.assert_array_equal(found.vertical.offset, [0.0])


@pytest.mark.parametrize(("off_m", "residuals"), [(-1.95, 1), (1.95, 1), (2.05, 0)])
def test_an_echo_within_two_metres_comes_from_its_surface(off_m, residuals):
    ideal, scan = scene([(15, 25.0, 1)])
    moved = Scan.from_beams(scan.layer, scan.point, scan.range_m + off_m)
    assert compare(moved, scan, ideal).features["range_residual"].n_measured == residuals


def test_without_ideal():
    ideal = street()
    found = compare(echoes(ideal, 1, shift_m=0.1), echoes(ideal, 2))
    assert found.surfaces is None
    assert found.target is None
    assert found.left_out["range_residual"] == "needs the ideal scan"
    assert found.paired.median_m == pytest.approx(0.1, abs=0.005)


def test_absent_features_are_named_and_stand_ins_taken():
    ideal = street()
    s = echoes(ideal, 1)
    bare = Scan.from_beams(s.layer, s.point, s.range_m)
    found = compare(bare, s, ideal)
    assert set(found.features) == {"range_residual"}
    assert found.left_out["AREA"] == "not in the measured scan"
    assert found.left_out["walk_offset"] == "needs AREA in both scans"
    assert compare(bare, bare).left_out["PEAK"] == "not in the measured nor in the simulated scan"
    columns = (
        bare.x_m,
        bare.y_m,
        bare.z_m,
        bare.layer,
        bare.point,
        bare.echo_number,
        bare.width_ns,
        bare.area,
        bare.peak,
    )
    lit = Scan(*columns, extra={"Intensity": s.area}, defaulted=bare.defaulted)
    assert compare(lit, lit).features["INTENSITY"].n_measured == len(s)
    assert compare(lit, bare).left_out["INTENSITY"] == "not in the simulated scan"


def test_the_first_beam_that_is_not_in_the_ideal_scan_is_named():
    ideal = street()
    s = echoes(ideal, 1)
    with pytest.raises(UsageError, match=r"^error: real\.txt: the measured scan has an echo on Layer 0, Point 0,"):
        compare(
            s.take(np.lexsort((s.point, s.layer))),
            s,
            ideal.take(np.flatnonzero(ideal.layer > 0)),
            files={"measured": "real.txt"},
        )


def test_empty_scans():
    ideal = street()
    s = echoes(ideal, 1)
    none = s.take(np.zeros(0, dtype=int))
    for m, other in ((none, s), (s, none), (none, none)):
        for scene in (None, ideal):
            found = compare(m, other, scene, model=MODEL)
            assert math.isnan(found.features["AREA"].wasserstein)
            json.dumps(found.to_dict(), allow_nan=False)
            assert found.rows()
    assert compare(none, s, ideal).surfaces.detection_measured.overall == 0.0


def test_as_json_and_table():
    ideal = street()
    found = compare(echoes(ideal, 1, ghost_area=100), echoes(ideal, 2), ideal, model=MODEL)
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    for kpi in ("detection_probability", "walk_offset", "blooming_profile", "ghost", "overlap", "false_alarms"):
        assert kpi in plain
    assert set(plain["features"]["AREA"]) >= {"wasserstein", "ks", "energy", "js", "dvm_bias", "dvm_scatter", "unit"}
    assert plain["ghost"]["simulated"]["area_ratio"] is None
    kpis = {row.kpi for row in found.rows()}
    assert kpis >= {
        "wasserstein",
        "ks",
        "energy",
        "js",
        "dvm_bias",
        "dvm_scatter",
        "detection_probability",
        "walk_offset",
    }
    assert kpis >= {"blooming_profile", "ghost", "overlap", "chamfer", "false_alarms"}


def test_directions_places_and_numbers_are_those_that_were_written():
    ideal = street()
    m, s = echoes(ideal, 1), echoes(ideal, 2)
    raised = replace(m, z_m=m.z_m + np.deg2rad(0.05) * m.range_m, extra={"EchoNumberRaw": m.echo_number - 1})
    found = compare(raised, s, ideal)
    up, left = found.direction["elevation"], found.direction["azimuth"]
    assert (up.bias_measured, up.bias_simulated) == pytest.approx((0.05, 0.0), abs=0.004)
    assert up.scatter_simulated == left.scatter_simulated == left.bias_measured == 0.0
    assert found.position["z"].measured - found.position["z"].simulated == pytest.approx(
        np.deg2rad(0.05) * m.range_m.mean(), abs=0.003
    )
    assert {number: tuple(part) for number, part in found.numbers.items()} == {0: (1.0, 0.0), 1: (0.0, 1.0)}
    rows = {(row.kpi, row.of): row for row in found.rows()}
    assert rows["direction_bias", "elevation"].value == up.bias_measured - up.bias_simulated
    assert rows["echo_number_share", "0"].value == 1.0
    assert rows["percentile_95", "AREA"].measured == percentile(m.area, 95)
    plain = found.to_dict()
    low, high = (plain["features"]["AREA"]["percentiles"]["50"]["measured"][end] for end in ("low", "high"))
    assert low < rows["percentile_50", "AREA"].measured < high
    assert plain["position_bias"]["z"]["measured"] == found.position["z"].measured
    # Surface points of the ideal scan's own take the place of the beams'.
    place = off_surface(m, np.arange(len(m)), ideal, pair_with_ideal(ideal, m).surface)
    own = dict(zip("XYZ", surface_points(ideal).T + 1.0, strict=True))
    moved = compare(m, s, replace(ideal, extra=own))
    assert moved.position["x"].measured == pytest.approx(place[:, 0].mean() - 1.0)


def test_what_a_scan_does_not_say_is_left_out():
    ideal = street()
    m, s = echoes(ideal, 1), echoes(ideal, 2)
    found = compare(
        replace(m, defaulted=("Layer", "Point", "EchoNumber")), replace(s, defaulted=("EchoNumber",)), ideal
    )
    assert found.direction is found.numbers is None
    assert found.left_out["direction_bias, direction_scatter"] == "the measured scan's beams are found by X, Y, Z"
    assert "measured and the simulated" in found.left_out["echo_number_share"]
    assert found.position is not None
    assert compare(m, s).position is None
    nothing = m.take(np.zeros(len(m), dtype=bool))
    empty = compare(nothing, nothing, ideal)
    assert empty.numbers == {}
    assert math.isnan(empty.direction["azimuth"].bias_measured)


def test_feature_gap_of_single_values():
    gap = feature_gap([3.0], [1.0])
    assert (gap.wasserstein, gap.ks, gap.js, gap.dvm_bias, gap.dvm_scatter) == (2.0, 1.0, 1.0, 2.0, 0.0)


def test_half_a_million_echoes_a_side():
    layer, point = np.repeat(np.arange(520, dtype=np.int32), 960), np.tile(np.arange(960, dtype=np.int32), 520)
    g = np.random.default_rng(0)
    distance = 10.0 + 0.1 * point + 0.02 * layer
    ideal = IdealScan(layer, point, distance, np.ones(layer.size, dtype=int), np.zeros(layer.size))
    m, s = (
        Scan.from_beams(
            layer,
            point,
            np.round(distance + g.normal(0, 0.05, layer.size), 2),
            echo_number=np.ones(layer.size, dtype=np.int32),
            area=g.poisson(700, layer.size),
            peak=g.poisson(80, layer.size),
            width_ns=g.poisson(11, layer.size),
        )
        for _ in range(2)
    )
    found = compare(m, s, ideal)
    assert found.features["AREA"].ks < 0.005


@pytest.mark.parametrize("frame", ["SMART_lab", "SMART_street", "SLIM_sign"])
def test_reference_frames_against_themselves(frame):
    from lidarcheck.formats import load_ideal, load_scan

    ideal = load_ideal(shared_path(f"data/reference_frames/{frame}_ideal.txt"))
    scan = load_scan(shared_path(f"data/reference_frames/{frame}_echoes.txt"))
    found = compare(scan, scan, ideal)
    assert all(gap.wasserstein == gap.js == 0.0 for gap in found.features.values())
    assert found.overlap[:3] == (1.0, 1.0, 0.0)
    # Every echo but the background's comes from a surface; the sensor's own pile-up shifts it by up to 1.1 m.
    assert found.features["range_residual"].n_measured > 0.998 * len(scan)


def test_without_a_sensor_s_name_the_directions_of_its_beams_are_left_out(tmp_path):
    """A turning head's columns are none of the built-in grid's: what its beams should be, nobody has said."""
    sensor = shipped("XT32")
    layer, point = (column[sensor.beams.every()[1] % 5 == 0] for column in sensor.beams.every())
    scan = Scan.from_beams(layer, point, np.linspace(5.0, 60.0, len(layer)), beams=sensor.beams)
    save_scan(scan, tmp_path / "head.parquet")
    strange, known = load_scan(tmp_path / "head.parquet"), load_scan(tmp_path / "head.parquet", sensor=sensor)
    found = compare(strange, strange, None)
    assert "name it with --sensor" in found.left_out["direction_bias, direction_scatter"]
    assert "direction_bias, direction_scatter" not in compare(known, known, None).left_out
