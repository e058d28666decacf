"""PCD, LAS/LAZ and PLY: what is written reads back; what cannot be written leaves the file alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from binary_kinds import EXACT, KIND, KINDS, make_table, message_of, written
from budget import examples
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats import load_scan, save_scan
from lidarcheck.formats.las import read_las, write_las
from lidarcheck.formats.pcd import read_pcd, write_pcd
from lidarcheck.formats.pcd_header import ENCODINGS as PCD_ENCODINGS
from lidarcheck.formats.ply import read_ply, write_ply
from lidarcheck.formats.recognise import recognise
from lidarcheck.formats.table import Table
from lidarcheck.scan import Scan


@KIND
@pytest.mark.parametrize("rows", [0, 1, 30])
def test_what_is_written_reads_back(kind: str, rows: int, tmp_path: Path) -> None:
    table = make_table(rows)
    back = KINDS[kind][2](written(kind, table, tmp_path))
    assert set(back.names) == set(table.names)
    if kind in EXACT:
        assert back.names == table.names
    for name in table.names:
        read, column = back.columns[name], table.columns[name]
        assert read.dtype == column.dtype, name
        if kind not in EXACT and name in "XYZ":
            np.testing.assert_allclose(read, column, rtol=0, atol=0.501e-6)
        else:
            np.testing.assert_array_equal(read, column)


COLUMN = st.sampled_from(["f4", "f8", "i1", "i2", "i4", "u1", "u2", "u4", "i8"])


@st.composite
def _columns(draw: st.DrawFn) -> dict[str, Any]:
    rows = draw(st.integers(0, 5))
    names = draw(st.lists(st.from_regex(r"[A-Za-z][A-Za-z0-9_.]{0,20}", fullmatch=True), min_size=1, max_size=5))
    unique = {name.casefold(): name for name in names}.values()
    columns = {}
    for name in unique:
        kind = np.dtype(draw(COLUMN))
        if kind.kind == "f":
            cells = st.floats(width=8 * kind.itemsize, allow_nan=False, allow_infinity=False)
        else:
            limits = np.iinfo(kind if kind.itemsize < 8 else np.int32)
            cells = st.integers(int(limits.min), int(limits.max))
        columns[name] = draw(hnp.arrays(kind, rows, elements=cells))
    return columns


@pytest.mark.parametrize("kind", EXACT)
@settings(max_examples=examples(40), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(columns=_columns())
def test_any_columns_come_back_bit_for_bit(kind: str, columns: dict[str, Any], tmp_path: Path) -> None:
    back = KINDS[kind][2](written(kind, Table(columns), tmp_path))
    assert list(back.names) == list(columns)
    for name, column in columns.items():
        read = back.columns[name]
        if column.dtype == np.int64:
            assert read.dtype in (np.int32, np.uint32)
        else:
            assert read.dtype == column.dtype
        assert np.array_equal(read, column)
        if column.dtype.kind == "f":
            assert np.array_equal(np.signbit(read), np.signbit(column))


@pytest.mark.parametrize("kind", ["las", "laz"])
@settings(max_examples=examples(40), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(columns=_columns(), span=st.sampled_from([1.0, 300.0, 2147.0, 5e3, 1e5]), offset=st.sampled_from([0.0, 4.5e6]))
def test_las_keeps_extra_dimensions_exactly(
    kind: str, columns: dict[str, Any], span: float, offset: float, tmp_path: Path
) -> None:
    others = {name: column for name, column in columns.items() if name.casefold() not in "xyz"}
    rows = len(next(iter(columns.values())))
    xyz = {axis: offset + np.linspace(-span, span / 3, rows) for axis in "xYZ"}
    back = KINDS[kind][2](written(kind, Table({**others, **xyz}), tmp_path))
    assert {name.casefold() for name in back.names} == {name.casefold() for name in [*others, *xyz]}
    for name, column in others.items():
        assert np.array_equal(back.columns[name], column)
        assert back.columns[name].dtype == (np.int32 if column.dtype == np.int64 else column.dtype)
    for axis, column in xyz.items():
        step = 1e-6 if span <= 2147 and not offset else max(1e-6, span / 2e9 * 10)
        np.testing.assert_allclose(back.get(axis), column, rtol=1e-15, atol=step)


def test_pcd_keeps_64_bit_integers(tmp_path: Path) -> None:
    stamps = np.array([2**62 + 1, -(2**63), 5], dtype=np.int64)
    large = np.array([2**63 - 1, 0, 1], dtype=np.uint64)
    for encoding in PCD_ENCODINGS:
        write_pcd(Table({"t": stamps, "u": large}), tmp_path / "a.pcd", encoding)
        back = read_pcd(tmp_path / "a.pcd")
        assert np.array_equal(back.columns["t"], stamps)
        assert np.array_equal(back.columns["u"], large)


def test_ply_has_no_64_bit_integers(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    write_ply(Table({"a": np.array([0, 2**32 - 1]), "b": np.array([-1, 2**40])}), path)
    back = read_ply(path)
    assert back.columns["a"].dtype == np.uint32
    assert back.columns["b"].dtype == np.float64
    assert back.columns["b"].tolist() == [-1, 2**40]
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"2\^53"):
        write_ply(Table({"a": np.array([2**53 + 1])}), path)
    assert path.read_bytes() == before


@KIND
def test_noise_and_constants_survive(kind: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    columns = {axis: np.zeros(1000) for axis in "XYZ"} | {"noise": rng.integers(0, 2**32, 1000).astype(np.uint32)}
    back = KINDS[kind][2](written(kind, Table(columns), tmp_path))
    assert np.array_equal(back.columns["noise"], columns["noise"])
    assert not back.columns["Z"].any()


@KIND
def test_a_scan_round_trips_by_suffix_and_content(kind: str, tmp_path: Path) -> None:
    layer, point = np.array([0, 259, 519]), np.array([0, 480, 959])
    scan = Scan.from_beams(
        layer,
        point,
        np.array([5.0, 100.25, 299.99]),
        echo_number=np.array([1, 2, 3]),
        width_ns=np.array([7.0, 8.0, 9.0]),
        area=np.array([70.0, 80.0, 90.5]),
        peak=np.array([10.0, 20.0, 30.0]),
    )
    path = tmp_path / KINDS[kind][0]
    save_scan(scan, path)
    nameless = path.rename(tmp_path / "unnamed")
    back = load_scan(nameless)
    np.testing.assert_array_equal(back.layer, scan.layer)
    np.testing.assert_array_equal(back.area, scan.area)
    np.testing.assert_allclose(back.range_m, scan.range_m, rtol=0, atol=2e-6)
    assert back.defaulted == ()
    assert recognise(nameless) == path.suffix[1:].replace("laz", "las")


@KIND
def test_a_refused_table_leaves_the_file_as_it_was(kind: str, tmp_path: Path) -> None:
    path = written(kind, make_table(), tmp_path)
    before = path.read_bytes()
    ones = {axis: np.ones(2) for axis in "XYZ"}
    with pytest.raises(InputError, match="there is no column"):
        KINDS[kind][1](Table({}), path)
    if kind.startswith("la"):
        for columns in (
            {"X": np.ones(2), "Y": np.ones(2)},
            ones | {"n" * 33: np.ones(2)},
            ones | {"X": np.array([0, 1e12])},
            ones | {"Y": np.array([0, np.nan])},
            ones | {f"c{i}": np.ones(2) for i in range(400)},
        ):
            with pytest.raises(InputError):
                KINDS[kind][1](Table(columns), path)
    else:
        with pytest.raises(InputError, match="rename"):
            KINDS[kind][1](Table({"": np.ones(2)}), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_unknown_encodings(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="use one of ascii"):
        write_pcd(make_table(), tmp_path / "a.pcd", "zip")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="use one of ascii"):
        write_ply(make_table(), tmp_path / "a.ply", "zip")  # type: ignore[arg-type]


@KIND
def test_missing_and_empty_files(kind: str, tmp_path: Path) -> None:
    read = KINDS[kind][2]
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "none")
    assert "empty" in message_of(read, tmp_path / "empty", b"")
    with pytest.raises(InputError):
        read(tmp_path)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_gives_back_short_decimals(suffix: str, tmp_path: Path) -> None:
    """Coordinates with up to six decimals are the same float64 afterwards."""
    values = np.array([-8.1742, 24.341801, 0.795738, 0.1, 299.999999])
    write_las(Table(dict.fromkeys("XYZ", values)), tmp_path / f"a{suffix}")
    assert np.array_equal(read_las(tmp_path / f"a{suffix}").columns["X"], values)
