"""Vendors' own files, and captures of the sensors that they describe."""

import csv
import json
import math

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.formats.recognise import read_table
from places import shared_path
from sensor_import_kit import imported, ouster_xyz, positions, sensor

CALIBRATIONS = "data/calibrations/"
TOLERANCE_M = 1e-9


@pytest.mark.parametrize(
    ("name", "channels", "rate_hz", "resolution_m"),
    [
        ("hesai_Pandar128E4X.csv", 128, None, 0.01),
        ("hesai_Pandar40P.csv", 40, None, 0.01),
        ("hesai_PandarQT128.csv", 128, None, 0.01),
        ("hesai_PandarXT32.csv", 32, None, 0.01),
        ("ouster_128_fw250.json", 128, 10, 0.001),
        ("ouster_os0_128_fw301.json", 128, 10, 0.001),
        ("ouster_os1_128_fw200_column_window.json", 128, 10, 0.001),
        ("ouster_os1_64_fw112_legacy.json", 64, 10, 0.001),
        ("velodyne_32db.yaml", 32, None, 0.002),
        ("velodyne_VLP16db.yaml", 16, None, 0.002),
        ("velodyne_VLS128.yaml", 128, None, 0.004),
        ("velodyne_VeloView-VLP-32C.yaml", 32, None, 0.004),
    ],
)
def test_every_file_is_a_sensor(name, channels, rate_hz, resolution_m):
    found = imported(shared_path(CALIBRATIONS + name))
    own = sensor(found)
    assert (own.beams.layers, own.range_resolution_m) == (channels, resolution_m)
    assert found.document.get("frame_rate_hz") == rate_hz
    assert name in own.source[0]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("hesai_PandarAT128.csv", "the calibration of a Hesai AT128"),
        ("ouster_malformed_all_zeros.json", ":2: beam_altitude_angles are all 0"),
        ("ouster_malformed_nbeam_angles.json", ":4: beam_altitude_angles has 63 numbers for 64 channels"),
        ("ouster_malformed_no_data_format.json", "lidar_data_format.pixels_per_column is missing"),
    ],
)
def test_every_malformed_file_is_refused_for_its_reason(name, said):
    with pytest.raises(InputError) as caught:
        imported(shared_path(CALIBRATIONS + name))
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "name", ["ouster_128_fw250.json", "ouster_os0_128_fw301.json", "ouster_os1_128_fw200_column_window.json"]
)
def test_ouster_puts_returns_where_the_sdk_does(name):
    path = shared_path(CALIBRATIONS + name)
    meta = json.loads(path.read_text())
    own = sensor(imported(path))
    form = meta.get("lidar_data_format") or meta["data_format"]
    first = form["column_window"][0]
    if "beam_to_lidar_transform" not in meta.get("beam_intrinsics", meta):
        meta["beam_to_lidar_transform"] = [1, 0, 0, meta["lidar_origin_to_beam_origin_mm"], *np.eye(4).ravel()[4:]]
    dice = np.random.default_rng(1)
    row, point = dice.integers(0, own.beams.layers, 200), dice.integers(0, own.beams.points, 200)
    range_m = dice.uniform(0.5, 200, 200)
    expected = [ouster_xyz(meta, r, first + p, m) for r, p, m in zip(row, point, range_m, strict=True)]
    assert np.abs(positions(own, row, point, range_m) - expected).max() < TOLERANCE_M


def test_velodynes_worked_example_is_the_file():
    """The HDL-32E of the format's description: angles in rings, one laser a slot of 1.152 us."""
    own = sensor(imported(shared_path(CALIBRATIONS + "velodyne_32db.yaml"), rate_hz=10.0))
    assert own.name == "Velodyne HDL-32E"
    channels = own.beams.channels
    ends = channels.elevation_deg[:3] + channels.elevation_deg[-2:]
    assert ends == pytest.approx((-30.67, -29.33, -28.0, 9.33, 10.67), abs=1e-6)
    assert channels.fire_time_us[:2] + channels.fire_time_us[16:18] == (0.0, 2.304, 1.152, 3.456)
    assert own.beams.step_deg == pytest.approx(-0.165888)
    assert not own.beams.repeats
    assert not own.sweep.fire_time_in_azimuth


def capture(name):
    folder = shared_path(name)
    file = sorted(path for path in folder.iterdir() if path.suffix in (".parquet", ".csv", ".pcd", ".txt"))[0]
    return read_table(file).columns


def test_a_capture_of_another_ouster_of_the_kind_lies_near_its_beams():
    """Units differ by some tenths of a degree; another origin, turning sense or zero would be far off."""
    columns = capture("data/ouster_os0_128")
    own = sensor(imported(shared_path(CALIBRATIONS + "ouster_os0_128_fw301.json")))
    there = np.asarray(columns["RANGE"]) > 0
    layer, point = (np.asarray(columns[name])[there].astype(int) for name in ("Layer", "Point"))
    found = positions(own, layer, point, np.asarray(columns["RANGE"])[there])
    xyz = np.stack([np.asarray(columns[axis], float)[there] for axis in "XYZ"], axis=-1)
    away = np.linalg.norm(found - xyz, axis=1) / np.linalg.norm(xyz, axis=1)
    assert np.quantile(np.degrees(away), 0.99) < 1.5
    assert np.quantile(np.abs(np.linalg.norm(found, axis=1) - np.linalg.norm(xyz, axis=1)), 0.99) < 0.002


def test_a_capture_of_the_hesai_lies_on_its_beams():
    columns = capture("data/hesai_xt32")
    path = shared_path(CALIBRATIONS + "hesai_PandarXT32.csv")
    own = sensor(imported(path, rate_hz=10.0, azimuth_step_deg=0.18))
    with path.open() as stream:
        elevation = [float(row["Elevation"]) for row in csv.DictReader(stream)]
    assert own.beams.channels.elevation_deg == tuple(elevation)
    xyz = np.stack([np.asarray(columns[axis], float) for axis in "XYZ"], axis=-1)
    far = np.linalg.norm(xyz, axis=1) > 1.0
    layer, point = (np.asarray(columns[name])[far].astype(int) for name in ("Layer", "Point"))
    up, aside = own.beams.angles_deg(layer, point)
    x, y, z = xyz[far].T
    seen = np.degrees(np.arctan2(z, np.hypot(x, y)))
    assert np.quantile(np.abs(seen - up), 0.99) < 0.01
    off = (np.degrees(np.arctan2(y, x)) - aside + 180) % 360 - 180
    assert math.isclose(np.median(off), 0.0, abs_tol=0.1)
