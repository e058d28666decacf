"""Ideal scans: what their optional columns may hold, what nobody knows, and what is kept."""

from pathlib import Path

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.formats import load_ideal, save_ideal
from lidarcheck.formats.convert import convert, describe
from lidarcheck.formats.ideals import ideal_from_table
from lidarcheck.formats.recognise import read_table, write_table
from lidarcheck.formats.table import Table

COLUMNS = {
    "Layer": np.array([10, 10, 11, 12]),
    "Point": np.array([20, 21, 20, 20]),
    "Distance": np.array([20.0, np.nan, 0.0, 30.0]),
    "MaterialID": np.array([1, 0, 0, 2]),
    "IncidenceAngle": np.array([5.0, np.nan, 400.0, 7.0]),
}
SUFFIXES = (".txt", ".csv", ".parquet", ".pcd", ".ply")


def ideal(**more: object) -> Table:
    return Table({**COLUMNS, **more})  # type: ignore[arg-type]


class TestUnknown:
    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_nobody_knows_is_another_thing_than_nothing(self, suffix: str, tmp_path: Path) -> None:
        write_table(ideal(), tmp_path / f"a{suffix}")
        scan = load_ideal(tmp_path / f"a{suffix}")
        np.testing.assert_array_equal(scan.distance_m, COLUMNS["Distance"])
        save_ideal(scan, tmp_path / f"b{suffix}")
        np.testing.assert_array_equal(load_ideal(tmp_path / f"b{suffix}").distance_m, COLUMNS["Distance"])
        told = describe(tmp_path / f"a{suffix}").facts
        assert (told["rows with no hit"], told["rows not known"]) == (1, 1)

    def test_other_columns_may_be_missing_there_and_only_there(self) -> None:
        nan = np.array([1.0, np.nan, np.nan, 2.0])
        scan = ideal_from_table(ideal(MaterialID=nan, Time=nan, Share=nan, ObjectID=nan))
        assert scan.material_id.tolist() == [1, 0, 0, 2]
        assert scan.time_s is not None
        assert scan.time_s.tolist() == [1, 0, 0, 2]
        for name in ("MaterialID", "Time", "Share", "ObjectID", "IncidenceAngle"):
            with pytest.raises(InputError, match=f"row 4: {name} is nan; it must be"):
                ideal_from_table(ideal(**{name: np.array([1.0, 1.0, 1.0, np.nan])}))


class TestOptionalColumns:
    def test_shares_of_a_beam_may_exceed_1(self) -> None:
        scan = ideal_from_table(ideal(Share=np.array([1.5, 0.0, 0.0, 0.25])))
        assert scan.shares().tolist() == [1.5, 0.0, 0.0, 0.25]

    @pytest.mark.parametrize(
        ("name", "wrong"),
        [
            ("Share", -0.1),
            ("Share", np.inf),
            ("Reflectance", -0.1),
            ("ReflectanceError", -1.0),
            ("DistanceError", -1.0),
            ("Azimuth0", 400.0),
            ("Edge", 2.0),
            ("Edge", 0.5),
            ("X", 1e10),
            ("Time", np.inf),
            ("Distance", np.inf),
        ],
    )
    def test_what_they_cannot_hold_is_named(self, name: str, wrong: float) -> None:
        with pytest.raises(InputError, match=f"row 4: {name} is {wrong}"):
            ideal_from_table(ideal(**{name: np.array([0.0, 1.0, 1.0, wrong])}))

    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_all_are_kept(self, suffix: str, tmp_path: Path) -> None:
        more = {
            name: np.array([0.5, np.nan, 0.25, 1.0])
            for name in ("Reflectance", "ReflectanceError", "DistanceError", "X", "Y", "Z", "Azimuth0")
        }
        table = ideal(**more, Edge=np.array([0, 1, 0, 1]), Speed=np.array([1.0, np.nan, 2.0, 3.0]))
        write_table(table, tmp_path / f"a{suffix}")
        save_ideal(load_ideal(tmp_path / f"a{suffix}"), tmp_path / f"b{suffix}")
        convert(tmp_path / f"a{suffix}", tmp_path / f"c{suffix}")
        for path in ("b", "c"):
            back = read_table(tmp_path / f"{path}{suffix}")
            for name, column in more.items():
                np.testing.assert_array_equal(back.columns[name], column)
            assert back.columns["Edge"].tolist() == [0, 1, 0, 1]
