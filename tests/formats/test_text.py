"""CloudCompare text and CSV: what is read, and what is written back."""

import logging
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats import load_ideal, load_scan, save_ideal, save_scan
from lidarcheck.formats.convert import convert, describe
from lidarcheck.formats.csv import write_csv
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.scan_table import table_from_scan
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.table import Table
from lidarcheck.formats.text import read_text, write_text
from lidarcheck.scan import IdealScan, Scan, beams_of
from places import shared_path
from reference_grid import beam_directions

STEADY = settings(deadline=None, max_examples=examples(150))
SAMPLES = ("samples/1_25m.txt", "samples/2_45m.txt")
PLAIN = b"//X Y Z Point Layer EchoNumber WIDTH AREA PEAK\n2\n1 2 3 331 295 1 39 6007 236\n4 5 6.5 331 295 2 11 841 96\n"


def written(tmp_path: Path, content: bytes, name: str = "scan.txt") -> Path:
    path = tmp_path / name
    path.write_bytes(content)
    return path


def values(scan: Scan) -> list[list[float]]:
    columns = (scan.x_m, scan.y_m, scan.z_m, scan.layer, scan.point, scan.echo_number)
    return [column.tolist() for column in (*columns, scan.width_ns, scan.area, scan.peak)]


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.replace(b"//", b"// "),
        PLAIN.replace(b"//", b""),
        PLAIN.replace(b"//", b"#"),
        PLAIN.replace(b"//X Y Z", b"//x y z").replace(b"EchoNumber", b"ECHONUMBER"),
        PLAIN.replace(b"\n2\n", b"\n"),
        PLAIN.replace(b" ", b"\t"),
        PLAIN.replace(b" ", b"  \t "),
        PLAIN.replace(b"\n", b" \n "),
        PLAIN.replace(b"\n", b"\r\n"),
        PLAIN.replace(b"\n", b"\r"),
        b"\xef\xbb\xbf" + PLAIN,
        PLAIN + b"\n \t\r\n\n",
        PLAIN.rstrip(b"\n"),
        PLAIN.replace(b"1 2 3 ", b"+1 .2e1 3. ").replace(b" 331 ", b" 331.000 ", 1),
        PLAIN.replace(b" ", b","),
        PLAIN.replace(b" ", b" , ").replace(b"//", b"").replace(b"\n2\n", b"\n"),
        PLAIN.replace(b" ", b";"),
        PLAIN.replace(b"//X Y Z", b'"X","Y","Z"').replace(b" ", b","),
    ],
)
def test_every_spelling_of_a_text_file_reads_the_same(tmp_path: Path, content: bytes) -> None:
    scan = load_scan(written(tmp_path, content, "name.of.no.meaning"))
    assert values(scan) == [[1, 4], [2, 5], [3, 6.5], [295, 295], [331, 331], [1, 2], [39, 11], [6007, 841], [236, 96]]
    assert scan.defaulted == ()
    assert not scan.extra


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("suffix", [".txt", ".asc", ".XYZ"])
def test_both_header_orders_come_back_unchanged(tmp_path: Path, name: str, suffix: str) -> None:
    source = shared_path(name)
    convert(source, tmp_path / f"out{suffix}")
    assert (tmp_path / f"out{suffix}").read_bytes() == source.read_bytes()


@pytest.mark.parametrize("name", [*SAMPLES, "samples/lab_smart.txt", "data/reference_frames/SMART_lab_echoes.txt"])
@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".txt"])
def test_a_sample_means_the_same_in_every_format(tmp_path: Path, name: str, suffix: str) -> None:
    source = shared_path(name)
    convert(source, tmp_path / f"out{suffix}")
    convert(tmp_path / f"out{suffix}", tmp_path / "back.txt")
    assert values(load_scan(tmp_path / "back.txt")) == values(load_scan(source))


def test_echo_numbers_stay_in_the_file_as_they_are_written(tmp_path: Path) -> None:
    content = b"\xef\xbb\xbf# x y\tz EchoNumber odd\r\n2\r\n 1.500 2 3 0.000 7\r\n4e0 5\t6  1 08\r\n\r\n"
    source = written(tmp_path, content)
    convert(source, tmp_path / "out.txt")
    assert (tmp_path / "out.txt").read_bytes() == content
    convert(source, tmp_path / "out.parquet")
    assert read_table(tmp_path / "out.parquet").columns["EchoNumber"].tolist() == [0, 1]


def test_unknown_columns_are_kept_and_written_back(tmp_path: Path) -> None:
    source = written(tmp_path, b"//X Y Z INTENSITY Near_IR RANGE stamp\n1 2 3 7 0.5 9.25 1234567890123456789\n")
    scan = load_scan(source)
    assert {name: column.tolist() for name, column in scan.extra.items()} == {
        "INTENSITY": [7],
        "Near_IR": [0.5],
        "RANGE": [9.25],
        "stamp": [1234567890123456789],
    }
    save_scan(scan, tmp_path / "out.txt")
    assert (tmp_path / "out.txt").read_text() == "//X Y Z INTENSITY Near_IR RANGE stamp\n1\n1 2 3 7 0.5 9.25 " + (
        "1234567890123456789\n"
    )


def test_missing_columns_are_logged_in_one_line_and_left_out_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    source = written(tmp_path, b"X Y Z AREA\n10 0 0 5\n-1 0 0 6\n")
    with caplog.at_level(logging.WARNING, logger="lidarcheck"):
        scan = load_scan(source)
    assert len(caplog.records) == 1
    for name in ("Layer, Point from X, Y, Z", "EchoNumber is 1", "WIDTH, PEAK are 0"):
        assert name in caplog.text
    assert scan.defaulted == ("Layer", "Point", "EchoNumber", "WIDTH", "PEAK")
    assert (scan.layer.tolist(), scan.point.tolist()) == ([260, -1], [480, -1])
    save_scan(scan, tmp_path / "out.txt")
    assert (tmp_path / "out.txt").read_text() == "//X Y Z AREA\n2\n10 0 0 5\n-1 0 0 6\n"


def test_beams_and_ranges_stand_in_for_positions(tmp_path: Path) -> None:
    scan = load_scan(written(tmp_path, b"Layer Point RANGE\n10 20 30\n519 959 0.5\n"))
    expected = beam_directions([10, 519], [20, 959]) * np.array([[30.0], [0.5]])
    assert np.array_equal(np.stack([scan.x_m, scan.y_m, scan.z_m], axis=1), expected)
    assert "RANGE" not in scan.extra
    save_scan(scan, tmp_path / "out.txt")
    assert np.array_equal(load_scan(tmp_path / "out.txt").x_m, scan.x_m)


def test_an_unknown_beam_is_found_again_from_its_position_or_refused(tmp_path: Path) -> None:
    scan = load_scan(written(tmp_path, b"X Y Z\n10 0 0\n-1 0 0\n"))
    told = Scan(scan.x_m, scan.y_m, scan.z_m, scan.layer, scan.point, scan.echo_number, *[np.ones(2)] * 3)
    save_scan(told, tmp_path / "out.txt")
    again = load_scan(tmp_path / "out.txt")
    assert again.layer.tolist() == scan.layer.tolist()
    moved = np.where(scan.layer < 0, -1, scan.layer - 1)
    other = Scan(scan.x_m, scan.y_m, scan.z_m, moved, scan.point, scan.echo_number, *[np.ones(2)] * 3)
    with pytest.raises(UsageError, match="row 1 has layer 259"):
        save_scan(other, tmp_path / "no.txt")
    assert not (tmp_path / "no.txt").exists()


@pytest.mark.parametrize("count", ["", "0\n"])
@pytest.mark.parametrize("suffix", [".txt", ".csv", ".parquet"])
def test_a_scan_without_echoes(tmp_path: Path, count: str, suffix: str) -> None:
    source = written(tmp_path, f"//X Y Z Layer Point EchoNumber WIDTH AREA PEAK\n{count}".encode())
    scan = load_scan(source)
    assert len(scan) == 0
    save_scan(scan, tmp_path / f"out{suffix}")
    assert len(load_scan(tmp_path / f"out{suffix}")) == 0
    assert describe(tmp_path / f"out{suffix}").to_dict()["range_m"] is None


FINITE = st.floats(allow_nan=False, allow_infinity=False)
METRES = st.floats(0.001, 1e9)
WHOLE = st.integers(-(2**63), 2**63 - 1)
NAMES = st.sampled_from(["INTENSITY", "Signal", "near_ir", "a-b", "Ü", "T(s)", "1", "e5"])


def column(draw: st.DrawFn, values: st.SearchStrategy[float], n: int, dtype: str = "f8") -> np.ndarray:
    return np.array(draw(st.lists(values, min_size=n, max_size=n)), dtype=dtype)


@st.composite
def scans(draw: st.DrawFn) -> Scan:
    n = draw(st.integers(0, 3))  # more rows must lie where their beams point
    numbers = column(draw, st.integers(1, 2**31 - 1), n, "i4")
    extra = {}
    for name in draw(st.lists(NAMES, unique_by=str.casefold, max_size=3)):
        kind = draw(st.sampled_from(["f8", "i8", "f4", "u1", "?"]))
        some = {
            "f8": FINITE,
            "i8": WHOLE,
            "f4": st.floats(width=32, allow_nan=False, allow_infinity=False),
            "u1": st.integers(0, 255),
            "?": st.booleans(),
        }
        extra[name] = column(draw, some[kind], n, kind)
    x, y, z = (column(draw, METRES, n) for _ in range(3))
    layer, point = beams_of(x, y, z)
    defaulted = draw(st.lists(st.sampled_from(["Layer", "Point", "EchoNumber", "WIDTH", "AREA", "PEAK"]), unique=True))
    beam = st.integers(0, 2**31 - 1)
    features = {
        name: np.zeros(n) if name in defaulted else column(draw, FINITE, n) for name in ("WIDTH", "AREA", "PEAK")
    }
    return Scan(
        x,
        y,
        z,
        layer if "Layer" in defaulted else column(draw, beam, n, "i4"),
        point if "Point" in defaulted else column(draw, beam, n, "i4"),
        np.ones(n) if "EchoNumber" in defaulted else numbers,
        features["WIDTH"],
        features["AREA"],
        features["PEAK"],
        extra=extra,
        defaulted=tuple(
            name for name in ("Layer", "Point", "EchoNumber", "WIDTH", "AREA", "PEAK") if name in defaulted
        ),
    )


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    if a.dtype.kind == "f":
        return bool(a.astype("f8").tobytes() == b.astype("f8").tobytes())
    return a.tolist() == b.tolist()


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".parquet"])
@STEADY
@given(scan=scans())
def test_a_written_scan_reads_back_the_same(tmp_path_factory: pytest.TempPathFactory, suffix: str, scan: Scan) -> None:
    path = tmp_path_factory.mktemp("scan") / f"scan{suffix}"
    scan = scan_from_table(table_from_scan(scan))
    save_scan(scan, path)
    again = load_scan(path)
    assert again.defaulted == scan.defaulted
    assert list(again.extra) == list(scan.extra)
    for name in ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak"):
        assert same_bits(getattr(scan, name), getattr(again, name)), name
    for name in scan.extra:
        assert same_bits(scan.extra[name], again.extra[name]), name


@st.composite
def ideals(draw: st.DrawFn) -> IdealScan:
    n = draw(st.integers(0, 6))
    incidence = draw(st.booleans())
    return IdealScan(
        layer=column(draw, st.integers(0, 519), n, "i4"),
        point=column(draw, st.integers(0, 959), n, "i4"),
        distance_m=column(draw, st.floats(0, 300), n),
        material_id=column(draw, st.integers(0, 2**31 - 1), n, "i4"),
        incidence_deg=column(draw, st.floats(0, 90), n) if incidence else np.zeros(n),
        object_id=draw(st.none() | st.just(column(draw, st.integers(0, 9), n, "i4"))),
        time_s=draw(st.none() | st.just(column(draw, st.floats(0, 0.03), n))),
        extra={"Speed": column(draw, FINITE, n)} if draw(st.booleans()) else {},
        defaulted=() if incidence else ("IncidenceAngle",),
    )


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".parquet"])
@STEADY
@given(ideal=ideals())
def test_a_written_ideal_scan_reads_back_the_same(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, ideal: IdealScan
) -> None:
    path = tmp_path_factory.mktemp("ideal") / f"ideal{suffix}"
    save_ideal(ideal, path)
    again = load_ideal(path)
    assert again.defaulted == ideal.defaulted
    for name in ("layer", "point", "distance_m", "material_id", "incidence_deg", "object_id", "time_s"):
        old, new = getattr(ideal, name), getattr(again, name)
        assert (old is None) == (new is None)
        assert old is None or same_bits(old, new), name
    assert all(same_bits(old, again.extra[name]) for name, old in ideal.extra.items())


def test_a_reference_frame_reads_and_describes() -> None:
    path = shared_path("data/reference_frames/SLIM_sign_ideal.txt")
    ideal = load_ideal(path)
    assert len(ideal) == 9216
    content = describe(path).to_dict()
    assert (content["kind"], content["rows"], content["beams"]) == ("ideal", 9216, 9216)
    assert content["columns"][0]["name"] == "Layer"


def test_describe_says_what_a_sample_holds() -> None:
    found = describe(shared_path("samples/1_25m.txt"))
    assert (found.format, found.kind, found.rows, found.beams) == ("CloudCompare text", "scan", 8, 4)
    assert found.echoes_per_beam == {"2": 4}
    assert "echoes per beam  4 x 2" in str(found)


def test_text_cannot_hold_some_tables(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot hold the column name ''"):
        write_text(Table({"": np.zeros(1)}), tmp_path / "a.txt")
    for name in ("a,b", "//a", "#a", " a", 'a"b'):
        with pytest.raises(InputError, match="cannot stand in a header"):
            write_csv(Table({name: np.zeros(1)}), tmp_path / "a.csv")
    assert not list(tmp_path.iterdir())


def test_a_changed_column_changes_only_its_cells(tmp_path: Path) -> None:
    table = read_text(written(tmp_path, b"X Y Z\n1.50 2 3\n4 5 6\n"))
    write_text(table.with_column("y", np.array([2.0, 7.25])), tmp_path / "out.txt")
    assert (tmp_path / "out.txt").read_bytes() == b"X Y Z\n1.50 2 3\n4 7.25 6\n"
    write_text(table.with_column("New", np.array([1, 2])), tmp_path / "new.txt")
    assert (tmp_path / "new.txt").read_bytes() == b"//X Y Z New\n2\n1.5 2 3 1\n4 5 6 2\n"
