"""The sensors that come with lidarcheck, held against the formulas and files by which their vendors describe them."""

import csv
import json
import re
import tomllib
from importlib import resources

import numpy as np
import pytest

from lidarcheck.sensor import Sensor, shipped, shipped_names
from places import shared_path

CLOSE_M = 1e-9
RANGES_M = np.array([1.3, 27.0, 99.0])


def written(name):
    """What the description says, read without the package."""
    return tomllib.loads(resources.files("lidarcheck").joinpath(f"sensors/{name}.toml").read_text(encoding="utf-8"))


def spread(beams, points=(0, 1, 511, 1023)):
    """Layers and points of a frame's corners, and ranges along them."""
    layer = np.repeat(np.arange(beams.layers), len(points) * len(RANGES_M))
    point = np.tile(np.repeat(points, len(RANGES_M)), beams.layers)
    return layer, point, np.tile(RANGES_M, beams.layers * len(points))


def clockwise(azimuth_rad, elevation_rad, range_m):
    """Velodyne's driver: X ahead at azimuth 0, azimuth clockwise."""
    level = range_m * np.cos(elevation_rad)
    return np.column_stack([level * np.cos(azimuth_rad), -level * np.sin(azimuth_rad), range_m * np.sin(elevation_rad)])


def lasers_of(file):
    """Elevation [rad] of each laser_id in a Velodyne calibration, and its step [m], without a YAML reader."""
    text = file.read_text(encoding="utf-8")
    found = re.findall(r"laser_id: (\d+).*?vert_correction: ([-+\d.e]+)", text, re.DOTALL)
    assert not [v for v in re.findall(r"(?:horiz|vert)_offset_correction: ([-+\d.e]+)", text) if float(v)]
    step = float(re.search(r"distance_resolution: ([\d.]+)", text).group(1))
    return np.array([float(angle) for _, angle in sorted(found, key=lambda one: int(one[0]))]), step


@pytest.mark.parametrize(("name", "file"), [("VLP-16", "VLP16db"), ("HDL-32E", "32db")])
def test_velodyne_by_its_driver_and_its_calibration(name, file):
    lasers, step_m = lasers_of(shared_path(f"data/calibrations/velodyne_{file}.yaml"))
    sensor = shipped(name)
    cycle_us, slot_us = (55.296, 2.304) if name == "VLP-16" else (46.08, 1.152)
    layer, point, range_m = spread(sensor.beams)
    ring = np.argsort(lasers)
    fire_us = slot_us * ring[layer]
    turned = fire_us / cycle_us if name == "VLP-16" else 0.0
    azimuth = 2.0 * np.pi * 10.0 * cycle_us * 1e-6 * (point + turned)
    # 32db.yaml gives radians of angles with two decimals.
    elevation = np.deg2rad(np.round(np.rad2deg(lasers), 2))[ring][layer]
    assert np.abs(np.rad2deg(elevation - lasers[ring][layer])).max() < 0.005
    found = sensor.beams.positions_m(layer, point, range_m)
    assert np.abs(found - clockwise(azimuth, elevation, range_m)).max() < CLOSE_M
    assert np.abs(sensor.beams.fire_time_s(layer, point) - 1e-6 * (cycle_us * point + fire_us)).max() < 1e-12
    assert sensor.range_resolution_m == step_m
    assert sensor.beams.columns == pytest.approx(0.1 / (cycle_us * 1e-6), rel=1e-12)


def xyz_lut(lists, transform, layer, column, range_m, columns):
    """Ouster's SDK: the encoder turns against the azimuth, the origin turns with the encoder."""
    n = lists["range_offset_m"]
    encoder = 2.0 * np.pi * (1.0 - column / columns)
    aside = np.deg2rad(np.asarray(lists["azimuth_offset_deg"])[layer])
    up = np.deg2rad(np.asarray(lists["elevation_deg"])[layer])
    x = (range_m - n) * np.cos(encoder + aside) * np.cos(up) + lists["origin_m"] * np.cos(encoder)
    y = (range_m - n) * np.sin(encoder + aside) * np.cos(up) + lists["origin_m"] * np.sin(encoder)
    z = (range_m - n) * np.sin(up)
    return np.column_stack([x, y, z]) @ transform[:3, :3].T + transform[:3, 3]


def test_ouster_by_the_formula_of_its_sdk():
    sensor, lists = shipped("OS1-128"), written("OS1-128")["beams"]
    transform = np.diag([-1.0, -1.0, 1.0, 1.0])
    transform[2, 3] = lists["height_m"]
    layer, point, range_m = spread(sensor.beams)
    found = sensor.beams.positions_m(layer, point, range_m)
    assert np.abs(found - xyz_lut(lists, transform, layer, point, range_m, 1024)).max() < CLOSE_M
    assert np.abs(sensor.beams.ranges_m(layer, point, found) - range_m).max() < CLOSE_M
    assert np.array_equal(sensor.beams.fire_time_s(layer, point), point * (0.1 / 1024))
    # One unit's lists against those of another: the same head, aligned to half a degree.
    other = json.loads(shared_path("data/calibrations/ouster_128_fw250.json").read_text(encoding="utf-8"))
    assert np.array_equal(lists["column_shift"], other["lidar_data_format"]["pixel_shift_by_row"])
    away = np.asarray(lists["azimuth_offset_deg"]) + np.asarray(other["beam_intrinsics"]["beam_azimuth_angles"])
    assert np.abs(away).max() < 0.5
    rise = np.asarray(lists["elevation_deg"]) - np.asarray(other["beam_intrinsics"]["beam_altitude_angles"])
    assert np.abs(rise).max() < 1.0


def test_what_an_ouster_sees_together_lies_together_in_its_image():
    beams = shipped("OS1-128").beams
    layer, point = beams.every()
    column = beams.image_column(layer, point)
    azimuth = np.deg2rad(beams.angles_deg(layer, point)[1] - (180.0 - column * 360.0 / 1024))
    assert np.rad2deg(np.abs(np.arctan2(np.sin(azimuth), np.cos(azimuth)))).max() < 0.36


def test_hesai_by_the_formula_of_its_sdk():
    sensor = shipped("XT32")
    layer, point, range_m = spread(sensor.beams)
    up, alpha = np.deg2rad(15.0 - layer), np.deg2rad(0.18 * point)
    level = range_m * np.cos(up)
    expected = np.column_stack([level * np.sin(alpha), level * np.cos(alpha), range_m * np.sin(up)])
    assert np.abs(sensor.beams.positions_m(layer, point, range_m) - expected).max() < CLOSE_M
    time_s = 50e-6 * point + 1e-6 * (6.0 + 1.512 * layer)
    assert np.abs(sensor.beams.fire_time_s(layer, point) - time_s).max() < 1e-12
    with shared_path("data/calibrations/hesai_PandarXT32.csv").open(encoding="utf-8") as file:
        unit = [float(row["Elevation"]) for row in csv.DictReader(file)]
    assert np.abs(sensor.beams.angles_deg(np.arange(32), 0)[0] - unit).max() < 0.15


def test_carla_casts_channels_from_the_top_of_a_left_handed_world():
    sensor = shipped("CARLA")
    layer, point, range_m = spread(sensor.beams, (0, 1, 87, 174))
    up, turn = np.deg2rad(np.linspace(10.0, -30.0, 32))[layer], np.deg2rad(360.0 / 175 * point)
    level = range_m * np.cos(up)
    left_handed = np.column_stack([level * np.cos(turn), level * np.sin(turn), range_m * np.sin(up)])
    # The description's steps have eight decimals.
    assert np.abs(sensor.beams.positions_m(layer, point, range_m) - left_handed * [1, -1, 1]).max() < 1e-4
    assert not sensor.beams.fire_time_s(layer, point).any()


@pytest.mark.parametrize("name", ["TMF8820", "TMF8820-short"])
def test_the_chips_zones_share_its_field_of_view(name):
    sensor = shipped(name)
    layer, point = sensor.beams.every()
    up, left = np.deg2rad(29.0 / 3.0) * (layer - 1), np.deg2rad(29.0 / 3.0) * (point - 1)
    expected = np.column_stack([np.cos(up) * np.cos(left), np.cos(up) * np.sin(left), np.sin(up)])
    # 9.667 stands for 29/3.
    assert np.abs(sensor.beams.directions(layer, point) - expected).max() < 1e-5
    assert sensor.footprint_deg == (9.667, 9.667)
    assert sensor.sub_rays == (9, 9)
    assert sensor.trials == 9 * 1024 * {"TMF8820": 550, "TMF8820-short": 4000}[name]


@pytest.mark.parametrize(
    ("name", "points_per_s"),
    [
        ("VLP-16", 289_351.9),  # "300,000" in its data sheet
        ("HDL-32E", 694_444.4),  # "700,000"
        ("OS1-128", 1_310_720.0),
        ("XT32", 640_000.0),
        ("CARLA", 56_000.0),
        ("TMF8820", 135.0),
        ("SLIM", 12_480_000.0),
        ("SMART", 12_480_000.0),
    ],
)
def test_firings_a_second_are_the_published_ones(name, points_per_s):
    sensor = shipped(name)
    columns = getattr(sensor.beams, "columns", sensor.beams.points)
    assert sensor.beams.layers * columns * sensor.frame_rate_hz == pytest.approx(points_per_s, rel=1e-6)


def test_a_livox_has_no_beams_before_a_scan_brings_them():
    sensor = shipped("Livox")
    assert not sensor.beams.lattice
    assert len(sensor.beams.every()[0]) == 0
    assert sensor.feature("INTENSITY").aliases == ("reflectivity", "intensity")


@pytest.mark.parametrize("name", shipped_names())
def test_every_description_is_complete_and_says_where_its_numbers_come_from(name):
    sensor = shipped(name)
    assert sensor.missing == ()
    assert len(sensor.source) >= 2
    assert sensor.features
    assert sensor.overrides() == {}
    assert Sensor.of(name) == sensor


@pytest.mark.parametrize(("name", "folder"), [
    ("HDL-32E", "hdl32e"), ("OS1-128", "os1_128"), ("XT32", "xt32"), ("TMF8820-short", "tmf8820_short"),
])  # fmt: skip
def test_an_independent_description_of_the_same_sensor_has_the_same_numbers(name, folder):
    text = shared_path(f"data/reference_frames_any/{folder}/sensor.toml").read_text(encoding="utf-8")
    assert {**tomllib.loads(text), "source": ""} == {**written(name), "source": ""}
