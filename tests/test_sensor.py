"""Beam geometry, the sensor's numbers, and the tables."""

import pickle

import numpy as np
import pytest

from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats import load_scan
from lidarcheck.model import Model, simulate
from lidarcheck.scan import IdealScan, Scan, beams_of
from lidarcheck.sensor import Material, Sensor, SpadArray
from places import shared_path
from reference_grid import LAYERS, POINTS, azimuth_deg, beam_directions, elevation_deg, layer_of, point_of


def test_the_variants_are_the_published_ones() -> None:
    smart, slim = Sensor.of("SMART"), Sensor.of("SLIM")
    assert (smart.detectors, slim.detectors) == (135, 315)
    assert (smart.peak_saturation, slim.peak_saturation) == (135, 236)
    for sensor in (smart, slim):
        assert (sensor.threshold, sensor.on_bins, sensor.dead_bins, sensor.shots) == (9, 9, 12, 5)
        assert (sensor.background_per_ns, sensor.signal_at_1m, sensor.pulse_fwhm_ns) == (0.0003, 6000.0, 5.0)
        assert sensor.bins == 2002
        assert sensor.overrides() == {}


@pytest.mark.parametrize("name", SpadArray.bounds)
def test_every_number_has_bounds_and_says_so(name: str) -> None:
    bounds = SpadArray.bounds[name]
    for value in (bounds.low - 1, bounds.high + 1, float("nan"), *([bounds.low + 0.5] if bounds.whole else [])):
        with pytest.raises(UsageError, match=f"{name} = .* is out of range; use a .*number from"):
            Sensor.of("SMART", **{name: value})


def test_dead_time_is_not_shorter_than_on_time() -> None:
    with pytest.raises(UsageError, match="dead_bins = 5 is below on_bins = 9"):
        Sensor.of("SLIM", dead_bins=5)
    with pytest.raises(UsageError, match="no sensor variant 'FAT'"):
        Sensor.of("FAT")


def test_the_grid_covers_26_by_120_degrees_around_straight_ahead() -> None:
    assert elevation_deg([0, LAYERS - 1]) == pytest.approx([-12.975, 12.975])
    assert azimuth_deg([0, POINTS - 1]) == pytest.approx([-59.9375, 59.9375])
    layer, point = np.divmod(np.arange(LAYERS * POINTS), POINTS)
    assert np.array_equal(layer_of(elevation_deg(layer)), layer)
    assert np.array_equal(point_of(azimuth_deg(point)), point)


def test_directions_are_unit_vectors_x_forward_y_left_z_up() -> None:
    rows = np.array([[259.5, 479.5], [519, 479.5], [259.5, 959]])
    ahead, up, left = beam_directions(rows[:, 0], rows[:, 1])
    assert ahead == pytest.approx([1.0, 0.0, 0.0])
    assert up[2] > 0
    assert up[1] == pytest.approx(0)
    assert left[1] > 0
    table = beam_directions(np.array([3, 519]), np.array([0, 959]))
    direct = beam_directions(np.array([3.0, 519.0]), np.array([0.0, 959.0]))
    assert table == pytest.approx(direct, abs=1e-15)
    assert np.linalg.norm(table, axis=1) == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize("name", ["samples/1_25m.txt", "samples/2_45m.txt"])
def test_the_printed_rows_lie_on_the_grid(name: str) -> None:
    scan = load_scan(shared_path(name))
    direction = beam_directions(scan.layer, scan.point)
    xyz = np.stack([scan.x_m, scan.y_m, scan.z_m], axis=1)
    angle = np.rad2deg(np.arccos(np.clip((direction * xyz).sum(axis=1) / scan.range_m, -1, 1)))
    assert angle.max() < 1e-3  # four decimals of a degree, through an arc cosine
    layer, point = beams_of(scan.x_m, scan.y_m, scan.z_m)
    assert np.array_equal(layer, scan.layer)
    assert np.array_equal(point, scan.point)


def test_positions_outside_the_field_of_view_have_no_beam() -> None:
    azimuth = np.deg2rad([59.99, 60.03, -59.99, -60.03, 180.0, 0.0, 0.0])
    elevation = np.deg2rad([0.0, 0.0, 0.0, 0.0, 0.0, 13.02, -12.99])
    x, y, z = np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)
    layer, point = beams_of(x, y, z)
    assert point.tolist() == [959, -1, 0, -1, -1, -1, 480]
    assert ((layer == -1) == (point == -1)).all()


def test_tables_cannot_be_changed_and_columns_are_equally_long() -> None:
    scan = Scan.from_beams(np.array([1, 2]), np.array([3, 4]), np.array([10.0, 20.0]))
    assert scan.range_m == pytest.approx([10.0, 20.0])
    assert scan.defaulted == ("EchoNumber", "WIDTH", "AREA", "PEAK")
    with pytest.raises(ValueError, match="read-only"):
        scan.area[0] = 1.0
    with pytest.raises(UsageError, match="column point has shape"):
        IdealScan([1], [1, 2], [1.0], [1], [0.0])  # type: ignore[arg-type]
    mine = np.array([5.0])
    IdealScan([1], [1], mine, [1], [0.0])  # type: ignore[arg-type]
    mine[0] = 6.0  # the caller's own array stays the caller's


def test_progress_is_told_up_to_the_last_beam() -> None:
    n = 20_000
    layer, point = np.divmod(np.arange(n), POINTS)
    ideal = IdealScan(layer, point, np.full(n, 30.0), np.ones(n), np.zeros(n))
    told: list[tuple[int, int]] = []
    model = Model(Sensor.of("SMART"), {1: Material("wall", 0.5)})
    simulate(ideal, model, progress=lambda done, beams: told.append((done, beams)))
    assert told[-1] == (n, n)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_seeds_are_unsigned_64_bit_numbers() -> None:
    ideal = IdealScan([1], [1], [30.0], [1], [0.0])  # type: ignore[arg-type]
    model = Model(Sensor.of("SMART"), {1: Material("wall", 0.5)})
    simulate(ideal, model, seed=2**64 - 1)
    for seed in (-1, 2**64):
        with pytest.raises(UsageError, match=r"seed .* is out of range"):
            simulate(ideal, model, seed=seed)


def test_errors_are_one_line_each() -> None:
    one = InputError("text\nin a number", file="a.txt", line=3, fix="write a number")
    assert str(one) == "error: a.txt:3: text in a number; write a number"
    assert ConfigError([one, InputError("b")]).lines() == [str(one), "error: b"]
    assert UsageError("no").exit_code == 2


def test_what_is_lost_in_a_cast_is_refused() -> None:
    with pytest.raises(UsageError, match="column layer holds a number that is not whole"):
        IdealScan(np.array([2.7]), [1], [1.0], [1], [0.0])  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="a sensor has no number 'treshold'; did you mean threshold"):
        Sensor.of("SMART", treshold=3)
    with pytest.raises(UsageError, match=r"reflectance = 1\.5 of wall is out of range"):
        Material("wall", 1.5)
    assert type(Sensor.of("SMART", spads=27.0).spads) is int
    model = Model(Sensor.of("SMART"), {1: Material("wall", 0.5)})
    for distance in (np.nan, np.inf, -1.0):
        with pytest.raises(UsageError, match="a distance below 0, or one that is not finite"):
            simulate(IdealScan([1], [1], [distance], [1], [0.0]), model)  # type: ignore[arg-type]
    ideal = IdealScan([1], [1], [30.0], [1], [0.0])  # type: ignore[arg-type]
    for wrong in ({"seed": 1.5}, {"frame": -1}):
        with pytest.raises(UsageError, match="is out of range"):
            simulate(ideal, model, **wrong)  # type: ignore[arg-type]


def test_one_beam_has_one_direction() -> None:
    assert beam_directions(3, 4).shape == (3,)
    assert beam_directions(3, 4) == pytest.approx(beam_directions([3], [4])[0])


def test_errors_cross_process_borders() -> None:
    faults = ConfigError([InputError("a", file="f", line=3, fix="x"), InputError("b")])
    for error in (faults, UsageError("c", fix="d")):
        assert str(pickle.loads(pickle.dumps(error))) == str(error)
