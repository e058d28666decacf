"""Every scan with X, Y, Z and beams passes the check where it is read."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry_kit import moved, positions, right_table, table_of
from lidarcheck.errors import InputError
from lidarcheck.formats import load_scan
from lidarcheck.formats.geometry import Placement, pooled, words
from lidarcheck.formats.geometry.placement import rotation
from lidarcheck.formats.recognise import write_table
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.table import Table
from places import shared_path


def refusal(table: Table) -> str:
    with pytest.raises(InputError) as caught:
        scan_from_table(table)
    return str(caught.value)


@settings(max_examples=20, deadline=None)
@given(decimals=st.integers(2, 6), rows=st.integers(300, 900), seed=st.integers(0, 99))
def test_right_rows_are_never_refused_nor_warned_of(decimals: int, rows: int, seed: int) -> None:
    geometry = scan_from_table(right_table(rows, seed=seed, decimals=decimals)).geometry
    assert geometry.verdict in ("ok", "not checked")
    assert geometry.outside == 0
    assert geometry.verdict == "ok" or geometry.judged < 200


def test_a_mirrored_axis_is_named_with_the_option_that_declares_it(tmp_path: Path) -> None:
    table = right_table()
    wrong = moved(table, positions(table) * [1.0, -1.0, 1.0])
    write_table(wrong, tmp_path / "wrong.txt")
    with pytest.raises(InputError) as caught:
        load_scan(tmp_path / "wrong.txt")
    said = str(caught.value)
    assert said.startswith(f"error: {tmp_path / 'wrong.txt'}: Y is mirrored: 100.0 % fit with Y negated, ")
    assert said.endswith('; give --mirror y (in a case, the frame\'s mirror = "y")')
    assert "cannot tell it from: points count from the other end" in said
    scan = load_scan(tmp_path / "wrong.txt", Placement(mirror="y"))
    assert scan.geometry.verdict == "ok"
    assert np.array_equal(scan.y_m, table.columns["Y"])


@pytest.mark.parametrize(
    ("matrix", "said", "fix"),
    [
        ([[-1, 0, 0], [0, 1, 0], [0, 0, 1]], "X is mirrored", "--mirror x"),
        ([[1, 0, 0], [0, 1, 0], [0, 0, -1]], "Z is mirrored", "--mirror z"),
        ([[-1, 0, 0], [0, -1, 0], [0, 0, 1]], "X and Y are mirrored", '--pose "0,0,0,0,0,180"'),
        ([[0, -1, 0], [1, 0, 0], [0, 0, 1]], "another order", '--pose "0,0,0,0,0,-90"'),
        ([[0, 1, 0], [1, 0, 0], [0, 0, 1]], "another order", "--mirror y --pose"),
        ([[0, 0, 1], [1, 0, 0], [0, 1, 0]], "another order", "--pose"),
    ],
)
def test_an_order_of_axes_is_named_and_its_fix_is_right(matrix: list[list[int]], said: str, fix: str) -> None:
    table = right_table()
    wrong = moved(table, positions(table) @ np.array(matrix).T)
    text = refusal(wrong)
    assert said in text
    assert fix in text
    assert scan_from_table(wrong, declared(text)).geometry.verdict == "ok"


def declared(text: str) -> Placement:
    """The placement that the options in a message declare."""
    mirror, unit, pose = (
        re.search(pattern, text) for pattern in (r"--mirror (\w)", r"--unit (\w+)", r'--pose "([^"]*)"')
    )
    numbers = tuple(float(part) for part in pose[1].split(",")) if pose else None
    return Placement(unit[1] if unit else "m", mirror[1] if mirror else "", numbers)  # type: ignore[arg-type]


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1000.0), ("cm", 100.0)])
def test_a_unit_is_named_by_the_ranges(unit: str, factor: float) -> None:
    table = right_table(near_m=20.0)
    wrong = moved(table, positions(table) * factor, decimals=1)
    text = refusal(wrong)
    assert f"not in m: the ranges fit in {unit}" in text
    assert f"give --unit {unit}" in text
    assert scan_from_table(wrong, declared(text)).geometry.verdict == "ok"


@pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("in", 0.0254), ("cm", 0.01)])
def test_a_unit_is_named_by_a_column_range(unit: str, metres: float) -> None:
    table = right_table()
    ranges = np.linalg.norm(positions(table), axis=1)
    wrong = moved(table, positions(table) / metres).with_column("RANGE", ranges)
    text = refusal(wrong)
    assert f"give --unit {unit}" in text
    placed = scan_from_table(wrong, declared(text))
    assert np.allclose(placed.range_m, ranges, atol=1e-3)
    assert scan_from_table(table.with_column("RANGE", ranges)).geometry.unit_checked


def test_a_range_beside_x_y_z_that_is_in_millimetres_is_nobodys_fault() -> None:
    table = right_table()
    ranges = 1000.0 * np.linalg.norm(positions(table), axis=1)
    assert scan_from_table(table.with_column("RANGE", ranges)).geometry.verdict == "ok"


def test_a_unit_and_a_mirror_are_named_together() -> None:
    table = right_table(near_m=20.0)
    text = refusal(moved(table, positions(table) * [1000.0, -1000.0, 1000.0], decimals=1))
    assert "give --unit mm --mirror y" in text


@pytest.mark.parametrize(
    ("layer", "point", "said"),
    [
        (lambda i: 519 - i, lambda j: j, "layers count from the other end"),
        (lambda i: i, lambda j: 959 - j, "points count from the other end"),
        (lambda i: i + 1, lambda j: j, "layers are numbered one too high"),
        (lambda i: i, lambda j: j - 1, "points are numbered one too low"),
        (lambda i: i + 1, lambda j: j + 1, "layers are numbered one too high and points are numbered one too high"),
    ],
)
def test_beams_numbered_otherwise_are_named(layer: object, point: object, said: str) -> None:
    table = right_table()
    for name, change in (("Layer", layer), ("Point", point)):
        table = table.with_column(name, change(table.columns[name]))  # type: ignore[operator]
    assert said in refusal(table)


def test_an_elevation_table_that_is_half_a_degree_off_is_named() -> None:
    table = right_table()
    azimuth, elevation = np.deg2rad((table.columns["Point"] - 479.5) * 0.125), (table.columns["Layer"] - 259.5) * 0.05
    ranges = np.linalg.norm(positions(table), axis=1)[:, None]
    for shifted, said in ((elevation + 0.5, "elevations are +0.5 deg off"), (elevation * 1.1, "1.1 times as large")):
        up = np.deg2rad(shifted)
        unit = np.stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)], axis=-1)
        assert said in refusal(moved(table, unit * ranges))


def test_degrees_taken_for_radians_are_named() -> None:
    table = right_table()
    azimuth, up = (table.columns["Point"] - 479.5) * 0.125, (table.columns["Layer"] - 259.5) * 0.05
    ranges = np.linalg.norm(positions(table), axis=1)[:, None]
    unit = np.stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)], axis=-1)
    assert "degrees taken for radians" in refusal(moved(table, unit * ranges))


def test_a_pose_is_named_with_numbers_that_bring_the_cloud_back() -> None:
    table = right_table()
    turn, move = rotation(2.0, -3.0, 40.0), np.array([1.4, 0.2, 1.7])
    wrong = moved(table, (positions(table) - move) @ turn)
    text = refusal(wrong)
    assert "the cloud stands in another frame" in text
    placement = declared(text)
    assert placement.pose == pytest.approx((1.4, 0.2, 1.7, 2.0, -3.0, 40.0), abs=0.05)
    assert scan_from_table(wrong, placement).geometry.verdict == "ok"


def test_another_order_of_layers_and_another_units_calibration_are_named() -> None:
    table, rng = right_table(6000), np.random.default_rng(1)
    order = rng.permutation(520)
    assert "layers are in another order" in refusal(table.with_column("Layer", order[table.columns["Layer"]]))
    layer, point = table.columns["Layer"], table.columns["Point"]
    up = np.deg2rad((layer - 259.5) * 0.05 + rng.uniform(-0.3, 0.3, 520)[layer])
    around = np.deg2rad((point - 479.5) * 0.125)
    unit = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)
    wrong = moved(table, unit * np.linalg.norm(positions(table), axis=1)[:, None])
    assert "another unit's calibration" in refusal(wrong)


def test_a_mixed_file_says_the_share_that_fits() -> None:
    table, rng = right_table(), np.random.default_rng(2)
    xyz = positions(table)
    some = rng.random(len(xyz)) < 0.29
    xyz[some] = rng.permutation(xyz[some])
    text = refusal(moved(table, xyz))
    assert "no change makes them fit" in text
    assert "71 % of 3000 judged rows fit" in text or "72 %" in text or "70 %" in text


def test_half_a_beam_and_a_small_turn_are_warned_of() -> None:
    table = right_table()
    geometry = scan_from_table(moved(table, positions(table) @ rotation(0.0, 0.0, 0.03).T, decimals=5)).geometry
    assert geometry.verdict == "warning"
    assert geometry.note.endswith('--pose "0,0,0,0,0,-0.03" takes that out')
    half_a_beam = moved(table, positions(table) @ rotation(0.0, 0.0, 0.0625).T, decimals=5)
    assert "turned by 0.0625 deg about Z" in refusal(half_a_beam)
    assert scan_from_table(moved(table, positions(table) @ rotation(0.0, 0.0, 0.005).T)).geometry.verdict == "ok"


def test_coarse_coordinates_are_not_judged() -> None:
    table = right_table(near_m=3.0, decimals=1)
    geometry = scan_from_table(table).geometry
    assert geometry.verdict == "not checked"
    assert "rows can be judged, 200 are needed" in geometry.note
    assert "no change" in refusal(moved(table, np.random.default_rng(0).permutation(positions(table)), decimals=1))


def test_beams_that_were_made_from_x_y_z_prove_nothing() -> None:
    table = right_table()
    bare = Table({name: table.columns[name] for name in ("X", "Y", "Z", "PEAK")})
    geometry = scan_from_table(bare).geometry
    assert words(geometry) == "geometry not checked: Layer, Point made from X, Y, Z; unit not checked"
    ranges = np.linalg.norm(positions(table), axis=1)
    made = Table({"Layer": table.columns["Layer"], "Point": table.columns["Point"], "RANGE": ranges})
    assert scan_from_table(made).geometry.note == "X, Y, Z were made from Layer, Point, RANGE"


def test_a_snippet_of_few_rows_is_refused_but_not_confirmed() -> None:
    table = right_table(8)
    assert scan_from_table(table).geometry.verdict == "not checked"
    assert "Y is mirrored" in refusal(moved(table, positions(table) * [1.0, -1.0, 1.0]))


def test_several_files_confirm_what_each_alone_cannot() -> None:
    parts = [scan_from_table(right_table(90, seed=seed)).geometry for seed in range(3)]
    assert {part.verdict for part in parts} == {"not checked"}
    assert pooled(parts).verdict == "ok"
    assert pooled(parts[:2]).verdict == "not checked"


def test_another_sensors_beams_are_not_checked_and_said_so() -> None:
    rng = np.random.default_rng(0)
    layer, point = rng.integers(0, 32, 4000), rng.integers(0, 2000, 4000)
    around, up = np.deg2rad(-0.18 * point), np.deg2rad(15.0 - layer)
    unit = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)
    geometry = scan_from_table(table_of(layer, point, unit * rng.uniform(2.0, 60.0, 4000)[:, None])).geometry
    assert geometry.verdict == "not checked"
    assert "another sensor's: columns of 0.18 deg, 0.125 deg here" in geometry.note


@pytest.mark.parametrize(
    "name",
    [
        *(f"reference_frames/{name}_echoes.txt" for name in ("SLIM_sign", "SMART_lab", "SMART_street")),
        *(f"reference_frames_any/{name}/echoes.csv" for name in ("hdl32e", "os1_128", "xt32")),
        *(f"reference_frames_any/tmf8820_short/echoes_{i:02d}.csv" for i in (0, 17, 39)),
        "hesai_xt32/rotation_0.parquet",
        "ouster_os0_128/scan_0.parquet",
        "bags/vlp32_points.pcd",
    ],
)
def test_real_captures_and_reference_frames_are_read(name: str) -> None:
    geometry = load_scan(shared_path(f"data/{name}")).geometry
    assert geometry.verdict == ("ok" if name.startswith("reference_frames/") else "not checked")
