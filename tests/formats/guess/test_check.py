"""How well a scan fits a sensor's file: what is right fits, and what is wrong is named with what would make it fit."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.formats.guess import ScanCheck, check_scan, clouds_of
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.sensors import Given, import_sensor, sensor_of_import
from lidarcheck.formats.table import Table
from lidarcheck.model.files.sensor_file import load_sensor
from lidarcheck.sensor import Sensor, sensor_of
from places import shared_path
from sensor_beams import HDL32, OUSTER, VLP16, Channels, Shot, document, shoot

FIRED = replace(OUSTER, fire_us=2.7 * np.arange(32), first=90.0)


def sensor(beams: Channels, **keys: Any) -> Sensor:
    return sensor_of(document(beams, **keys))


def table(position: np.ndarray, **columns: np.ndarray) -> Table:
    return Table({**dict(zip("XYZ", position.T, strict=True)), **columns})


def numbered(shot: Shot) -> Table:
    return table(shot.position, Layer=shot.layer, Point=shot.point, RANGE=shot.range_m)


def checked(of: Table, by: Sensor, **given: str) -> ScanCheck:
    (cloud,) = clouds_of(of, **given)
    return check_scan(cloud, by)


@pytest.mark.parametrize("beams", [VLP16, FIRED, HDL32])
def test_a_right_scan_fits_whatever_names_its_beams(beams: Channels) -> None:
    shot = shoot(beams, keep=0.6)
    right, time = sensor(beams), np.rint(shot.time_s * 1e9).astype(np.uint32)
    found = checked(numbered(shot), right)
    assert (found.verdict, found.by, found.share) == ("fits", "Layer and Point", 1.0)
    assert found.most_deg < 1e-4
    assert len(found.layers) == beams.layers
    assert checked(table(shot.position, laser=shot.layer, t=time), right, ring="laser").verdict == "fits"
    found = checked(table(shot.position, ring=shot.layer), right)
    assert found.verdict == "fits"
    assert "azimuths not checked" in found.said
    found = checked(table(shot.position), right)
    assert (found.verdict, found.by) == ("elevations fit", "direction alone")
    assert "geometry not checked" in found.said


def test_ring_and_time_of_columns_that_do_not_repeat_check_the_azimuth_but_for_yaw() -> None:
    shot = shoot(HDL32.with_phase(33.0), every=2, keep=0.6)
    time = (shot.time_s - 0.1).astype(np.float32)
    found = checked(table(shot.position, ring=shot.layer, time=time), sensor(HDL32))
    assert (found.verdict, found.by) == ("fits", "ring and time")
    assert "yaw not checked" in found.said
    mirrored = table(shot.position * [1.0, -1.0, 1.0], ring=shot.layer, time=time)
    assert checked(mirrored, sensor(HDL32)).fix == 'set handedness = "left" in the sensor\'s file'


def test_rings_from_the_other_end_are_put_right_with_a_note() -> None:
    shot = shoot(VLP16, every=3)
    found = checked(table(shot.position, ring=15 - shot.layer), sensor(VLP16))
    assert found.verdict == "fits"
    assert found.notes == ("the rings count from the other end: their order was reversed",)


def test_a_left_handed_file_is_read_as_its_sensor_says() -> None:
    shot = shoot(FIRED, every=3)
    mirrored = table(shot.position * [1.0, -1.0, 1.0], Layer=shot.layer, Point=shot.point)
    found = checked(mirrored, sensor(FIRED))
    assert found.verdict == "does not fit"
    assert found.fix == 'set handedness = "left" in the sensor\'s file'
    assert checked(mirrored, sensor(FIRED, handedness="left")).verdict == "fits"


def test_another_unit_s_angles_are_named_with_how_far_they_are_off() -> None:
    rng = np.random.default_rng(2)
    other = replace(FIRED, elevation=FIRED.elevation + rng.uniform(-0.6, 0.6, 32))
    found = checked(numbered(shoot(FIRED, every=3)), sensor(other))
    assert found.verdict == "does not fit"
    assert "another unit's calibration: up to 0.5" in found.said or "calibration: up to 0.6 deg" in found.said
    assert "take the angles of this very unit" in found.fix
    worst = max(abs(fit.elevation_off_deg) for fit in found.layers)
    assert worst == pytest.approx(float(np.max(np.abs(other.elevation - FIRED.elevation))), abs=0.01)


def test_other_elevations_are_seen_by_direction_alone() -> None:
    shot = shoot(VLP16, every=3)
    found = checked(table(shot.position), sensor(replace(VLP16, elevation=VLP16.elevation * 0.97)))
    assert found.verdict == "does not fit"
    assert "lie within a tenth of the spacing" in found.said
    assert "sensor guess" in found.fix


@pytest.mark.parametrize("by_numbers", [True, False])
def test_a_wrong_unit_is_named(by_numbers: bool) -> None:
    shot = shoot(VLP16, every=3)
    columns = {"Layer": shot.layer, "Point": shot.point, "RANGE": shot.range_m} if by_numbers else {}
    found = checked(table(shot.position * 1000.0, **columns), sensor(VLP16))
    assert found.verdict == "does not fit"
    assert "not in m: the ranges fit in" in found.said
    assert "mm" in found.said


def test_a_range_that_is_not_the_way_from_the_beam_s_origin_is_named() -> None:
    shot = shoot(FIRED, every=3)
    found = checked(numbered(shot), sensor(replace(FIRED, range_offset=0.0)))
    assert (found.verdict, found.fix) == ("does not fit", "set range_offset_m = 0.0167")


def test_too_few_rows_confirm_nothing_and_do_not_fit() -> None:
    found = checked(numbered(shoot(VLP16, every=180)), sensor(VLP16))
    assert (found.verdict, found.fits) == ("not checked", False)
    assert "160 of 160 rows can be judged, 200 are needed" in found.said


def test_frames_of_one_file_are_checked_each() -> None:
    shot = shoot(VLP16, every=3)
    both = table(
        np.concatenate([shot.position, shot.position * [1.0, -1.0, 1.0]]),
        Layer=np.tile(shot.layer, 2),
        Point=np.tile(shot.point, 2),
        Frame=np.repeat([0, 1], len(shot.layer)),
    )
    assert [check_scan(cloud, sensor(VLP16)).fits for cloud in clouds_of(both)] == [True, False]


def test_a_table_of_beams_is_checked_by_its_own_directions() -> None:
    rng = np.random.default_rng(0)
    layer, point = (a.ravel() for a in np.meshgrid(np.arange(20), np.arange(30), indexing="ij"))
    up, around = 0.9 * layer - 9.0 + rng.uniform(-0.1, 0.1, 600), 1.1 * point - 16.0 + rng.uniform(-0.1, 0.1, 600)
    columns = {"Layer": layer, "Point": point, "elevation_deg": up, "azimuth_deg": around}
    text = {**document(VLP16), "beams": {"kind": "table", "file": "beams.csv"}, "sweep": {"order": "flash"}}
    own = sensor_of(text, columns=lambda _: columns)
    e, a = np.deg2rad(up), np.deg2rad(around)
    position = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1) * 7.0
    assert checked(table(position, Layer=layer, Point=point), own).verdict == "fits"
    found = checked(table(position * [1.0, -1.0, 1.0], Layer=layer, Point=point), own)
    assert found.said.startswith("Y is mirrored")
    assert checked(table(position), own).verdict == "elevations fit"


def test_a_scan_that_is_read_by_its_sensor_is_checked_against_its_beams() -> None:
    shot = shoot(FIRED, every=3)
    scan = scan_from_table(numbered(shot), sensor=sensor(FIRED))
    assert (scan.geometry.verdict, scan.geometry.unit_checked) == ("ok", True)
    with pytest.raises(InputError, match=r"set azimuth_deg\.first = 90"):
        scan_from_table(numbered(shot), sensor=sensor(replace(FIRED, first=0.0)))
    scan = scan_from_table(numbered(shot), sensor=sensor(replace(FIRED, first=0.0), deskewed=True))
    assert scan.geometry.verdict == "not checked"
    assert "deskewed" in scan.geometry.note


def test_the_xt32_fits_its_own_calibration_and_no_nominal_angles() -> None:
    nominal = load_sensor(shared_path("data/reference_frames_any/xt32/sensor.toml"))
    rotation = read_table(shared_path("data/hesai_xt32/rotation_0.parquet"))
    found = checked(rotation, nominal)
    assert found.verdict == "does not fit"
    assert found.share == pytest.approx(0.78, abs=0.01)
    assert "up to 0.12 deg" in found.said
    rows = shared_path("data/calibrations/hesai_PandarXT32.csv").read_text(encoding="utf-8").split()[1:33]
    elevation, azimuth = np.array([[float(cell) for cell in row.split(",")[1:]] for row in rows]).T
    own = Channels(elevation, -azimuth, first=90.0, step=-0.18, points=2000, fire_turns=False)
    found = checked(rotation, sensor(own))
    assert (found.verdict, found.share) == ("fits", 1.0)
    assert found.most_deg < 1e-4


@pytest.mark.parametrize("name", ["hdl32e", "os1_128", "xt32"])
def test_reference_frames_fit_their_sensors(name: str) -> None:
    of = load_sensor(shared_path(f"data/reference_frames_any/{name}/sensor.toml"))
    found = checked(read_table(shared_path(f"data/reference_frames_any/{name}/echoes.csv")), of)
    assert (found.verdict, found.share) == ("fits", 1.0)


def test_an_os0_lies_off_another_unit_s_angles_by_constants() -> None:
    other = sensor_of_import(import_sensor(shared_path("data/calibrations/ouster_os0_128_fw301.json"), Given()), "x")
    found = checked(read_table(shared_path("data/ouster_os0_128/scan_0.parquet")), other)
    assert found.verdict == "does not fit"
    assert found.share == pytest.approx(0.728, abs=0.005)
    assert "as with another unit's calibration: up to 0.75 deg: 100.0 % fit" in found.said


def test_the_vlp32_points_lie_at_its_elevations() -> None:
    text = shared_path("data/calibrations/velodyne_VeloView-VLP-32C.yaml").read_text(encoding="utf-8")
    elevation = np.rad2deg([float(value) for value in re.findall(r"vert_correction: ([-0-9.e]+)", text)])
    own = Channels(np.sort(elevation), step=-0.199, points=1809, repeats=False)
    points = read_table(shared_path("data/bags/vlp32_points.pcd"))
    found = checked(points, sensor(own))
    assert (found.verdict, found.by) == ("elevations fit", "direction alone")
    assert "100.0 %" in found.said
    assert "geometry not checked" in found.said
    assert checked(points, sensor(replace(own, elevation=own.elevation + 0.1))).verdict == "does not fit"
