"""Whatever is wrong with a file is said in one line, with file and line, and nothing is written."""

import os
import random
import re
import time
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.formats import load_ideal, load_scan, save_ideal, save_scan
from lidarcheck.formats.convert import convert, describe
from lidarcheck.formats.parquet import write_parquet
from lidarcheck.formats.table import Table
from lidarcheck.scan import IdealScan, Scan

HEAD = b"//X Y Z Layer Point EchoNumber WIDTH AREA PEAK\n"
ROW = b"1.5 2.5 3.5 100 200 1 5 50 20\n"
IDEAL = b"//Layer Point Distance MaterialID IncidenceAngle\n"


def message(path: Path, load: object = load_scan) -> str:
    """The one line that loading a file ends with."""
    with pytest.raises(LidarcheckError) as caught:
        load(path)  # type: ignore[operator]
    lines = caught.value.lines()
    assert len(lines) == 1
    assert lines[0].isprintable()
    assert lines[0].startswith(f"error: {path}")
    return lines[0]


BAD_TEXT = {
    "empty": (b"", None, "empty"),
    "blanks only": (b" \n\n\t", 1, "nothing but blanks"),
    "blank first line": (b"\n" + HEAD + ROW, 1, "first line is blank"),
    "count too high": (HEAD + b"3\n" + ROW * 2, 2, "says 3 rows, the file has 2"),
    "count too low": (HEAD + b"1\n" + ROW * 2, 2, "says 1 row, the file has 2"),
    "count beyond reason": (HEAD + b"9" * 5000 + b"\n" + ROW, 2, "more rows than any file"),
    "negative count": (HEAD + b"-2\n" + ROW, 2, "'-2' looks like a number of rows; write a whole number or leave"),
    "count with decimals": (HEAD + b"2.0\n" + ROW, 2, "'2.0' looks like a number of rows"),
    "count with a sign": (HEAD + b"+2\n" + ROW, 2, "'+2' looks like a number of rows"),
    "count with an exponent": (HEAD + b"2e0\n" + ROW, 2, "looks like a number of rows"),
    "count in words": (HEAD + b"two\n" + ROW, 2, "looks like a number of rows"),
    "count in hexadecimal": (HEAD + b"0x2\n" + ROW, 2, "looks like a number of rows"),
    "count with a label": (HEAD + b"rows: 2\n" + ROW, 2, "'rows: 2' looks like a number of rows"),
    "count in a CSV": (b"X,Y,Z\n+3\n1,2,3\n", 2, "looks like a number of rows"),
    "one value": (HEAD + b"2.5\n" + ROW, 2, "the row has 1 value, the header names 9 columns"),
    "second header": (HEAD + ROW + HEAD + ROW, 3, "a second header"),
    "second header of a CSV": (b'"X","Y","Z"\n1,2,3\nx, y, z\n', 3, "a second header"),
    "no header": (ROW * 2, 1, "not the names"),
    "header is a count": (b"8\n" + ROW, 1, "not the names"),
    "header cut off": (b"//X Y Z Poi", 1, "no line end"),
    "marks without names": (b"//\n" + ROW, 1, "names no columns"),
    "inf": (HEAD + ROW.replace(b"20\n", b"-Infinity\n"), 2, "PEAK is -inf; it must be a finite number"),
    "nan for a beam": (HEAD + ROW + ROW.replace(b"100", b"nan"), 3, "Layer is nan; it must be a whole number"),
    "behind a row without a return": (
        HEAD + b"0 0 0 100 200 1 5 50 20\n" + ROW + ROW.replace(b"100", b"-7"),
        4,
        "Layer is -7",
    ),
    "beyond floats": (HEAD + ROW.replace(b"2.5", b"1e999"), 2, "beyond the range"),
    "short row": (HEAD + b"2\n" + ROW + b"1 2 3\n", 4, "3 values, the header names 9 columns; was the file cut off"),
    "short row within": (HEAD + b"1 2 3\n" + ROW, 2, "3 values, the header names 9"),
    "long row": (HEAD + ROW + ROW.replace(b"20\n", b"20 7\n"), 3, "10 values"),
    "blank line within": (HEAD + ROW + b"\n" + ROW, 3, "blank"),
    "text": (HEAD + ROW.replace(b"2.5", b"two"), 2, "'Y' is 'two', not a number"),
    "units": (HEAD + ROW.replace(b"2.5", b"2.5m"), 2, "'2.5m', not a number"),
    "python's underscore": (HEAD + ROW.replace(b"200", b"2_00"), 2, "not a number"),
    "hexadecimal": (HEAD + ROW.replace(b"200", b"0x10"), 2, "not a number"),
    "missing value": (HEAD + ROW.replace(b"2.5", b"NA"), 2, "'NA', not a number"),
    "null": (HEAD + ROW.replace(b"2.5", b"null"), 2, "'null', not a number"),
    "truth": (HEAD + ROW.replace(b"200", b"true"), 2, "'true', not a number"),
    "date": (HEAD + ROW.replace(b"200", b"2020-01-01"), 2, "not a number"),
    "decimal comma": (HEAD + ROW.replace(b"2.5", b"2,5"), 2, "decimals with a point"),
    "quoted number": (HEAD + ROW.replace(b"2.5", b'"2.5"'), 2, "without quotes"),
    "NUL byte": (HEAD + ROW.replace(b"2.5", b"2\x005"), 2, "not a number"),
    "NUL in the header": (HEAD.replace(b"Z", b"\0") + ROW, None, "binary"),
    "not UTF-8": (HEAD + ROW.replace(b"2.5", b"2\xff5"), 2, "the line is not UTF-8: byte 0xff; save the file as UTF-8"),
    "mostly not ASCII": ("X Y Z Größe Höhe Öl\n1 2 3 4 5 6\n".encode("latin-1"), 1, "not UTF-8: byte 0xf6; save the"),
    "header not UTF-8": (HEAD.replace(b"PEAK", b"Gr\xf6\xdfe") + ROW * 9, 1, "not UTF-8: byte 0xf6"),
    "digits of Arabic": (HEAD + ROW.replace(b"2.5", "٢".encode()), 2, "not a number"),
    "UTF-16": ((HEAD + ROW).decode().encode("utf-16"), None, "UTF-16"),
    "twice a name": (b"X Y Z x\n1 2 3 4\n", 1, "'x' appears twice"),
    "unprintable name": ("X Y Z a\u200bb\n1 2 3 4\n".encode(), 1, "unprintable"),
    "no Z": (b"X Y Layer Point\n1 2 3 4\n", 1, "no column Z, nor RANGE in their place (found: X, Y, Layer, Point)"),
    "nothing known": (b"alpha beta\n1 2\n", 1, "no column X, Y, Z, nor Layer, Point, RANGE"),
    "ideal without distance": (b"Layer Point MaterialID\n1 2 3\n", 1, "looks like an ideal scan without Distance"),
    "ideal without layer": (b"Point Distance MaterialID\n1 2 3\n", 1, "looks like an ideal scan without Layer"),
    "nested lists": (b"[" * 60_000, None, "JSON"),
    "layer with decimals": (HEAD + ROW + ROW.replace(b"100", b"100.5"), 3, "Layer is 100.5; it must be a whole number"),
    "negative layer": (HEAD + ROW.replace(b"100", b"-1"), 2, "Layer is -1; it must be a whole number from 0"),
    "huge point": (HEAD + ROW.replace(b"200", b"99999999999999999999"), 2, "Point is 1e+20"),
    "point beyond 32 bits": (HEAD + ROW.replace(b"200", b"3000000000"), 2, "Point is 3000000000"),
    "negative echo": (HEAD + ROW.replace(b" 1 ", b" -1 "), 2, "EchoNumber is -1; it must be a whole number from 0"),
    "half an echo": (HEAD + ROW.replace(b" 1 ", b" 0 ") + ROW.replace(b" 1 ", b" .5 "), 3, "EchoNumber is 0.5"),
    "far away": (HEAD + ROW.replace(b"2.5", b"1e300"), 2, "Y is 1e+300; it must be from -1e+09 to 1e+09 m"),
    "layer off the grid": (b"Layer Point RANGE\n520 0 1\n", 2, "Layer is 520; it must be a whole number from 0 to 519"),
    "negative range": (b"Layer Point RANGE\n5 0 -1\n", 2, "RANGE is -1.0"),
    "empty CSV cell": (b"X,Y,Z\n1,,3\n", 2, "'Y' has no value"),
    "CSV cell of blanks": (b"X,Y,Z\n1,2, \n4,5,6\n", 2, "'Z' has no value"),
    "CSV decimal comma": (b"X;Y;Z\n1,5;2;3\n", 2, "decimals with a point"),
    "CSV decimal commas": (b"X,Y,Z\n1,5,2,5,3,5\n", 2, "decimals with a point"),
    "CSV of quoted cells": (b'"X","Y","Z"\n"1","2","3"\n', 2, "without quotes"),
    "CSV with open quotes": (b'X,"Y,Z\n1,2,3\n', 1, "quotes do not fit"),
    "CSV with stray quotes": (b'X,"Y"a,Z\n1,2,3\n', 1, "quotes do not fit"),
    "CSV rows of blanks": (b"X,Y,Z\n1 2 3\n", 2, "not a number"),
    "rows of commas": (b"X Y Z\n1,2,3\n", 2, "separate the values as the header"),
    "TOML": (b'variant = "SMART"\n', None, "TOML"),
    "JSON": (b'[{"Distance": 1}]\n', None, "JSON"),
    "LUT": (b"#c\nPostPro.LUT_blooming_X = 0\n", None, "LUT"),
    "image": (b"\x89PNG\r\n\x1a\n" + bytes(40), None, "PNG"),
    "noise": (random.Random(1).randbytes(500), None, "binary"),
    "archive": (b"\x1f\x8b\x08" + bytes(40), None, "gzip"),
}


@pytest.mark.parametrize("case", BAD_TEXT)
@pytest.mark.parametrize("suffix", [".txt", ".csv"])
def test_faulty_text_is_one_clear_error(tmp_path: Path, case: str, suffix: str) -> None:
    content, line, said = BAD_TEXT[case]
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    text = message(path)
    assert said in text
    where = re.match(re.escape(f"error: {path}") + r"(?::(\d+))?: ", text)
    assert where is not None
    assert where[1] == (None if line is None else str(line))
    with pytest.raises(LidarcheckError):
        convert(path, tmp_path / "out.txt")
    assert list(tmp_path.iterdir()) == [path]


BAD_IDEAL = {
    "no material": (b"Layer Point Distance\n1 2 3\n", 1, "no column MaterialID (found: Layer, Point, Distance)"),
    "echoes": (HEAD + ROW, 1, "this holds echoes"),
    "layer off the grid": (IDEAL + b"520 0 1 1 0\n", 2, "Layer is 520"),
    "point off the grid": (IDEAL + b"0 960 1 1 0\n", 2, "Point is 960"),
    "negative distance": (IDEAL + b"0 0 1 1 0\n0 0 -1 1 0\n", 3, "Distance is -1.0; it must be from 0 to 1e+09 m"),
    "endless distance": (IDEAL + b"0 0 inf 1 0\n", 2, "Distance is inf; it must be from 0 to"),
    "material with decimals": (IDEAL + b"0 0 1 1.5 0\n", 2, "MaterialID is 1.5"),
    "negative material": (IDEAL + b"0 0 1 -1 0\n", 2, "MaterialID is -1; it must be a whole number from 0"),
    "grazing beyond": (IDEAL + b"0 0 1 1 90.5\n", 2, "IncidenceAngle is 90.5; it must be from 0 to 90 degrees"),
    "huge object": (b"Layer Point Distance MaterialID ObjectID\n0 0 1 1 9999999999\n", 2, "ObjectID is 9999999999"),
}


@pytest.mark.parametrize("case", BAD_IDEAL)
def test_faulty_ideal_scans_are_one_clear_error(tmp_path: Path, case: str) -> None:
    content, line, said = BAD_IDEAL[case]
    path = tmp_path / "bad.txt"
    path.write_bytes(content)
    text = message(path, load_ideal)
    assert text.startswith(f"error: {path}:{line}: ")
    assert said in text


def test_deeply_nested_lists_are_told_apart_and_at_once(tmp_path: Path) -> None:
    path = tmp_path / "deep"
    for content in (b"[" * 60_000, b"[ \n" * 20_000, b'{"a":' * 10_000):
        path.write_bytes(content)
        start = time.process_time()
        assert "nested too deeply" in message(path, describe)
        assert time.process_time() - start < 2


def test_found_columns_are_named_up_to_twelve(tmp_path: Path) -> None:
    path = tmp_path / "many.txt"
    path.write_bytes(b" ".join(b"c%d" % i for i in range(14)) + b"\n")
    assert "(found: c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10, c11 and 2 more)" in message(path)


OPEN_END = {
    "scan.txt": b"X Y Z\n1 2 3\n4 5 6",
    "scan.csv": b"X,Y,Z\r\n1,2,3\r\n4,5,6",
    "counted.txt": b"//X Y Z\n2\n1 2 3\n4 5 6",
    "scan.pcd": b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6",
    "scan.ply": b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
    b"end_header\n1 2 3\n4 5 6",
}


@pytest.mark.parametrize("name", OPEN_END)
def test_a_last_row_without_a_line_end_is_logged_once(
    tmp_path: Path, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / name
    said = f"{path}: the last line has no line end; if the file was cut off, its last value is wrong"
    path.write_bytes(OPEN_END[name])
    assert load_scan(path).x_m.tolist() == [1, 4]
    assert [record.getMessage() for record in caplog.records].count(said) == 1
    if path.suffix in (".txt", ".csv"):
        convert(path, tmp_path / f"out{path.suffix}")
        assert (tmp_path / f"out{path.suffix}").read_bytes() == OPEN_END[name]
    for end in (b"\n", b"\r\n", b"\n\n", b" "):
        caplog.clear()
        path.write_bytes(OPEN_END[name] + end)
        assert load_scan(path).x_m.tolist() == [1, 4]
        assert "no line end" not in caplog.text


def test_an_ideal_scan_is_no_scan(tmp_path: Path) -> None:
    path = tmp_path / "ideal.txt"
    path.write_bytes(IDEAL + b"1 2 3 4 5\n")
    assert "this is an ideal scan, not echoes" in message(path)


def test_what_is_no_readable_file(tmp_path: Path) -> None:
    assert "no such file" in message(tmp_path / "none.txt")
    assert "directory" in message(tmp_path)
    assert "no such file" in message(tmp_path / "none.txt", describe)
    os.mkfifo(tmp_path / "pipe")
    assert "not a regular file" in message(tmp_path / "pipe")
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    assert "cannot be read" in message(loop)
    with pytest.raises(InputError, match="cannot be read"):
        load_scan("a\0b")


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read every file")
def test_a_file_that_may_not_be_read(tmp_path: Path) -> None:
    path = tmp_path / "scan.txt"
    path.write_bytes(HEAD + ROW)
    path.chmod(0)
    assert "may not be read" in message(path)


@pytest.mark.parametrize("name", ["a.txt", "a.csv", "a.xyz"])
def test_binary_content_under_a_text_name_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    write_parquet(Table({"X": np.zeros(3), "Y": np.zeros(3), "Z": np.zeros(3)}), path)
    assert "its content is Parquet, its name says text; rename it to a.parquet" in message(path)
    path.write_bytes(b"LASF" + bytes(400))
    assert "its content is LAS/LAZ" in message(path)
    path.write_bytes(b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nDATA binary\n" + bytes(12))
    assert "its content is PCD" in message(path)
    path.write_bytes(b"ply\nformat binary_little_endian 1.0\nend_header\n")
    assert "its content is PLY" in message(path)


@pytest.mark.parametrize("name", ["a.parquet", "a.las", "a.pcd", "a.ply"])
def test_binary_content_that_is_not_what_the_name_says(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(random.Random(2).randbytes(300))
    assert "the file is binary but does not begin as" in message(path)


def test_damaged_parquet(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    write_parquet(Table({name: np.arange(50.0) for name in "XYZ"}), path)
    whole = path.read_bytes()
    for content in (whole[:-9], whole[:200], b"PAR1", whole[:50] + b"\xff" * 20 + whole[70:]):
        path.write_bytes(content)
        assert "damaged or cut off Parquet" in message(path)


def test_parquet_of_what_are_no_numbers(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    path = tmp_path / "a.parquet"
    good = {name: pa.array([1.0, 2.0]) for name in "XYZ"}
    cases = {
        "row 2: 'Layer' has no value": {**good, "Layer": pa.array([1, None])},
        "'Point' is 'string', not a number": {**good, "Point": pa.array(["a", "b"])},
        "row 1: PEAK is inf": {**good, "PEAK": pa.array([float("inf"), 1.0])},
        "'x' appears twice": {**good, "x": pa.array([1, 2])},
        "column 4 has no name": {**good, "": pa.array([1, 2])},
        "row 1: Layer is -5": {**good, "Layer": pa.array([-5, 1], pa.int8())},
        "row 2: Point is 18446744073709551615": {**good, "Point": pa.array([0, 2**64 - 1], pa.uint64())},
        "no column X, Y, Z": {"Layer": pa.array([1])},
    }
    for said, columns in cases.items():
        parquet.write_table(pa.table(columns), path)
        assert said in message(path)


def a_scan(**changes: object) -> Scan:
    columns = {
        name: np.ones(2) for name in ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")
    }
    return Scan(**{**columns, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".parquet", ".pcd", ".las", ".ply"])
def test_a_scan_that_no_file_may_hold_is_not_written(tmp_path: Path, suffix: str) -> None:
    for changes, said in (
        ({"area": np.array([1.0, np.nan])}, "row 2: AREA is nan"),
        ({"x_m": np.array([1e10, 0])}, "row 1: X is"),
        ({"x_m": np.array([1.0, np.nan])}, "row 2: X, Y, Z are 0 or not finite"),
        ({name: np.zeros(2) for name in ("x_m", "y_m", "z_m")}, "row 1: X, Y, Z are 0"),
        ({"echo_number": np.array([0, 1])}, "row 1: EchoNumber is 0"),
        ({"point": np.array([4, -2])}, "row 2: Point is -2"),
        ({"extra": {"peak": np.zeros(2)}}, "name of a standard column"),
        ({"extra": {"a": np.zeros(2), "A": np.zeros(2)}}, "appears twice"),
        ({"extra": {"a": np.array(["x", "y"])}}, "not 2 numbers"),
    ):
        with pytest.raises(LidarcheckError, match=said):
            save_scan(a_scan(**changes), tmp_path / f"out{suffix}")
    assert not list(tmp_path.iterdir())


def test_an_ideal_scan_that_no_file_may_hold_is_not_written(tmp_path: Path) -> None:
    columns = {name: np.ones(1) for name in ("layer", "point", "distance_m", "material_id", "incidence_deg")}
    for name, value in (("layer", -1), ("distance_m", -1.0), ("incidence_deg", 91.0), ("distance_m", np.inf)):
        with pytest.raises(InputError):
            save_ideal(IdealScan(**{**columns, name: np.array([value])}), tmp_path / "out.txt")
    assert not list(tmp_path.iterdir())


def test_suffixes_that_cannot_be_written(tmp_path: Path) -> None:
    for name in ("a.e57", "a", "txt"):
        with pytest.raises(UsageError, match=r"\.txt, \.asc, \.xyz, \.csv, \.parquet"):
            save_scan(a_scan(), tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", ["plain", "symlink", "hardlink", "detour"])
def test_a_file_is_not_converted_onto_itself(tmp_path: Path, kind: str) -> None:
    path, other = tmp_path / "a.txt", tmp_path / "b.txt"
    path.write_bytes(HEAD + ROW)
    if kind == "symlink":
        other.symlink_to(path)
    elif kind == "hardlink":
        other.hardlink_to(path)
    target = {"plain": path, "detour": tmp_path / ".." / tmp_path.name / "a.txt"}.get(kind, other)
    with pytest.raises(UsageError, match="overwritten by its own conversion; name another file"):
        convert(path, target)
    assert path.read_bytes() == HEAD + ROW


def test_an_old_target_survives_a_failed_conversion(tmp_path: Path) -> None:
    (tmp_path / "bad.txt").write_bytes(HEAD + b"1 2\n")
    (tmp_path / "out.csv").write_bytes(b"old")
    with pytest.raises(InputError):
        convert(tmp_path / "bad.txt", tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_bytes() == b"old"
    with pytest.raises(InputError, match="cannot write"):
        convert(written_good(tmp_path), tmp_path / "none" / "out.csv")


def written_good(tmp_path: Path) -> Path:
    path = tmp_path / "good.txt"
    path.write_bytes(HEAD + ROW)
    return path
