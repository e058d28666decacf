"""Ouster's metadata: the imported beams put each return where the vendor's own conversion does."""

import math

import numpy as np
import pytest

from lidarcheck.errors import InputError
from sensor_import_kit import ALTITUDES, IDENTITY, imported, ouster, ouster_xyz, positions, sensor, written


@pytest.mark.parametrize("transform", [None, [1, 0, 0, 27.67, *IDENTITY[4:]]])
def test_returns_lie_where_the_sdk_puts_them(tmp_path, transform):
    meta = ouster()
    if transform:
        meta["beam_intrinsics"] |= {"beam_to_lidar_transform": transform, "lidar_origin_to_beam_origin_mm": 27.67}
    own = sensor(imported(written(tmp_path, "m.json", meta)))
    row, column = (axis.ravel() for axis in np.meshgrid(range(8), [0, 1, 130, 511], indexing="ij"))
    range_m = np.linspace(0.5, 250, len(row))
    expected = [ouster_xyz(meta, *of) for of in zip(row, column, range_m, strict=True)]
    assert np.abs(positions(own, row, column, range_m) - expected).max() < 1e-9


def test_what_the_metadata_says(tmp_path):
    found = imported(written(tmp_path, "m.json", ouster()))
    own = sensor(found)
    assert (own.name, own.frame_rate_hz, own.max_echoes, own.keep) == ("OS-1-8 122", 10, 2, "strongest_second")
    assert own.range_resolution_m == 0.001
    assert [(f.name, f.law, f.bits) for f in own.features] == [
        ("REFLECTIVITY", "calibrated_reflectivity", 8), ("SIGNAL", "affine", 16), ("NEAR_IR", "background", 16)
    ]  # fmt: skip
    assert found.document["beams"]["column_shift"] == [9, 3, -3, -9, 9, 3, -3, -9]
    assert own.sweep.direction == "right"
    assert {"range.max_m", "range.min_m", "linear.signal_at_1m"} <= {entry.key for entry in found.lacking}
    assert "firmware v3.0.1" in own.source[0]


def test_the_flat_form_is_the_same_sensor(tmp_path):
    nested = ouster()
    flat = {"data_format": nested.pop("lidar_data_format"), "lidar_mode": nested["config_params"]["lidar_mode"]}
    for group in ("beam_intrinsics", "lidar_intrinsics", "sensor_info"):
        flat |= nested[group]
    assert imported(written(tmp_path, "m.json", flat)) == imported(written(tmp_path, "m.json", ouster()))


@pytest.mark.parametrize(
    ("window", "first", "count"), [([100, 150], 100, 51), ([500, 3], 500, 16), ([0, 511], 0, 512), ([7, 7], 7, 1)]
)
def test_a_window_is_a_part_of_the_turn(tmp_path, window, first, count):
    meta = ouster()
    meta["lidar_data_format"]["column_window"] = window
    own = sensor(imported(written(tmp_path, "m.json", meta)))
    assert own.beams.points == count
    point = np.array([0, count - 1])
    column = (first + point) % 512
    expected = [ouster_xyz(meta, 2, of, 20.0) for of in column]
    assert np.abs(positions(own, [2, 2], point, [20.0, 20.0]) - expected).max() < 1e-9
    if count < 512:
        assert own.sweep.duration_s == pytest.approx(0.1 * count / 512)


@pytest.mark.parametrize(
    ("window", "columns"), [([583, 39402], range(456, 512)), ([350_000, 10_000], [*range(498, 512), *range(15)])]
)
def test_an_azimuth_window_names_the_columns_that_look_there(tmp_path, window, columns):
    meta = ouster()
    del meta["lidar_data_format"]["column_window"]
    meta["config_params"]["azimuth_window"] = window
    own = sensor(imported(written(tmp_path, "m.json", meta)))
    looks = [(-360.0 * column / 512) % 360 for column in range(512)]
    low, high = (end / 1000 for end in window)
    inside = [c for c, at in enumerate(looks) if (low <= at <= high if low < high else at >= low or at <= high)]
    assert sorted(columns) == inside
    assert own.beams.points == len(inside)
    first, _ = own.beams.angles_deg([0], [0])[1], None
    assert (first[0] - 180 + 4.2) % 360 == pytest.approx(looks[next(iter(columns))])


def test_a_solid_state_unit_is_a_table(tmp_path):
    meta = ouster()
    meta["beam_intrinsics"] = {
        "beam_altitude_angles": [[float(row)] * 4 for row in range(-2, 3)],
        "beam_azimuth_angles": [[-15.0, -5.0, 5.0, 15.0]] * 5,
        "beam_to_lidar_transform": IDENTITY,
    }
    meta["lidar_intrinsics"]["lidar_to_sensor_transform"] = IDENTITY
    meta["lidar_data_format"] |= {"columns_per_frame": 4, "pixels_per_column": 5, "column_window": [0, 3]}
    meta["lidar_data_format"]["pixel_shift_by_row"] = [0] * 5
    meta["config_params"]["lidar_mode"] = "4x10"
    own = sensor(imported(written(tmp_path, "df.json", meta)))
    elevation, azimuth = own.beams.angles_deg([0, 4, 4], [0, 1, 3])
    assert (elevation.tolist(), azimuth.tolist()) == ([-2, 2, 2], [-15, -5, 15])
    assert own.sweep.order == "flash"


def test_a_unit_of_16_in_a_body_of_64_keeps_its_rings(tmp_path):
    meta = {
        "beam_altitude_angles": [16.0 - row / 2 if row % 4 == 3 else 0 for row in range(64)],
        "beam_azimuth_angles": [-3.0 if row % 4 == 3 else 0 for row in range(64)],
        "lidar_to_sensor_transform": ouster()["lidar_intrinsics"]["lidar_to_sensor_transform"],
        "lidar_mode": "1024x10", "prod_line": "OS-1-16-A0", "build_rev": "v1.13.0",
    }  # fmt: skip
    found = imported(written(tmp_path, "m.json", meta))
    assert found.document["beams"]["ring"] == list(range(3, 64, 4))
    assert sensor(found).beams.layers == 16
    lacking = {entry.key for entry in found.lacking}
    assert {"beams.origin_m", "beams.range_offset_m", "beams.column_shift", "features.REFLECTIVITY"} <= lacking


def test_old_firmware_in_the_nested_form_has_no_data_format(tmp_path):
    meta = ouster() | {"lidar_data_format": "error: Command not recognized."}
    del meta["beam_intrinsics"]["beam_to_lidar_transform"], meta["beam_intrinsics"]["lidar_origin_to_beam_origin_mm"]
    meta["config_params"]["azimuth_window"] = [0, 36000]
    meta["sensor_info"] |= {"prod_line": "OS-1-64", "build_rev": "v1.13.0"}
    meta["beam_intrinsics"]["beam_altitude_angles"] = [16.0 - row / 2 for row in range(64)]
    meta["beam_intrinsics"]["beam_azimuth_angles"] = [3.0] * 64
    own = sensor(imported(written(tmp_path, "m.json", meta)))
    assert (own.beams.layers, own.beams.points) == (64, 512)
    meta["sensor_info"]["build_rev"] = "v2.3.0"
    with pytest.raises(InputError, match="pixels_per_column is missing"):
        imported(written(tmp_path, "m.json", meta))


def changed(path, value):
    meta = at = ouster()
    for part in path[:-1]:
        at = at[part]
    if value is None:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return meta


BEAMS, FORM = "beam_intrinsics", "lidar_data_format"


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ((BEAMS, "beam_altitude_angles"), [0] * 8, "are all 0"),
        ((BEAMS, "beam_altitude_angles"), ALTITUDES[:7], "has 7 numbers for 8 channels"),
        ((BEAMS, "beam_azimuth_angles"), [*ALTITUDES, 1.0], "has 9 numbers for 8 channels"),
        ((BEAMS, "beam_altitude_angles"), [math.radians(a) for a in ALTITUDES], "look like radians"),
        ((BEAMS, "beam_altitude_angles"), [*ALTITUDES[:7], "x"], 'beam_altitude_angles[7] = "x"'),
        ((BEAMS, "beam_altitude_angles"), [*ALTITUDES[:7], 1e999], "not valid JSON: Infinity"),
        ((BEAMS, "beam_altitude_angles"), None, "beam_altitude_angles is missing"),
        ((BEAMS, "lidar_origin_to_beam_origin_mm"), 0.0158, "and 0.0158 mm by the other key"),
        ((FORM, "pixels_per_column"), None, "pixels_per_column is missing"),
        ((FORM, "pixel_shift_by_row"), [1, 2], "pixel_shift_by_row has 2 numbers, 8 are needed"),
        ((FORM, "column_window"), [0, 512], "column_window 0 to 512"),
        ((FORM, "columns_per_frame"), 1024, "lidar_mode says 512 columns, columns_per_frame 1024"),
        (("config_params", "lidar_mode"), "fast", "is no mode"),
        (("lidar_intrinsics", "lidar_to_sensor_transform"), [1, 0, 0, 5, *IDENTITY[4:]], "more than a turn about Z"),
        (("lidar_intrinsics", "lidar_to_sensor_transform"), IDENTITY[:15], "has 15 numbers, 16 are needed"),
    ],
)  # fmt: skip
def test_incomplete_metadata_is_refused(tmp_path, path, value, said):
    file = written(tmp_path, "m.json", changed(path, value))
    with pytest.raises(InputError) as caught:
        imported(file)
    [line] = caught.value.lines()
    assert line.startswith(f"error: {file}")
    assert said in line
