"""Parquet, and what all formats have in common: they hold the same scan."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats import load_ideal, load_scan, save_ideal, save_scan
from lidarcheck.formats.convert import convert, describe
from lidarcheck.formats.parquet import read_parquet, write_parquet
from lidarcheck.formats.recognise import FORMATS, read_table, recognise, target_format
from lidarcheck.formats.scan_table import table_from_scan
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.table import Table, check_names, quoted
from lidarcheck.scan import IdealScan, Scan
from places import shared_path

STEADY = settings(deadline=None, max_examples=examples(60))
SUFFIXES = [".txt", ".csv", ".parquet", ".pcd", ".las", ".laz", ".ply"]
FIELDS = ("layer", "point", "echo_number", "width_ns", "area", "peak")
DTYPES = ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8", "?"]


@pytest.mark.parametrize("dtype", DTYPES)
def test_parquet_keeps_types_bits_order_and_spelling(tmp_path: Path, dtype: str) -> None:
    column = np.frombuffer(np.random.default_rng(3).bytes(64), dtype="u1").astype(dtype)
    table = Table({"b": column, "A b,c": column[::-1]})
    write_parquet(table, tmp_path / "a.parquet")
    again = read_parquet(tmp_path / "a.parquet")
    assert again.names == ("b", "A b,c")
    for name in again.names:
        assert again.columns[name].dtype == np.dtype(dtype)
        assert again.columns[name].tobytes() == table.columns[name].tobytes()


def test_parquet_of_several_pieces_and_dictionaries(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    x = pa.chunked_array([[1.0, 2.0], [3.0]])
    layer = pa.array([7, 8, 7], pa.int16()).dictionary_encode()
    parquet.write_table(pa.table({"X": x, "Y": x, "Z": x, "Layer": layer}), tmp_path / "a.parquet", row_group_size=2)
    scan = load_scan(tmp_path / "a.parquet")
    assert scan.x_m.tolist() == [1, 2, 3]
    assert scan.layer.tolist() == [7, 8, 7]


@st.composite
def scans(draw: st.DrawFn) -> Scan:
    n = draw(st.integers(0, 3))  # more rows must lie where their beams point

    def column(values: st.SearchStrategy[float], dtype: str) -> np.ndarray:
        return np.array(draw(st.lists(values, min_size=n, max_size=n)), dtype=dtype)

    metres = st.integers(-300_000_000, 300_000_000).map(lambda micrometres: micrometres / 1e6 or 1.0)
    beam = st.integers(0, 2**31 - 1)
    real = st.floats(allow_nan=False, allow_infinity=False)
    extra = {
        "RANGE": column(st.floats(0.5, 300, width=32), "f4"),
        "SIGNAL": column(st.integers(0, 2**31 - 1), "i4"),
        "Odd": column(real, "f8"),
    }
    kept = draw(st.lists(st.sampled_from(list(extra)), unique=True))
    return Scan(
        *(column(metres, "f8") for _ in range(3)),
        *(column(beam, "i4") for _ in range(2)),
        column(st.integers(1, 2**31 - 1), "i4"),
        *(column(real, "f8") for _ in range(3)),
        extra={name: extra[name] for name in kept},
    )


@pytest.mark.parametrize("suffix", SUFFIXES)
@STEADY
@given(scan=scans())
def test_a_written_scan_reads_back_the_same(tmp_path_factory: pytest.TempPathFactory, suffix: str, scan: Scan) -> None:
    path = tmp_path_factory.mktemp("scan") / f"scan{suffix}"
    scan = scan_from_table(table_from_scan(scan))
    save_scan(scan, path)
    again = load_scan(path)
    for name in FIELDS:
        assert getattr(again, name).tobytes() == getattr(scan, name).tobytes(), name
    for name in ("x_m", "y_m", "z_m"):
        if suffix in (".las", ".laz"):
            assert np.allclose(getattr(again, name), getattr(scan, name), rtol=0, atol=1e-9)
        else:
            assert getattr(again, name).tobytes() == getattr(scan, name).tobytes(), name
    assert set(again.extra) == set(scan.extra)
    for name, old in scan.extra.items():
        assert again.extra[name].astype("f8").tobytes() == old.astype("f8").tobytes(), name
    assert again.defaulted == ()


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".parquet", ".pcd", ".ply"])
def test_an_ideal_scan_in_every_format_that_holds_one(tmp_path: Path, suffix: str) -> None:
    ideal = IdealScan(
        layer=np.array([0, 519, 3]),
        point=np.array([959, 0, 3]),
        distance_m=np.array([0.0, 37.0512, 0.1]),
        material_id=np.array([1, 7, 2]),
        incidence_deg=np.array([0.0, 87.525, 90.0]),
        time_s=np.array([0.0, 0.01, 0.03]),
    )
    save_ideal(ideal, tmp_path / f"a{suffix}")
    convert(tmp_path / f"a{suffix}", tmp_path / "b.txt")
    again = load_ideal(tmp_path / "b.txt")
    for name in ("layer", "point", "distance_m", "material_id", "incidence_deg", "time_s"):
        assert getattr(again, name).tobytes() == getattr(ideal, name).tobytes(), name
    assert again.object_id is None
    assert describe(tmp_path / f"a{suffix}").facts == {"rows with no hit": 1, "rows by material": {"2": 1, "7": 1}}


def test_las_holds_no_ideal_scan(tmp_path: Path) -> None:
    ideal = IdealScan(*[np.ones(1)] * 5)
    with pytest.raises(InputError, match="LAS needs the column X"):
        save_ideal(ideal, tmp_path / "a.las")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("first", SUFFIXES)
@pytest.mark.parametrize("second", SUFFIXES)
def test_any_format_converts_into_any_other(tmp_path: Path, first: str, second: str) -> None:
    content = "X Y Z Point Layer EchoNumber WIDTH AREA PEAK INTENSITY\n1.5 -2.25 3 331.0 295.0 1 39 6007 236 0.5\n"
    (tmp_path / "a.txt").write_text(content)
    convert(tmp_path / "a.txt", tmp_path / f"b{first}")
    convert(tmp_path / f"b{first}", tmp_path / f"c{second}")
    scan = load_scan(tmp_path / f"c{second}")
    assert (scan.x_m[0], scan.y_m[0], scan.z_m[0]) == (1.5, -2.25, 3)
    assert [getattr(scan, name)[0] for name in FIELDS] == [295, 331, 1, 39, 6007, 236]
    assert scan.extra["INTENSITY"].tolist() == [0.5]
    assert scan.defaulted == ()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_format_is_told_by_content_not_by_name(tmp_path: Path, suffix: str) -> None:
    named = tmp_path / f"scan{suffix}"
    save_scan(Scan(*[np.ones(3)] * 9), named)
    bare = tmp_path / "scan.dat"
    named.rename(bare)
    assert recognise(bare) == target_format(f"x{suffix.upper()}").name
    assert len(load_scan(bare)) == 3


def test_text_under_a_binary_name_is_read_as_the_text_it_is(tmp_path: Path) -> None:
    path = tmp_path / "scan.parquet"
    path.write_text("X,Y,Z\n1,2,3\n")
    assert recognise(path) == "csv"
    assert load_scan(path).z_m.tolist() == [3]


def test_a_point_cloud_from_ranges_gets_positions(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("Layer Point RANGE\n260 480 10\n")
    for suffix in (".pcd", ".las", ".ply"):
        convert(tmp_path / "a.txt", tmp_path / f"b{suffix}")
        assert load_scan(tmp_path / f"b{suffix}").range_m == pytest.approx([10.0])
    convert(tmp_path / "a.txt", tmp_path / "c.csv")
    assert (tmp_path / "c.csv").read_text() == "Layer,Point,RANGE\n260,480,10\n"


def test_text_converts_whole_numbers_as_such(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("X Y Z Layer EchoNumber\n1 2 3 331.000000 1.0\n")
    convert(tmp_path / "a.txt", tmp_path / "a.parquet")
    types = {name: column.dtype for name, column in read_table(tmp_path / "a.parquet").columns.items()}
    assert types == {"X": "f8", "Y": "f8", "Z": "f8", "Layer": "i4", "EchoNumber": "i4"}


def test_a_semantic_lidar_becomes_an_ideal_scan(tmp_path: Path) -> None:
    rows = "10 0 0 0.5 7 4\n"
    head = "".join(f"property float {name}\n" for name in ("x", "y", "z", "CosAngle"))
    head += "property uint ObjIdx\nproperty uint ObjTag\n"
    path = tmp_path / "frame.ply"
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 1\n{head}end_header\n{rows}")
    ideal = load_ideal(path)
    assert ideal.distance_m.tolist() == [10]
    assert ideal.incidence_deg.tolist() == pytest.approx([60])
    convert(path, tmp_path / "ideal.txt")
    assert load_ideal(tmp_path / "ideal.txt").material_id.tolist() == [4]
    assert describe(path).kind == "ideal"


@pytest.mark.parametrize("name", ["ouster_os0_128/scan_0", "hesai_xt32/rotation_0"])
def test_a_real_capture_through_text_and_back(tmp_path: Path, name: str) -> None:
    source = shared_path(f"data/{name}.parquet")
    convert(source, tmp_path / "a.txt")
    scan, again = load_scan(source), load_scan(tmp_path / "a.txt")
    for field in ("x_m", "y_m", "z_m", *FIELDS):
        assert getattr(again, field).tobytes() == getattr(scan, field).tobytes(), field
    assert scan.defaulted == again.defaulted == ("WIDTH", "AREA", "PEAK")
    for column in scan.extra:
        assert np.array_equal(again.extra[column], scan.extra[column])


def test_describe_recognises_what_is_no_scan() -> None:
    assert describe(shared_path("samples/vertical_lut.ini")).facts["vertical LUT"]["points"] == 31
    assert describe(shared_path("samples/Blooming_Calibration_V_SLIM.json")).kind == "settings"
    model = shared_path("data/reference_frames/SLIM_model.toml")
    with pytest.raises(InputError, match="TOML"):
        describe(model)
    from lidarcheck.model import load_model

    found = describe(model, load_model=load_model)
    assert (found.kind, found.facts["variant"]) == ("model", "SLIM")
    assert "variant          SLIM" in str(found)


def test_every_format_has_a_reader_a_writer_and_its_own_suffixes() -> None:
    suffixes = [suffix for form in FORMATS.values() for suffix in form.suffixes]
    assert len(suffixes) == len(set(suffixes))
    assert all(target_format(f"a{suffix}").name in FORMATS for suffix in suffixes)


def test_a_table_is_equally_long_columns_of_numbers(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="not 2 numbers"):
        Table({"a": np.zeros(2), "b": np.zeros(3)})
    with pytest.raises(UsageError, match="appears twice"):
        Table({"a": np.zeros(2), "A": np.zeros(2)})
    table = Table({"Layer": np.zeros(2)}, tmp_path)
    assert table.spelling("LAYER") == "Layer"
    assert table.get("none") is None
    assert table.fault("bad", row=1).lines() == [f"error: {tmp_path}: row 2: bad"]
    assert table.with_column("layer", np.zeros(2)).edited == frozenset()
    assert table.with_column("layer", np.ones(2)).edited == {"Layer"}
    assert len(Table({})) == 0
    with pytest.raises(InputError, match="column 2 has no name"):
        check_names(["a", ""], tmp_path)
    assert quoted(b"\xff" + b"a" * 50).endswith("...'")
