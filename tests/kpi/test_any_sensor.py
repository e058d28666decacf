"""KPIs of sensors that are no grid: a turning head with origins and range offsets, and beams that a table lists."""

from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.kpi.blooming import offset_step, target_offset
from lidarcheck.kpi.chance.tallies import blocks_of
from lidarcheck.kpi.chance.verdict import ChanceTest
from lidarcheck.kpi.classifier import folds_of
from lidarcheck.kpi.compare import compare
from lidarcheck.kpi.direction import off_beam, surface_points
from lidarcheck.kpi.features import Decades, decades_of, features_apart, strength_name
from lidarcheck.kpi.fired import fired_beams
from lidarcheck.kpi.lattice import PIECES, lattice_of, piece_of
from lidarcheck.kpi.numbering import beams_in_order, with_copies
from lidarcheck.kpi.pairing import of_surface_m, pair_with_ideal, paths, surface_window_m
from lidarcheck.kpi.variant import OneVariant, variant_of
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor, sensor_of

COLUMNS = 180
HEAD = {
    "name": "head",
    "detector": "linear",
    "frame_rate_hz": 10,
    "returns": 2,
    "keep": "strongest_last",
    "sweep": {"direction": "right"},
    "range": {"min_m": 0.5, "max_m": 120, "step_m": 0.004},
    "linear": {"signal_at_1m": 461000, "pulse_fwhm_ns": 5, "range_floor_m": 0.01},
    "features": {
        "GLOW": {"law": "affine", "unit": "adu", "aliases": ["shine"]},
        "DARK": {"law": "background"},
    },
    "beams": {
        "kind": "channels",
        "elevation_deg": [8.0, 4.0, -1.0, -7.0],
        "azimuth_offset_deg": [2.0, -2.0, 2.0, -2.0],
        "origin_m": [0.1, 0.1, 0.2, 0.2],
        "side_m": [0.02, -0.02, 0.02, -0.02],
        "height_m": 0.05,
        "range_offset_m": [0.3, 0.1, 0.3, 0.1],
        "fire_time_us": [0.0, 100.0, 200.0, 300.0],
        "column_shift": [1, -1, 1, -1],
        "columns": COLUMNS,
        "azimuth_deg": {"first": 90, "last": -270},
    },
}
SENSOR = sensor_of(HEAD)
LAYER, POINT = SENSOR.beams.every()
DISTANCE = 10.0 + 0.1 * (POINT % 37) + LAYER


def table_of(*, from_scan: bool = False) -> Sensor:
    """Three lines of unlike lengths, in no order of angles, each beam with its time and its origin."""
    rng = np.random.default_rng(5)
    layer = np.repeat(np.arange(3), (60, 40, 80))
    point = np.concatenate([np.arange(n) for n in (60, 40, 80)])
    n = len(layer)
    columns = {
        "Layer": layer,
        "Point": point,
        "elevation_deg": rng.uniform(-20, 20, n),
        "azimuth_deg": rng.uniform(-60, 60, n),
        "time_s": np.arange(n) * 1e-3,
        "origin_x_m": np.full(n, 0.1),
        "origin_z_m": np.linspace(-0.05, 0.05, n),
    }
    beams = {"kind": "table", "file": "beams.csv", **({"direction": "from_scan"} if from_scan else {})}
    return sensor_of({**HEAD, "sweep": {"order": "table"}, "beams": beams}, columns=lambda _: columns)


def ideal_of(sensor: Sensor, distance_m: np.ndarray, **more: object) -> IdealScan:
    layer, point = sensor.beams.every()
    n = len(layer)
    return IdealScan(layer, point, distance_m, np.ones(n), np.zeros(n), beams=sensor.beams, **more)


def scan_of(sensor: Sensor, range_m: np.ndarray, glow: np.ndarray | None = None, rows: object = slice(None)) -> Scan:
    layer, point = (column[rows] for column in sensor.beams.every())
    features = {} if glow is None else {"GLOW": glow}
    number = np.ones(len(layer), dtype=np.int32)
    return Scan.from_beams(layer, point, range_m, echo_number=number, features=features, beams=sensor.beams)


def reported(sensor: Sensor, distance_m: np.ndarray) -> np.ndarray:
    return distance_m + sensor.beams.range_offset_m(sensor.beams.every()[0])


@pytest.mark.parametrize("sensor", [SENSOR, table_of()], ids=["channels", "table"])
def test_a_residual_is_what_the_way_from_the_beams_origin_is_too_long(sensor: Sensor) -> None:
    n = len(sensor.beams.every()[0])
    distance = 10.0 + np.arange(n) % 7
    ideal = ideal_of(sensor, distance)
    exact = scan_of(sensor, reported(sensor, distance))
    assert paths(exact) == pytest.approx(distance, abs=1e-4)
    assert np.abs(pair_with_ideal(ideal, exact, sensor).residual_m).max() < 1e-4
    late = scan_of(sensor, reported(sensor, distance) + 0.25)
    assert pair_with_ideal(ideal, late, sensor).residual_m == pytest.approx(0.25, abs=2e-4)
    # Where beams do not begin at 0 the length of X, Y, Z is neither.
    assert np.abs(np.linalg.norm(surface_points(ideal), axis=1) - distance).max() > 0.04
    assert surface_points(ideal) == pytest.approx(sensor.beams.positions_m(*sensor.beams.every(), exact.range_m))


@pytest.mark.parametrize("sensor", [SENSOR, table_of()], ids=["channels", "table"])
def test_directions_are_seen_from_the_beams_origin(sensor: Sensor) -> None:
    layer, point = sensor.beams.every()
    exact = sensor.beams.positions_m(layer, point, reported(sensor, np.full(len(layer), 5.0)))
    for angle in off_beam(*exact.T, layer, point, sensor.beams):
        assert not angle.any()
    origins, turn = sensor.beams.origins_m(layer, point), np.deg2rad(0.4)
    x, y, z = (exact - origins).T
    turned = np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z], axis=1) + origins
    found = off_beam(*turned.T, layer, point, sensor.beams)
    assert found.azimuth_deg == pytest.approx(0.4, abs=6e-4)
    assert found.elevation_deg == pytest.approx(0.0, abs=6e-4)
    strange = off_beam(*exact[:2].T, np.array([-1, 9]), np.array([0, 0]), sensor.beams)
    assert np.isnan(strange.azimuth_deg).all()


def seen(gain: float = 1.0, seed: int = 1, shift_m: float = 0.0, sensor: Sensor = SENSOR) -> Scan:
    rng, n = np.random.default_rng(seed), len(DISTANCE)
    glow = np.rint(gain * rng.normal(400.0, 20.0, n) * 100.0 / DISTANCE**2)
    return scan_of(sensor, reported(sensor, DISTANCE) + rng.normal(shift_m, 0.01, n), glow)


def test_a_gain_of_a_feature_stands_out_and_nothing_does_without_one() -> None:
    ideal = ideal_of(SENSOR, DISTANCE)
    for gain, expected in ((1.1, {"GLOW"}), (1.0, set())):
        test = ChanceTest()
        found = compare(seen(gain), seen(seed=2), ideal, sensor=SENSOR, look=test.add)
        assert {one.of for one in test.verdict().standing_out} == expected
        assert list(found.features) == ["range_residual", "GLOW"]
        assert found.features["GLOW"].unit == "adu"
    assert found.left_out["DARK"] == "not in the measured nor in the simulated scan"
    assert "AREA" not in found.left_out
    assert found.direction is not None
    assert found.direction["azimuth"].bias_measured == 0.0
    assert found.position is not None
    assert found.surfaces.detection_measured.overall == 1.0


def test_a_features_bias_and_a_walk_are_found_by_its_name() -> None:
    ideal = ideal_of(SENSOR, DISTANCE)
    found = compare(seen(1.1), seen(), ideal, sensor=SENSOR)
    assert found.features["GLOW"].dvm_bias == pytest.approx(0.1 * found.features["GLOW"].mean_simulated, rel=0.02)
    shifted = compare(seen(shift_m=0.05), seen(), ideal, sensor=SENSOR)
    assert shifted.surfaces.walk.feature == "GLOW"
    assert shifted.surfaces.walk.of == ("GLOW 100–1000",)
    assert shifted.surfaces.walk.offset_m == pytest.approx(0.05, abs=1e-4)
    assert {row.of for row in shifted.rows() if row.kpi == "walk_offset"} == {"GLOW 100–1000"}
    assert shifted.paired.median_m == pytest.approx(0.05, abs=1e-4)


def test_what_a_reader_kept_is_a_feature_by_its_alias_and_rows_may_lack_it() -> None:
    scan = seen()
    glow = scan.features["GLOW"].copy()
    glow[:7] = np.nan
    kept = replace(scan, features={}, extra={"Shine": glow})
    test = ChanceTest()
    found = compare(kept, scan, sensor=SENSOR, look=test.add)
    assert found.features["GLOW"].n_measured == len(scan) - 7
    assert not test.verdict().standing_out


def test_differences_below_the_coarser_step_of_the_files_are_none() -> None:
    exact = np.random.default_rng(0).uniform(0.0, 1.0, len(DISTANCE))
    cents = np.round(exact, 2)
    single = exact.astype(np.float32).astype(np.float64)
    for m, s, apart in ((cents, cents + 0.0004, 0.0), (cents, cents + 0.02, -0.02), (single, exact, 0.0)):
        (one,) = features_apart(scan_of(SENSOR, DISTANCE, m), scan_of(SENSOR, DISTANCE, s), SENSOR, {})
        assert np.subtract(*one.values) == pytest.approx(apart, abs=1e-12)


def test_the_strength_is_the_sensors_and_its_decades_follow_its_law() -> None:
    assert strength_name() == strength_name(Sensor.of("SLIM")) == "AREA"
    assert strength_name(SENSOR) == "GLOW"
    assert strength_name(sensor_of({**HEAD, "strength": "DARK"})) == "DARK"
    assert strength_name(sensor_of({**HEAD, "features": {"DARK": {"law": "background"}}})) == ""
    loud = sensor_of({**HEAD, "features": {"LOUD": {"law": "log", "gain": 20.0, "offset": 3.0}}})
    decades = decades_of(loud)
    assert decades == Decades("LOUD", 3.0, 20.0)
    assert decades.of(np.array([2.9, 3.0, 42.9, 43.0])).tolist() == [-1.0, 0.0, 1.0, 2.0]
    assert decades.words(1.0) == "LOUD 23–43"


def test_windows_are_the_sensors_and_the_reach_of_a_surface_goes_with_them() -> None:
    assert surface_window_m() == surface_window_m(Sensor.of("SLIM")) == pytest.approx(0.749481, abs=1e-6)
    assert of_surface_m() == of_surface_m(Sensor.of("SLIM")) == of_surface_m(SENSOR) == 2.0
    rough = sensor_of({**HEAD, "linear": {**HEAD["linear"], "range_floor_m": 0.3}})
    assert surface_window_m(rough) == 1.5
    assert of_surface_m(rough) == pytest.approx(4.0, rel=1e-3)
    apart = sensor_of({**HEAD, "range": {**HEAD["range"], "min_separation_m": 0.4}})
    assert surface_window_m(apart, external=True) == 0.4
    assert surface_window_m(apart) == surface_window_m()


def test_fired_beams_are_the_sensors_own_within_what_a_file_has() -> None:
    some = scan_of(SENSOR, DISTANCE[::3], rows=slice(None, None, 3))
    assert len(fired_beams(some)) == len(np.unique(some.layer)) * (some.point.max() + 1)
    table = table_of()
    n = len(table.beams.every()[0])
    assert len(fired_beams(scan_of(table, np.full(n, 9.0)))) == n  # not the cells that no line has
    assert fired_beams(scan_of(table_of(from_scan=True), np.full(n, 9.0))) is None


def test_a_scans_own_directions_are_units_by_time_and_compare_no_direction() -> None:
    sensor = table_of(from_scan=True)
    layer, point = sensor.beams.every()
    n = len(layer)
    piece = piece_of(sensor.beams, layer, point, 80)
    assert np.bincount(piece, minlength=PIECES).tolist() == pytest.approx([n / PIECES] * PIECES, abs=1.5)
    assert np.all(np.diff(piece) >= 0)  # the table counts on from line to line
    assert blocks_of(sensor.beams, (np.array([-1]), np.array([-1])))[0].tolist() == [0]
    assert folds_of(np.zeros(n, dtype=int), layer, point, piece=piece) is not None
    assert lattice_of(sensor.beams) is None
    rng, test = np.random.default_rng(3), ChanceTest()
    one, other = (scan_of(sensor, rng.normal(20.0, 0.01, n), rng.normal(50.0, 5.0, n)) for _ in range(2))
    found = compare(one, other, sensor=sensor, look=test.add)
    assert found.direction is None
    assert "own directions" in found.left_out["direction_bias, direction_scatter"]
    verdict = test.verdict()
    assert (verdict.units, verdict.unit_words) == (PIECES, "pieces of the sweep")


def test_offsets_from_a_target_are_counted_upward_in_an_images_columns() -> None:
    beams = SENSOR.beams
    # Layer 0 looks highest. Columns are shifted by +1 and -1 in turn: firing column 10 of layer 0 stands in column 11.
    layer, point = np.array([0, 2, 3, 1]), np.array([10, 10, 12, 14])
    up, _ = target_offset(layer, point, np.array([1]), np.array([12]), "vertical", beams)
    assert up.tolist()[:3] == [1.0, -1.0, -2.0]
    assert np.isnan(up[3])
    left, _ = target_offset(layer, point, np.array([1]), np.array([12]), "horizontal", beams)
    assert left[3] == -2.0  # the head turns to the right
    assert [offset_step(axis, SENSOR) for axis in ("vertical", "horizontal")] == [1.0, 1.0]
    assert [offset_step(axis, Sensor.of("SMART")) for axis in ("vertical", "horizontal")] == [3.0, 2.5]


def test_numbers_follow_the_order_that_the_sensor_writes() -> None:
    beam = np.array([0, 0, 1, 1, 2, 2])
    number = np.array([1, 2, 1, 2, 1, 2])
    range_m = np.array([10.0, 20.0, 20.0, 10.0, 20.0, 10.0])
    strength = np.array([9.0, 5.0, 9.0, 5.0, 5.0, 9.0])

    def in_order(**keys: str) -> list[bool]:
        return beams_in_order(beam, number, range_m, strength, sensor_of({**HEAD, **keys})).tolist()

    assert in_order() == [True, False, False]
    kept = {"return_order": "as_kept"}
    # Where the strongest is the last itself, the second strongest stands behind it; the third beam has no such excuse.
    assert in_order(**kept) == [True, True, False]
    assert in_order(**kept, keep="strongest_second") == [True, True, False]
    assert in_order(**kept, keep="first_last") == [True, False, False]
    assert in_order(**kept, keep="last") == [False, True, True]


def test_a_repeated_copy_counts_as_number_two() -> None:
    rows, numbers = with_copies(np.array([4, 4, 7, 9]), np.array([1, 2, 1, 1]))
    assert rows.tolist() == [0, 1, 2, 3, 2, 3]
    assert numbers.tolist() == [1, 2, 1, 1, 2, 2]
    test, scan = ChanceTest(), seen()
    found = compare(scan, scan, sensor=sensor_of({**HEAD, "duplicate_return": "repeat"}), look=test.add)
    assert {number: sides.measured for number, sides in found.numbers.items()} == {1: 0.5, 2: 0.5}
    assert not test.verdict().standing_out


def test_beams_that_may_meet_two_surfaces_say_nothing_of_loss_and_spread() -> None:
    marked = (np.arange(len(DISTANCE)) < 30).astype(np.float64)
    ideal = ideal_of(SENSOR, DISTANCE, extra={"Edge": marked})
    range_m = reported(SENSOR, DISTANCE)
    range_m[:30] += np.where(np.arange(30) < 20, 1.0, 30.0)  # beside their surface, or nowhere near one
    pairing = pair_with_ideal(ideal, scan_of(SENSOR, range_m), SENSOR)
    assert not pairing.judged[:30].any()
    assert pairing.judged[30:].all()
    assert np.abs(pairing.residual_m[pairing.of_one_surface]).max() < 1e-4
    found = compare(scan_of(SENSOR, range_m), scan_of(SENSOR, reported(SENSOR, DISTANCE)), ideal, sensor=SENSOR)
    assert found.features["range_residual"].wasserstein < 1e-4
    assert found.surfaces.detection_measured.overall == 1.0
    assert found.surfaces.false_alarms_measured.echoes == 0


def test_nothing_is_said_of_a_variant_where_sensors_have_none() -> None:
    n = len(DISTANCE)
    piled = replace(scan_of(SENSOR, DISTANCE), peak=np.full(n, 135.0), defaulted=())
    assert variant_of(piled) == ""
    OneVariant(None, SENSOR).check(piled, "scan.csv")
    OneVariant().check(piled, "scan.csv")
