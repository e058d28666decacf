"""What a row of a scan is: an echo, a beam without one, a copy; which echo of its beam, and of which kind."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats import load_scan, save_scan
from lidarcheck.formats.convert import convert, describe
from lidarcheck.formats.pcd import read_pcd, write_pcd
from lidarcheck.formats.recognise import read_table, write_table
from lidarcheck.formats.scans import numbers_as_written, read_scan, scan_from_table
from lidarcheck.formats.table import Table
from lidarcheck.kpi.fired import fired_beams
from lidarcheck.scan import IdealScan
from reference_grid import beam_directions

SUFFIXES = (".txt", ".csv", ".parquet", ".pcd", ".las", ".ply")


def grid(
    range_m: object = 20.0, layers: range = range(200, 204), points: range = range(400, 410), **more: object
) -> Table:
    """A row for each beam of a small grid, at 20 m."""
    layer, point = (a.ravel() for a in np.meshgrid(range(200, 204), points, indexing="ij"))
    xyz = beam_directions(layer, point) * range_m
    columns = {"X": xyz[:, 0], "Y": xyz[:, 1], "Z": xyz[:, 2], "Layer": layer, "Point": point}
    return Table({**columns, "AREA": np.arange(len(layer)) + 1.0, **more})  # type: ignore[arg-type]


def table(rows: str, names: str = "X Y Z Layer Point EchoNumber") -> Table:
    """Rows of numbers, one a line; where the beam is named, X is the range along it."""
    numbers = np.array([[float(cell) for cell in row.split()] for row in rows.strip().splitlines()])
    columns = dict(zip(names.split(), numbers.T, strict=True))
    if "Layer" in columns:
        beam = [np.nan_to_num(columns[name]).astype(int) for name in ("Layer", "Point")]
        columns |= dict(zip("XYZ", (beam_directions(*beam) * columns["X"][:, None]).T, strict=True))
    return Table(columns)


def with_values(scan: Table, mask: np.ndarray, **values: float) -> Table:
    """The table with these values in some rows."""
    for name, value in values.items():
        scan = scan.with_column(name, np.where(mask, value, scan.columns[name]))
    return scan


GRID = grid()
SOME = np.arange(len(GRID)) % 3 == 0
NO_RETURN = {
    "zeros": {"X": 0.0, "Y": 0.0, "Z": 0.0},
    "nan": {"X": np.nan, "Y": np.nan, "Z": np.nan},
    "one nan": {"Y": np.nan},
    "infinity": {"Z": np.inf},
    "range 0": {"RANGE": 0.0},
    "range nan": {"RANGE": np.nan},
    "not valid": {"valid": 0.0},
    "no return": {"no_return": 1.0},
}


class TestNoReturn:
    @pytest.mark.parametrize("case", NO_RETURN)
    def test_is_no_echo_and_its_beam_was_fired(self, case: str) -> None:
        plain = grid(RANGE=np.full(40, 20.0), valid=np.ones(40), no_return=np.zeros(40))
        scan, counts = read_scan(with_values(plain, SOME, **NO_RETURN[case]))
        assert counts.no_return == SOME.sum()
        np.testing.assert_array_equal(scan.area, GRID.columns["AREA"][~SOME])
        assert scan.fired is not None
        np.testing.assert_array_equal(scan.fired.has(plain.columns["Layer"], plain.columns["Point"]), True)
        assert len(scan.fired) == 40

    def test_without_positions_a_range_of_0_says_it(self) -> None:
        plain = grid(RANGE=np.where(SOME, 0.0, 20.0))
        scan, counts = read_scan(Table({name: plain.columns[name] for name in ("Layer", "Point", "RANGE")}))
        assert counts.no_return == SOME.sum()
        np.testing.assert_allclose(scan.range_m, 20.0)
        assert len(scan.fired or ()) == 40

    @pytest.mark.parametrize("name", ["rgb", "normal_x", "NEAR_IR", "Layer2"])
    def test_a_missing_value_elsewhere_is_none(self, name: str) -> None:
        scan, counts = read_scan(grid(**{name: np.where(SOME, np.nan, 1.0)}))
        assert counts.no_return == 0
        assert len(scan) == 40
        assert scan.fired is None
        np.testing.assert_array_equal(np.isnan(scan.extra[name]), SOME)

    def test_a_missing_feature_is_kept_and_refused_where_it_counts(self) -> None:
        some = with_values(GRID, SOME, AREA=np.nan)
        np.testing.assert_array_equal(np.isnan(read_scan(some)[0].area), SOME)
        with pytest.raises(InputError, match="row 1: AREA is nan; it must be a finite number"):
            scan_from_table(some)
        light = grid(Intensity=np.where(SOME, np.nan, 1.0))
        np.testing.assert_array_equal(np.isnan(read_scan(light)[0].extra["Intensity"]), SOME)
        with pytest.raises(InputError, match="row 1: Intensity is nan; it must be a finite number"):
            scan_from_table(light)
        # A column without any value is no column.
        assert not scan_from_table(grid(SIGNAL=np.full(40, np.nan))).extra
        assert "AREA" in scan_from_table(with_values(GRID, SOME | True, AREA=np.nan)).defaulted

    def test_its_other_columns_may_hold_anything(self) -> None:
        odd = with_values(GRID, SOME, X=np.nan, AREA=np.nan, Y=1e30)
        assert len(scan_from_table(odd)) == np.count_nonzero(~SOME)

    def test_errors_name_the_rows_of_the_file(self) -> None:
        with pytest.raises(InputError, match="row 3: Layer is nan"):
            scan_from_table(table("0 0 0 1 2 1\n1 2 3 4 5 1\n1 2 3 nan 5 1"))

    def test_flags_of_another_meaning_are_none(self) -> None:
        assert read_scan(grid(valid=np.full(40, 7.0)))[1].no_return == 0

    def test_features_of_float32_have_no_other_limits(self) -> None:
        scan = scan_from_table(grid(INTENSITY=np.full(40, 3e38, dtype=np.float32), PEAK=np.ones(40, dtype=np.float16)))
        assert scan.peak.tolist() == [1.0] * 40


class TestFired:
    def test_one_stray_row_tells_nothing_of_the_other_beams(self) -> None:
        kept = np.flatnonzero(np.arange(40) % 3 != 0)
        some = with_values(GRID.take(kept), np.arange(len(kept)) == 3, X=np.nan)
        scan, counts = read_scan(some)
        assert counts.no_return == 1
        assert scan.fired is None
        n = len(GRID)
        ideal = IdealScan(
            GRID.columns["Layer"], GRID.columns["Point"], np.full(n, 20.0), np.ones(n, np.int32), np.zeros(n)
        )
        fired = fired_beams(scan, ideal)
        assert fired is not None
        assert (fired.source, len(fired)) == ("ideal", n)

    def test_a_column_that_is_cut_off_does_no_harm(self) -> None:
        wide = grid(points=range(400, 440))
        cut = with_values(wide.take(np.flatnonzero(np.arange(160) != 159)), np.arange(159) % 2 == 0, Z=np.nan)
        assert len(read_scan(cut)[0].fired or ()) == 159

    def test_nor_does_a_lost_column_but_a_single_hole_does(self) -> None:
        wide = with_values(grid(points=range(400, 440)), np.arange(160) % 2 == 0, Z=np.nan)
        point = wide.columns["Point"]
        lost = read_scan(wide.take(np.flatnonzero(point != 420)))[0]
        assert len(lost.fired or ()) == 156
        assert read_scan(wide.take(np.flatnonzero((point != 420) | (wide.columns["Layer"] != 201))))[0].fired is None

    def test_beams_that_no_row_names_are_not_known(self) -> None:
        some = with_values(GRID, SOME, X=0.0, Y=0.0, Z=0.0)
        scan, counts = read_scan(Table({name: some.columns[name] for name in ("X", "Y", "Z", "AREA")}))
        assert scan.fired is None
        assert (counts.no_return, counts.unplaced) == (SOME.sum(), SOME.sum())
        assert fired_beams(scan) is None

    def test_each_frame_has_its_own(self) -> None:
        two = Table({name: np.tile(column, 2) for name, column in GRID.columns.items()})
        two = two.with_column("Frame", np.repeat([7, 8], 40))
        odd = with_values(two, np.arange(80) >= 60, X=np.nan)
        fired = read_scan(odd)[0].fired
        assert fired is not None
        assert [len(fired), len(fired.of_frame(7)), len(fired.of_frame(8))] == [80, 40, 40]

    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_written_and_read_again_they_are_the_same(self, suffix: str, tmp_path: Path) -> None:
        plain = with_values(grid(EchoNumber=np.ones(40), Signal=np.ones(40)), SOME, X=np.nan)
        scan = scan_from_table(plain)
        save_scan(scan, tmp_path / f"a{suffix}")
        back = load_scan(tmp_path / f"a{suffix}")
        assert scan.fired is not None
        assert back.fired is not None
        np.testing.assert_array_equal(back.fired.layer, scan.fired.layer)
        np.testing.assert_array_equal(back.fired.point, scan.fired.point)
        np.testing.assert_array_equal(back.area, scan.area)


class TestConvert:
    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_rows_without_a_return_stay(self, suffix: str, tmp_path: Path) -> None:
        write_table(with_values(GRID, SOME, X=np.nan, Y=np.nan, Z=np.nan), tmp_path / "a.parquet")
        convert(tmp_path / "a.parquet", tmp_path / f"b{suffix}")
        back = read_table(tmp_path / f"b{suffix}")
        assert len(back) == 40
        assert read_scan(back)[1].no_return == SOME.sum()
        np.testing.assert_array_equal(back.columns["AREA"], GRID.columns["AREA"])
        again = load_scan(tmp_path / f"b{suffix}")
        assert len(again.fired or ()) == 40

    def test_a_point_cloud_has_them_as_nan(self, tmp_path: Path) -> None:
        write_table(with_values(GRID, SOME, X=0.0, Y=0.0, Z=0.0), tmp_path / "a.txt")
        convert(tmp_path / "a.txt", tmp_path / "b.pcd")
        np.testing.assert_array_equal(np.isnan(read_pcd(tmp_path / "b.pcd").columns["Y"]), SOME)
        # One that has zeros already is another encoding of itself, and nothing else.
        write_pcd(with_values(GRID, SOME, X=0.0, Y=0.0, Z=0.0), tmp_path / "c.pcd", "binary")
        convert(tmp_path / "c.pcd", tmp_path / "d.pcd")
        np.testing.assert_array_equal(read_pcd(tmp_path / "d.pcd").columns["Y"] == 0.0, SOME)

    def test_an_organised_cloud_stays_one(self, tmp_path: Path) -> None:
        cloud = with_values(GRID, SOME, X=np.nan, Y=np.nan, Z=np.nan)
        write_pcd(replace(cloud, height=4), tmp_path / "a.pcd", "binary")
        assert b"WIDTH 10\nHEIGHT 4\n" in (tmp_path / "a.pcd").read_bytes()
        convert(tmp_path / "a.pcd", tmp_path / "b.pcd")
        back = read_pcd(tmp_path / "b.pcd")
        assert back.height == 4
        np.testing.assert_array_equal(np.isnan(back.columns["X"]), SOME)
        convert(tmp_path / "b.pcd", tmp_path / "c.pcd", drop_empty=True)
        assert read_pcd(tmp_path / "c.pcd").height == 1

    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_or_are_left_out(self, suffix: str, tmp_path: Path) -> None:
        write_table(with_values(GRID, SOME, X=np.nan), tmp_path / "a.txt")
        convert(tmp_path / "a.txt", tmp_path / f"b{suffix}", drop_empty=True)
        back = read_table(tmp_path / f"b{suffix}")
        assert len(back) == np.count_nonzero(~SOME)
        np.testing.assert_array_equal(back.columns["AREA"], GRID.columns["AREA"][~SOME])

    def test_positions_of_ranges_are_none_where_there_was_no_return(self, tmp_path: Path) -> None:
        plain = grid(RANGE=np.where(SOME, 0.0, 20.0))
        write_table(Table({name: plain.columns[name] for name in ("Layer", "Point", "RANGE")}), tmp_path / "a.csv")
        for suffix, zero in ((".las", 0.0), (".pcd", np.nan), (".ply", 0.0)):
            convert(tmp_path / "a.csv", tmp_path / f"b{suffix}")
            np.testing.assert_array_equal(read_table(tmp_path / f"b{suffix}").columns["X"][SOME], zero)

    def test_text_stays_as_it_was(self, tmp_path: Path) -> None:
        content = b"X,Y,Z,Layer,Point,EchoNumber\nnan,nan,nan,4,5,1\n1.0,2,3,4,6,0\n0.0,0,-0,4,7,9\n"
        (tmp_path / "a.csv").write_bytes(content)
        convert(tmp_path / "a.csv", tmp_path / "b.csv")
        assert (tmp_path / "b.csv").read_bytes() == content


class TestEchoNumbers:
    def test_one_odd_number_changes_no_other_row(self) -> None:
        for odd in (0, 2, 7, np.nan):
            numbers = np.ones(40)
            numbers[5] = odd
            scan, counts = read_scan(grid(EchoNumber=numbers))
            np.testing.assert_array_equal(scan.echo_number, 1)
            assert counts.renumbered == 1
            np.testing.assert_array_equal(numbers_as_written(scan), numbers)

    def test_each_beam_by_range(self) -> None:
        rows = table("20 0 0 1 1 1\n5 0 0 1 1 2\n9 0 0 1 1 0\n7 0 0 2 1 0\n8 0 0 2 1 1\n4 0 0 3 1 1\n5 0 0 3 1 2")
        scan, counts = read_scan(rows)
        assert scan.echo_number.tolist() == [3, 1, 2, 1, 2, 1, 2]
        assert counts.renumbered == 2
        assert scan.extra["EchoNumberRaw"].tolist() == [1, 2, 0, 0, 1, 1, 2]

    def test_frames_are_apart(self) -> None:
        rows = table("20 0 0 1 1 1 7\n5 0 0 1 1 1 8", "X Y Z Layer Point EchoNumber frame_id")
        scan, counts = read_scan(rows)
        assert scan.echo_number.tolist() == [1, 1]
        assert counts.renumbered == 0

    def test_right_numbers_need_no_second_column(self) -> None:
        for order in ([0, 1, 2, 3], [2, 3, 0, 1], [3, 1, 0, 2]):
            rows = table("4 0 0 1 1 1\n5 0 0 1 1 2\n4 0 0 1 2 1\n9 0 0 1 2 2").take(np.array(order))
            scan, counts = read_scan(rows)
            np.testing.assert_array_equal(scan.echo_number, rows.columns["EchoNumber"])
            assert (counts.renumbered, dict(scan.extra)) == (0, {})

    def test_without_numbers_they_follow_from_the_ranges(self) -> None:
        scan, counts = read_scan(table("20 0 0 1 1\n5 0 0 1 1\n9 0 0 2 1", "X Y Z Layer Point"))
        assert scan.echo_number.tolist() == [2, 1, 1]
        assert "EchoNumber" in scan.defaulted
        assert counts.renumbered == 0

    def test_where_the_file_names_no_beams_only_a_place_numbered_from_0_is_raised(self) -> None:
        rows = table("20 0 0 0\n25 0 0 1\n20 2 0 1\n25 2.5 0 2\n30 -4 0 2", "X Y Z EchoNumber")
        scan, counts = read_scan(rows)
        assert scan.echo_number.tolist() == [1, 2, 1, 2, 2]
        assert counts.renumbered == 1

    def test_they_survive_being_written(self, tmp_path: Path) -> None:
        scan = scan_from_table(table("20 0 0 1 1 1\n5 0 0 1 1 2\n7 0 0 2 1 0"))
        save_scan(scan, tmp_path / "a.txt")
        back, counts = read_scan(read_table(tmp_path / "a.txt"))
        np.testing.assert_array_equal(back.echo_number, scan.echo_number)
        np.testing.assert_array_equal(numbers_as_written(back), [1, 2, 0])
        assert counts.renumbered == 0

    def test_a_fraction_is_refused(self) -> None:
        with pytest.raises(InputError, match=r"row 2: EchoNumber is 1.5; it must be a whole number from 0"):
            read_scan(table("4 0 0 1 1 1\n5 0 0 1 1 1.5"))


class TestCopies:
    NAMES = "X Y Z Layer Point EchoNumber AREA"

    def test_count_once(self) -> None:
        rows = table("20 0 0 1 1 1 7\n20.004 0 0 1 1 2 7\n20 0 0 1 2 1 7\n30 0 0 1 2 2 7", self.NAMES)
        scan, counts = read_scan(rows)
        np.testing.assert_allclose(scan.range_m, [20, 20, 30])
        assert scan.echo_number.tolist() == [1, 1, 2]
        assert counts.copies == 1

    @pytest.mark.parametrize(
        "rows",
        [
            "20 0 0 1 1 1 7\n20.006 0 0 1 1 2 7",  # another range
            "20 0 0 1 1 1 7\n20 0 0 1 1 2 8",  # another feature
            "20 0 0 1 1 1 7\n20 0 0 1 1 1 7",  # the same number: two frames
            "20 0 0 1 1 1 7\n20 0 0 1 2 2 7",  # another beam
        ],
    )
    def test_what_is_no_copy(self, rows: str) -> None:
        assert read_scan(table(rows, self.NAMES))[1].copies == 0

    def test_without_numbers_a_copy_stands_beside_its_twin(self) -> None:
        names = "X Y Z Layer Point AREA"
        assert read_scan(table("20 0 0 1 1 7\n20 0 0 1 1 7\n9 0 0 1 2 7", names))[1].copies == 1
        assert read_scan(table("20 0 0 1 1 7\n9 0 0 1 2 7\n20 0 0 1 1 7", names))[1].copies == 0

    def test_where_the_file_names_no_beams_its_position_is_the_same(self) -> None:
        names = "X Y Z intensity"
        assert read_scan(table("20 1 0 7\n20 1 0 7\n20 1.0001 0 7\n9 1 0 7", names))[1].copies == 1

    def test_copies_of_another_kind_are_identical(self) -> None:
        names = "X Y Z Layer Point EchoNumber AREA ReturnType"
        rows = table("20 0 0 1 1 1 7 3\n20 0 0 1 1 2 7 1\n20 0 0 1 2 1 7 3\n30 0 0 1 2 2 7 1", names)
        scan = scan_from_table(rows.with_column("ReturnType", np.array([3, 1, 3, 1])))
        assert scan.extra["ReturnType"].tolist() == [6, 3, 1]


class TestReturnKinds:
    def kinds(self, names: str, rows: str) -> list[int]:
        made = table(rows, names)
        whole = {name: column.astype(int) for name, column in made.columns.items() if name not in "XYZ"}
        return list(scan_from_table(Table({**made.columns, **whole})).extra.get("ReturnType", []))

    def test_livox(self) -> None:
        assert self.kinds("X Y Z line tag", "1 2 3 0 0\n1 2 4 0 16\n1 2 5 0 35\n1 3 5 1 12") == [2, 7, 0, 2]
        scan = scan_from_table(
            Table({**table("1 2 3\n2 4 6", "X Y Z").columns, "line": np.array([0, 0]), "tag": np.array([0, 16])})
        )
        assert scan.echo_number.tolist() == [1, 2]

    def test_a_tag_of_another_program_says_nothing(self) -> None:
        assert self.kinds("X Y Z tag", "1 2 3 0\n1 2 4 16") == []
        assert self.kinds("X Y Z line tag", "1 2 3 0 0\n1 2 4 0 3") == []

    def test_velodyne(self) -> None:
        names = "X Y Z ring column return_type"
        assert self.kinds(names, "1 2 3 0 0 1\n1 2 4 0 0 2\n1 2 5 0 1 3") == [3, 1, 10]

    def test_nebula(self) -> None:
        assert self.kinds("X Y Z channel return_type", "1 2 3 0 1\n1 2 4 0 8\n1 2 5 0 77") == [1, 8, 0]

    def test_hesai(self) -> None:
        names = "X Y Z Layer Point return_mode"
        assert self.kinds(names, "1 0 0 1 1 55\n2 0 0 1 2 56") == [3, 1]
        both = "9 0 0 1 1 57\n4 0 0 1 1 57\n4 0 0 1 2 59\n9 0 0 1 2 59\n4 0 0 1 3 60\n9 0 0 1 3 60\n5 0 0 1 4 57"
        assert self.kinds(names, both) == [1, 3, 2, 1, 2, 3, 0]
        assert self.kinds(names, "1 0 0 1 1 62\n2 0 0 1 1 62") == [0, 0]
        assert self.kinds(names, "1 0 0 1 1 1\n2 0 0 1 2 2") == []


class TestInfo:
    def test_says_what_the_rows_are(self, tmp_path: Path) -> None:
        some = with_values(grid(EchoNumber=np.where(np.arange(40) == 1, 0, 1), rgb=np.full(40, np.nan)), SOME, X=np.nan)
        write_table(some, tmp_path / "a.txt")
        told = describe(tmp_path / "a.txt")
        assert told.rows == 40
        assert told.facts["no return"] == "14 rows"
        assert told.facts["fired beams"] == "40, 14 without an echo"
        assert told.facts["renumbered"] == "the echoes of 1 beam, by range from 1"
        assert "missing" in str(told)
        rgb = next(column for column in told.columns if column.name == "rgb")
        assert (rgb.low, rgb.missing) == (None, 40)

    def test_a_plain_file_has_no_such_lines(self, tmp_path: Path) -> None:
        write_table(grid(EchoNumber=np.ones(40)), tmp_path / "a.txt")
        told = describe(tmp_path / "a.txt")
        assert set(told.facts) == {"geometry"}
        assert "missing " not in str(told).replace("missing columns", "")


def test_a_time_unit_without_a_time_is_refused(tmp_path: Path) -> None:
    write_table(GRID, tmp_path / "a.csv")
    with pytest.raises(UsageError, match="no time"):
        convert(tmp_path / "a.csv", tmp_path / "b.csv", time_unit="ns")
    assert not (tmp_path / "b.csv").exists()
