"""Exports of other programs: what is not needed never blocks, and what is needed and odd is named."""

import logging
import os
import struct
from pathlib import Path

import laspy
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from lidarcheck.errors import InputError
from lidarcheck.formats import load_scan
from lidarcheck.formats.convert import convert
from lidarcheck.formats.las import read_las, write_las
from lidarcheck.formats.panics import panics_unsaid
from lidarcheck.formats.parquet import read_parquet
from lidarcheck.formats.pcd import read_pcd, write_pcd
from lidarcheck.formats.ply import read_ply, write_ply
from lidarcheck.formats.recognise import read_table, recognise
from lidarcheck.formats.source import LONGEST_LINE
from lidarcheck.formats.table import Table
from lidarcheck.formats.text import write_text
from places import shared_path

NS = 1639432010123456789


def table_of(path: Path, content: bytes | str) -> Table:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_table(path)


def message_of(path: Path, content: bytes | str) -> str:
    with pytest.raises(InputError) as caught:
        table_of(path, content)
    return str(caught.value)


def test_a_tab_export_of_cloudcompare_has_blanks_in_names(tmp_path: Path) -> None:
    text = "//X\tY\tZ\tIntensity\tReturn Number\tGps Time\n2\n1.5\t2\t3\t7\t2.0\t1.25\n4\t5\t6\t8\t0.0\t2.5\n"
    table = table_of(tmp_path / "a.txt", text)
    assert table.names == ("X", "Y", "Z", "Intensity", "EchoNumber", "Gps Time")
    assert table.columns["Gps Time"].tolist() == [1.25, 2.5]
    assert recognise(tmp_path / "a.txt") == "text"
    write_text(table.with_column("EchoNumber", np.array([3, 1])), tmp_path / "b.txt")
    assert (tmp_path / "b.txt").read_text() == text.replace("\t2.0\t", "\t3.0\t").replace("\t0.0\t", "\t1.0\t")
    convert(tmp_path / "a.txt", tmp_path / "a.pcd")
    assert "Gps_Time" in read_pcd(tmp_path / "a.pcd").names


def test_a_comma_in_a_header_of_blanks(tmp_path: Path) -> None:
    table = table_of(tmp_path / "a.txt", "//X Y Z Intensity,raw\n1 2 3 4\n")
    assert {name: column.tolist() for name, column in table.columns.items()} == {
        "X": [1],
        "Y": [2],
        "Z": [3],
        "Intensity,raw": [4],
    }


def test_ousters_csv_has_two_comments_and_units(tmp_path: Path) -> None:
    head = "# frame num: 0\n# TIMESTAMP (ns), ROW, RANGE (mm), SIGNAL (photons), X1 (m), Y1 (m), Z1 (m)\n"
    table = table_of(tmp_path / "a.csv", f"{head}{NS},0,20050,5,20,1,-1\n{NS + 1},1,20100,6,20.1,1,-1\n")
    assert table.columns["TIMESTAMP (ns)"].tolist() == [NS, NS + 1]
    assert table.columns["X"].tolist() == [20, 20.1]
    assert table.columns["RANGE"].tolist() == [20.05, 20.1]
    said = message_of(tmp_path / "a.csv", f"{head}{NS},0,20050,5,20,1,-1\n{NS},0,20050,5,twenty,1,-1\n")
    assert ":4: 'X1 (m)' is 'twenty', not a number" in said


def test_second_returns_beside_the_first_are_not_passed_over_in_silence(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    head = "# X1 (m), Y1 (m), Z1 (m), X2 (m), Y2 (m), Z2 (m)\n"
    with caplog.at_level(logging.WARNING):
        table = table_of(tmp_path / "a.csv", head + "1,2,3,4,5,6\n")
    assert len(table) == 1
    assert "the second returns in X2 (m), Y2 (m), Z2 (m)" in caplog.text


@pytest.mark.parametrize(
    "content",
    [
        b"# made by a tool\nX,Y,Z\n1,2,3\n",
        b"# made by a tool\n# at noon on Sunday\n//X Y Z\n1 2 3\n",
        b"# X Y Z\n# one two three\n1 2 3\n",
        b"X Y Z\n# a comment\n1\n1 2 3\n",
        b"//X Y Z\n# a comment\n// another\n1 2 3\n",
    ],
)
def test_comments_around_the_header(tmp_path: Path, content: bytes) -> None:
    table = table_of(tmp_path / "a.txt", content)
    assert {name: column.tolist() for name, column in table.columns.items()} == {"X": [1], "Y": [2], "Z": [3]}
    assert table.line_of(0) == content.count(b"\n")
    write_text(table, tmp_path / "b.txt") if table.layout and table.layout.delimiter == " " else None


@pytest.mark.parametrize("odd", ["0x00000000", "OK", "2021-12-13 10:00:00", '"a, b"', "2_00", "1e999"])
@pytest.mark.parametrize("rows", [1, 3])
def test_a_column_that_nobody_needs_never_blocks(
    tmp_path: Path, odd: str, rows: int, caplog: pytest.LogCaptureFixture
) -> None:
    cells = [odd] * rows if rows == 1 else ["1", odd, "3"]
    content = "X,Y,Z,Error Code,Tag\n" + "".join(f"{i}.5,2,3,{cell},7\n" for i, cell in enumerate(cells))
    with caplog.at_level(logging.WARNING):
        table = table_of(tmp_path / "a.csv", content)
    assert table.names == ("X", "Y", "Z", "Tag")
    assert table.columns["X"].tolist() == [i + 0.5 for i in range(rows)]
    assert table.columns["Tag"].tolist() == [7] * rows
    line = 2 if rows == 1 else 3
    assert f"the column 'Error Code' is left out, nothing needs it: in line {line} it is" in caplog.text
    convert(tmp_path / "a.csv", tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_text() == content


def test_an_edited_column_behind_one_that_is_left_out(tmp_path: Path) -> None:
    content = 'X,Y,Z,label,EchoNumber\n1,2,3,"a, ""b""",1\n1,2,3,c,1\n'
    table = table_of(tmp_path / "a.csv", content)
    from lidarcheck.formats.csv import write_csv

    write_csv(table.with_column("EchoNumber", np.array([2, 3])), tmp_path / "b.csv")
    assert (tmp_path / "b.csv").read_text() == content.replace('",1', '",2').replace("c,1", "c,3")


def test_missing_values_of_a_column_that_nobody_needs(tmp_path: Path) -> None:
    table = table_of(tmp_path / "a.csv", "X,Y,Z,nx,k\n1,2,3,nan,\n1,2,3,0.5,4\n")
    np.testing.assert_array_equal(table.columns["nx"], [np.nan, 0.5])
    np.testing.assert_array_equal(table.columns["k"], [np.nan, 4])
    assert ":3: 'Z' has no value" in message_of(tmp_path / "a.csv", "X,Y,Z,nx\n1,2,3,1\n1,2,,1\n")


def test_columns_without_a_name_or_with_one_twice(tmp_path: Path) -> None:
    table = table_of(tmp_path / "a.csv", ",X,Y,Z,Intensity2,intensity2\n0,1,2,3,4,5\n")
    assert table.names == ("column_1", "X", "Y", "Z", "Intensity2", "intensity2_6")
    assert "'x' appears twice" in message_of(tmp_path / "a.csv", "X,Y,Z,x\n1,2,3,4\n")


def test_veloviews_names_are_known(tmp_path: Path) -> None:
    head = '"intensity","laser_id","Points_m_XYZ:0","Points_m_XYZ:1","Points_m_XYZ:2"\n'
    scan = load_scan(table_of(tmp_path / "a.csv", head + "10,0,20,1,-1\n").path or "")
    assert (scan.x_m.tolist(), scan.z_m.tolist()) == ([20], [-1])
    kept = table_of(tmp_path / "a.csv", head.replace("laser_id", "X") + "10,0,20,1,-1\n")
    assert kept.columns["X"].tolist() == [0]


INTEGERS = {
    "whole": ([f"{NS}", f"{NS + 1}"], np.int64, [NS, NS + 1]),
    "with a point": ([f"{NS}", f"{NS + 1}.0"], np.int64, [NS, NS + 1]),
    "beyond int64": ([f"{2**63 + 1}", "5"], np.uint64, [2**63 + 1, 5]),
    "small": (["3", "4"], np.int64, [3, 4]),
    "small with a point": (["3", "4.0"], np.float64, [3, 4]),
}


@pytest.mark.parametrize("case", INTEGERS)
@pytest.mark.parametrize("name", ["t", "time", "timestamp"])
def test_whole_numbers_stay_whole(tmp_path: Path, case: str, name: str) -> None:
    cells, kind, values = INTEGERS[case]
    rows = "".join(f"1,2,3,{cell}\n" for cell in cells)
    for content in (f"X,Y,Z,{name}\n{rows}", f"X,Y,Z,{name},odd\n{rows}".replace("\n1", ",x\n1")[:-1] + ",x\n"):
        content = content.replace("odd,x", "odd")
        column = table_of(tmp_path / "a.csv", content).columns[name]
        assert column.dtype == kind
        assert column.tolist() == values


@pytest.mark.parametrize("kind", ["txt", "csv", "parquet", "pcd", "las"])
def test_64_bit_integers_survive_every_format_that_has_them(tmp_path: Path, kind: str) -> None:
    from lidarcheck.formats.recognise import write_table

    columns = {axis: np.ones(2) for axis in "XYZ"} | {"t": np.array([NS, NS + 1], np.uint64)}
    write_table(Table(columns), tmp_path / f"a.{kind}")
    back = read_table(tmp_path / f"a.{kind}").columns["t"]
    assert back.dtype.kind in "iu"
    assert back.tolist() == [NS, NS + 1]


def test_whole_numbers_beyond_floats_beside_fractions(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        table = table_of(tmp_path / "a.csv", f"X,Y,Z,stamp\n1,2,3,{NS}\n1,2,3,0.5\n")
    assert table.names == ("X", "Y", "Z")
    assert "'stamp' is left out" in caplog.text
    assert "'Time' is of whole numbers beyond 2^53" in message_of(
        tmp_path / "a.csv", f"X,Y,Z,Time\n1,2,3,{NS}\n1,2,3,0.5\n"
    )


def test_a_later_piece_may_hold_what_the_first_does_not(tmp_path: Path) -> None:
    many = LONGEST_LINE // 20
    rows = "1.5,2.5,3.5,123,7,x\n" * many
    table = table_of(tmp_path / "a.csv", f"X,Y,Z,t,k,odd\n{rows}1,2,3,{NS},0.5,x\n{rows}")
    assert (table.columns["t"].dtype, table.columns["k"].dtype) == (np.int64, np.float64)
    assert table.columns["t"][many] == NS
    assert table.columns["k"][many] == 0.5
    assert len(table) == 2 * many + 1
    said = message_of(tmp_path / "a.csv", f"X,Y,Z,t,k,odd\n{rows}1,2,3,4,5,x\n{rows}1,2,y,4,5,x\n")
    assert f":{2 * many + 3}: 'Z' is 'y', not a number" in said


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_a_line_beyond_a_megabyte_is_refused_with_its_number(tmp_path: Path, end: str) -> None:
    head = f"X Y Z{end}" + f"1 2 3{end}" * 300_000
    assert f":{300_002}: the line is longer" in message_of(tmp_path / "a.txt", head + "1 " * LONGEST_LINE + end)
    assert len(table_of(tmp_path / "a.txt", head + "1 2 " + " " * (LONGEST_LINE - 7) + "3" + end)) == 300_001
    ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n"
    assert ":6: the line is longer" in message_of(tmp_path / "a.ply", ply + "1 " * LONGEST_LINE + "\n")


NAN_RGB = struct.pack("<ffff", 1, 2, 3, float("nan"))


def test_nan_in_a_binary_file_is_a_value(tmp_path: Path) -> None:
    head = "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nPOINTS 2\nDATA "
    table = table_of(tmp_path / "a.pcd", (head + "binary\n").encode() + NAN_RGB * 2)
    assert np.isnan(table.columns["rgb"]).all()
    assert table.columns["x"].tolist() == [1, 1]
    again = table_of(tmp_path / "a.pcd", head + "ascii\n1 2 3 nan\n1 2 3 -nan(ind)\n")
    assert np.isnan(again.columns["rgb"]).all()
    for write, read, name in ((write_pcd, read_pcd, "b.pcd"), (write_ply, read_ply, "b.ply")):
        for encoding in ("ascii", "binary" if name == "b.pcd" else "binary_big_endian"):
            write(table, tmp_path / name, encoding)  # type: ignore[operator]
            assert np.isnan(read(tmp_path / name).columns["rgb"]).all()


def test_a_field_of_no_numbers_is_padding(tmp_path: Path) -> None:
    head = "FIELDS x y z _ ring\nSIZE 4 4 4 2 1\nTYPE F F F U U\nCOUNT 1 1 1 0 1\nPOINTS 2\nDATA binary\n"
    table = table_of(tmp_path / "a.pcd", head.encode() + struct.pack("<fffBfffB", 1, 2, 3, 4, 5, 6, 7, 8))
    assert table.columns["ring"].tolist() == [4, 8]


def test_a_number_of_another_type_in_a_column_that_nobody_needs(tmp_path: Path) -> None:
    head = "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nPOINTS 2\nDATA ascii\n"
    assert table_of(tmp_path / "a.pcd", head + "1 2 3 4\n1 2 3 4.5\n").names == ("x", "y", "z")
    said = message_of(tmp_path / "a.pcd", head.replace("rgb", "Layer") + "1 2 3 4\n1 2 3 4.5\n")
    assert ":7: 'Layer' is 4.5, not a whole number" in said


def test_parquet_of_a_data_frame(tmp_path: Path) -> None:
    columns = {name: pa.array([1.0, None]) for name in "XYZ"}
    columns |= {"label": pa.array(["a", "b"]), "k": pa.array([1, None]), "t": pa.array([NS, None])}
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    table = read_parquet(tmp_path / "a.parquet")
    assert table.names == ("X", "Y", "Z", "k")
    np.testing.assert_array_equal(table.columns["X"], [1, np.nan])


def foreign_las(path: Path, *, extra: str, values: list[int], intensity: list[int]) -> None:
    header = laspy.LasHeader(version="1.2", point_format=0)
    header.add_extra_dim(laspy.ExtraBytesParams(extra, np.uint16))
    data = laspy.LasData(header)
    data.x = data.y = data.z = np.arange(float(len(values)))
    data.intensity = intensity
    data.return_number = [1, 0, 2][: len(values)]
    data[extra] = values
    data.write(path)


def test_a_standard_las_dimension_beside_an_extra_one_of_its_name(tmp_path: Path) -> None:
    foreign_las(tmp_path / "a.las", extra="Intensity", values=[1, 2, 3], intensity=[7, 8, 9])
    table = read_las(tmp_path / "a.las")
    assert table.columns["Intensity"].tolist() == [1, 2, 3]
    assert table.columns["standard_intensity"].tolist() == [7, 8, 9]
    assert table.columns["EchoNumber"].tolist() == [1, 0, 2]
    foreign_las(tmp_path / "a.las", extra="EchoNumber", values=[1, 1, 2], intensity=[0, 0, 0])
    assert read_las(tmp_path / "a.las").columns["return_number"].tolist() == [1, 0, 2]


def test_a_row_far_away_does_not_coarsen_the_others(tmp_path: Path) -> None:
    for far in (3000.0, 200e3):
        x = np.array([20.1234, 20.2345, far])
        write_las(Table({"X": x, "Y": x, "Z": x}), tmp_path / "a.las")
        assert np.abs(read_las(tmp_path / "a.las").columns["X"] - x).max() <= 0.5e-4
    before = (tmp_path / "a.las").read_bytes()
    with pytest.raises(InputError, match=r"row 2: Y is 900000000 m, so far away"):
        write_las(Table({"X": np.ones(3), "Y": np.array([1.0, 9e8, 2]), "Z": np.ones(3)}), tmp_path / "a.las")
    assert (tmp_path / "a.las").read_bytes() == before


def test_a_laz_that_is_cut_off_or_packed_otherwise_is_one_line(tmp_path: Path) -> None:
    write_las(Table({name: np.arange(400.0) for name in ("X", "Y", "Z", "AREA")}), tmp_path / "a.laz")
    whole = (tmp_path / "a.laz").read_bytes()
    at = whole.index(b"laszip encoded") + 52
    pointwise = whole[:at] + struct.pack("<H", 1) + whole[at + 2 :]
    assert "is compressed point by point" in message_of(tmp_path / "b.laz", pointwise)
    for end in (len(whole) - 9, len(whole) // 2):
        assert "damaged or cut off" in message_of(tmp_path / "b.laz", whole[:end])


def test_what_a_panic_says_is_said_once(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BaseException, match="out of bounds"), panics_unsaid():  # noqa: PT012
        os.write(2, b"thread '<unnamed>' panicked at decoders.rs:171\nstack backtrace:\n 0: rust_begin_unwind\n")
        raise BaseException("out of bounds")
    assert capfd.readouterr().err == ""
    with panics_unsaid():
        os.write(2, b"what others say\n")
    assert capfd.readouterr().err == "what others say\n"


def test_a_laz_that_makes_its_library_panic(capfd: pytest.CaptureFixture[str]) -> None:
    path = shared_path("inputs/laz_panic.laz")
    with pytest.raises(InputError, match="damaged LAS or LAZ data: index out of bounds") as caught:
        read_las(path)
    assert len(caught.value.lines()) == 1
    assert capfd.readouterr().err == ""


EXPORTS = {
    "cc_tab_1.txt": 20,
    "csv_mixed.csv": 20,
    "livox_viewer.csv": 20,
    "ouster_cli.csv": 20,
    "veloview_points.csv": 20,
    "pad_count0.pcd": 20,
    "rgb_float_alpha255.pcd": 20,
    "time_ns.csv": 5,
    "carla_plain.ply": 40,
    "ret_mixed.las": 40,
}


@pytest.mark.parametrize("name", EXPORTS)
def test_exports_that_were_refused_or_misread(name: str) -> None:
    table = read_table(shared_path(f"inputs/{name}"))
    assert len(table) == EXPORTS[name]
    assert [table.get(axis)[0] for axis in "XYZ"] == pytest.approx(  # type: ignore[index]
        [20, -0.365 if name.startswith("livox") else 1, -1], abs=1e-6
    )
