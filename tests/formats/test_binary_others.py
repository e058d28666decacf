"""PCD, LAS/LAZ and PLY: other libraries read ours, we read theirs and files made by hand."""

from __future__ import annotations

import logging
import struct
from pathlib import Path

import laspy
import numpy as np
import plyfile
import pypcd4
import pytest

from binary_kinds import RECORD, make_table, pcd_head
from lidarcheck.formats.las import read_las, write_las
from lidarcheck.formats.pcd import read_pcd, write_pcd
from lidarcheck.formats.pcd_header import ENCODINGS as PCD_ENCODINGS
from lidarcheck.formats.ply import ENCODINGS as PLY_ENCODINGS
from lidarcheck.formats.ply import read_ply, write_ply
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.table import Table


@pytest.mark.parametrize("encoding", PCD_ENCODINGS)
def test_pypcd4_reads_ours(encoding: str, tmp_path: Path) -> None:
    table = make_table()
    write_pcd(table, tmp_path / "a.pcd", encoding)  # type: ignore[arg-type]
    cloud = pypcd4.PointCloud.from_path(tmp_path / "a.pcd")
    assert cloud.fields == table.names
    assert cloud.metadata.data.value == encoding
    for name, column in table.columns.items():
        np.testing.assert_array_equal(cloud.pc_data[name], column)


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_we_read_pypcd4s(encoding: str, tmp_path: Path) -> None:
    xyzi = np.random.default_rng(0).uniform(-90, 90, (50, 4)).astype(np.float32)
    cloud = pypcd4.PointCloud.from_xyzi_points(xyzi)
    cloud.save(tmp_path / "a.pcd", encoding=pypcd4.Encoding(encoding))
    back = read_pcd(tmp_path / "a.pcd")
    assert back.names == ("x", "y", "z", "intensity")
    np.testing.assert_allclose(np.stack(list(back.columns.values()), axis=1), xyzi, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("encoding", PLY_ENCODINGS)
def test_plyfile_reads_ours_and_we_read_its(encoding: str, tmp_path: Path) -> None:
    table = make_table()
    write_ply(table, tmp_path / "a.ply", encoding)  # type: ignore[arg-type]
    data = plyfile.PlyData.read(tmp_path / "a.ply")
    for name, column in table.columns.items():
        np.testing.assert_array_equal(data["vertex"][name], column)
    order = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}[encoding]
    theirs = plyfile.PlyData(data.elements, text=encoding == "ascii", byte_order=order)
    theirs.write(tmp_path / "b.ply")
    back = read_ply(tmp_path / "b.ply")
    assert back.names == table.names
    for name, column in table.columns.items():
        np.testing.assert_allclose(back.columns[name], column, rtol=0 if encoding != "ascii" else 1e-15)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_laspy_reads_ours(suffix: str, tmp_path: Path) -> None:
    table = make_table()
    write_las(table, tmp_path / f"a{suffix}")
    data = laspy.read(tmp_path / f"a{suffix}")
    assert data.header.are_points_compressed == (suffix == ".laz")
    assert str(data.header.version) == "1.4"
    for axis in "xyz":
        np.testing.assert_allclose(data[axis], table.get(axis), rtol=0, atol=0.501e-6)
    for name in ("Point", "Layer", "EchoNumber", "WIDTH", "AREA", "PEAK", "NearIR"):
        np.testing.assert_array_equal(data[name], table.columns[name])
    np.testing.assert_array_equal(data.return_number, table.columns["EchoNumber"])
    assert (np.asarray(data.number_of_returns) >= np.asarray(data.return_number)).all()


@pytest.mark.parametrize("point_format", [0, 1, 2, 3, 6, 7, 8])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_we_read_laspys_of_every_point_format(point_format: int, suffix: str, tmp_path: Path) -> None:
    header = laspy.LasHeader(point_format=point_format)
    header.scales = np.array([0.01, 0.01, 0.01])
    header.add_extra_dims([laspy.ExtraBytesParams("Normal", "3f4"), laspy.ExtraBytesParams("Layer", "u2")])
    data = laspy.LasData(header)
    data.x, data.y, data.z = np.array([1.0, 2.25]), np.array([-3.0, 4.0]), np.array([0.5, 0.0])
    data.intensity, data.return_number, data.Layer = np.array([7, 9]), np.array([1, 2]), np.array([3, 500])
    data.number_of_returns = np.array([2, 3])
    data.Normal = np.arange(6, dtype=np.float32).reshape(2, 3)
    data.write(tmp_path / f"a{suffix}")
    back = read_las(tmp_path / f"a{suffix}")
    assert back.columns["X"].tolist() == [1.0, 2.25]
    assert back.columns["Y"].tolist() == [-3.0, 4.0]
    assert back.columns["intensity"].tolist() == [7, 9]
    assert back.columns["EchoNumber"].tolist() == [1, 2]
    assert back.columns["Layer"].tolist() == [3, 500]
    assert back.columns["Normal_2"].tolist() == [2.0, 5.0]
    assert "classification" not in back.names
    write_las(back, tmp_path / f"b{suffix}")
    again = read_las(tmp_path / f"b{suffix}")
    assert {name.casefold() for name in again.names} == {name.casefold() for name in back.names}
    for name, column in back.columns.items():
        np.testing.assert_allclose(again.get(name), column, rtol=1e-15)


def test_a_las_that_another_program_edits_is_still_read(tmp_path: Path) -> None:
    write_las(make_table(), tmp_path / "a.laz")
    data = laspy.read(tmp_path / "a.laz")
    data.points = data.points[np.asarray(data.x) < 150]
    data.PEAK = np.asarray(data.PEAK) * 2
    data.write(tmp_path / "b.laz")
    assert read_las(tmp_path / "b.laz").columns["X"].max() < 150


def test_columns_with_a_standard_las_name(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    xyz = {axis: np.array([1.0, 2.0]) for axis in "XYZ"}
    columns = xyz | {"intensity": np.array([1, 2]), "gps_time": np.array([0.5, 1e9]), "user_data": np.array([0.5, -3])}
    write_las(Table(columns), tmp_path / "a.las")
    back = read_las(tmp_path / "a.las")
    assert "USER_DATA" in caplog.text
    assert {name: back.get(name).tolist() for name in columns} == {k: v.tolist() for k, v in columns.items()}  # type: ignore[union-attr]
    assert laspy.read(tmp_path / "a.las").intensity.tolist() == [1, 2]


def _check_hand_made(table: Table) -> None:
    assert table.names == ("x", "y", "z", "rgb", "normal_0", "normal_1", "normal_2")
    assert table.columns["x"].tolist() == [1.5, -2.0]
    assert table.columns["x"].dtype == np.float32
    assert table.columns["rgb"].tolist() == [4278190080, 7]
    assert table.columns["normal_1"].tolist() == [0.25, 1.0]


def test_hand_made_pcd_ascii(tmp_path: Path) -> None:
    rows = "1.5 2 3 0 0 0 0 4278190080 0 0.25 0\n-2 -0 3e2  0 0 0 0\t7 0 1 0 \n\n"
    (tmp_path / "a.pcd").write_bytes((pcd_head("ascii") + rows).replace("\n", "\r\n").encode())
    _check_hand_made(read_table(tmp_path / "a.pcd"))


def test_hand_made_pcd_binary(tmp_path: Path) -> None:
    rows = RECORD.pack(1.5, 2, 3, 4278190080, 0, 0.25, 0) + RECORD.pack(-2, 0, 300, 7, 0, 1, 0)
    (tmp_path / "a.pcd").write_bytes(pcd_head("binary").encode() + rows)
    _check_hand_made(read_table(tmp_path / "a.pcd"))
    (tmp_path / "a.pcd").write_bytes(pcd_head("binary", width=1, height=2).encode() + rows + bytes(100))
    _check_hand_made(read_table(tmp_path / "a.pcd"))


@pytest.mark.parametrize("padding", [b"", bytes(8)])
def test_hand_made_pcd_compressed(padding: bytes, tmp_path: Path) -> None:
    """Field after field, all points of each; the padding field may be stored or left out."""
    xyz = struct.pack("<6f", 1.5, -2, 2, 0, 3, 300)
    plain = xyz + padding + struct.pack("<2I6f", 4278190080, 7, 0, 0.25, 0, 0, 1, 0)
    literal = b"".join(bytes([len(plain[i : i + 32]) - 1]) + plain[i : i + 32] for i in range(0, len(plain), 32))
    body = struct.pack("<II", len(literal), len(plain)) + literal
    (tmp_path / "a.pcd").write_bytes(pcd_head("binary_compressed").encode() + body)
    _check_hand_made(read_table(tmp_path / "a.pcd"))


def test_a_pose_in_a_pcd_is_not_applied(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    text = "FIELDS x\nSIZE 4\nTYPE F\nWIDTH 1\nVIEWPOINT 1 0 0 1 0 0 0\nDATA ascii\n5\n"
    (tmp_path / "a.pcd").write_text(text)
    with caplog.at_level(logging.WARNING):
        assert read_pcd(tmp_path / "a.pcd").columns["x"].tolist() == [5.0]
    assert "a.pcd:5: VIEWPOINT is not applied" in caplog.text


PLY_HEAD = """ply
format {format} 1.0
comment of the hand, ünicode too
obj_info none
element sensor 1
property uchar id
element vertex 2
property float x
property float32 Y
property double z
property ushort Layer
element face 1
property list uchar int vertex_indices
end_header
"""


@pytest.mark.parametrize("order", ["<", ">"])
def test_hand_made_ply_binary(order: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    row = struct.Struct(order + "ffdH")
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    body = b"\7" + row.pack(1, 2, 0.1, 65535) + row.pack(-1, -2, -0.1, 1) + struct.pack(order + "B3i", 3, 0, 1, 1)
    (tmp_path / "a.ply").write_bytes(PLY_HEAD.format(format=name).encode() + body)
    table = read_table(tmp_path / "a.ply")
    assert table.names == ("x", "Y", "z", "Layer")
    assert table.columns["z"].tolist() == [0.1, -0.1]
    assert table.columns["Layer"].tolist() == [65535, 1]
    assert table.columns["z"].dtype.isnative
    assert "passed over the elements sensor, face" in caplog.text


def test_hand_made_ply_ascii(tmp_path: Path) -> None:
    text = PLY_HEAD.format(format="ascii") + "7\n1 2 0.1 65535\n-1 -2 -.1 1.0\n3 0 1 1\n"
    (tmp_path / "a.ply").write_bytes(text.replace("\n", "\r\n").encode())
    table = read_ply(tmp_path / "a.ply")
    assert table.columns["z"].tolist() == [0.1, -0.1]
    assert table.columns["Layer"].tolist() == [65535, 1]


def test_hand_made_las(tmp_path: Path) -> None:
    """Version 1.2, point format 0, two points; nothing but the fields of the specification."""
    rows = struct.pack("<iiiHBbBBH", 100, -200, 300, 5, 1, 0, 0, 0, 0) + struct.pack("<iii8x", -1, 0, 7)
    fixed = b"LASF" + bytes(20) + bytes([1, 2]) + b"hand".ljust(32, b"\0") + b"made".ljust(32, b"\0")
    fixed += struct.pack("<HHHIIBHI5I", 1, 2020, 227, 227, 0, 0, 20, 2, *[0] * 5)
    fixed += struct.pack("<12d", 0.01, 0.01, 0.1, 10, 0, 0, *[0] * 6)
    (tmp_path / "a.las").write_bytes(fixed + rows)
    table = read_table(tmp_path / "a.las")
    np.testing.assert_allclose(table.columns["X"], [11, 9.99], rtol=1e-15)
    np.testing.assert_allclose(table.columns["Z"], [30, 0.7], rtol=1e-15)
    assert table.columns["intensity"].tolist() == [5, 0]
    assert table.columns["EchoNumber"].tolist() == [1, 0]
