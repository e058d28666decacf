"""When rows were measured: which column says it, in which unit, and from when on."""

from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.errors import UsageError
from lidarcheck.formats.convert import convert, describe
from lidarcheck.formats.recognise import read_table, write_table
from lidarcheck.formats.table import Table
from lidarcheck.formats.times import Clock, clock_of, seconds

EPOCH_NS = 1_639_432_010_123_456_789
FRAME = np.linspace(0.0, 0.0999, 1000)


def told(columns: dict[str, np.ndarray]) -> tuple[str, str]:
    clock = clock_of(columns)
    assert clock is not None
    return clock.unit, clock.said_by


class TestUnit:
    @pytest.mark.parametrize(
        ("name", "values", "unit", "said_by"),
        [
            ("t", (FRAME * 1e9).astype("u4"), "ns", "its name"),
            ("offset_time", (FRAME * 1e9).astype("u4"), "ns", "its name"),
            ("time", FRAME.astype("f4"), "s", "its name"),
            ("Time", FRAME - 0.1, "s", "its name"),
            ("TIME", FRAME + EPOCH_NS * 1e-9, "s", "its name"),
            ("timestamp", FRAME + EPOCH_NS * 1e-9, "s", "its digits"),
            ("timestamp", EPOCH_NS + FRAME * 1e9, "ns", "its digits"),
            ("timestamp", (EPOCH_NS // 1000 + FRAME * 1e6).astype("i8"), "us", "its digits"),
            ("timestamp", FRAME + 17.0, "s", "the length of a frame"),
            ("timestamp", (FRAME * 1e6 + 530_000_000).astype("i8"), "us", "the length of a frame"),
            ("timestamp", (FRAME * 1e9 + 2_444_124_311_890).astype("i8"), "ns", "the length of a frame"),
            # A date in ms, if a frame could last 100 s.
            ("timestamp", (EPOCH_NS // 1_000_000 + FRAME * 1e6).astype("i8"), "us", "the length of a frame"),
            # Values that cannot be what the name says.
            ("time", EPOCH_NS + np.arange(5), "ns", "its digits"),
            ("time", (FRAME * 1e6).astype("i8"), "us", "the length of a frame"),
            ("t", FRAME, "s", "the length of a frame"),
        ],
    )
    def test_of_whole_frames(self, name: str, values: np.ndarray, unit: str, said_by: str) -> None:
        assert told({"X": np.zeros(len(values)), name: values}) == (unit, said_by)

    @pytest.mark.parametrize(
        "values",
        [
            np.arange(20) + 530_000_000,  # a piece of a frame, in any unit
            np.arange(20) * 10_000_000 + 2_444_124_311_890,  # 2444 s in ns, or a date of 2047 in ms
            np.full(1000, 5),
            np.zeros(0),
        ],
    )
    def test_is_not_guessed(self, values: np.ndarray) -> None:
        with pytest.raises(UsageError, match="give it with --time-unit"):
            clock_of({"timestamp": values})
        assert clock_of({"timestamp": values}, "us") == Clock("timestamp", "us", "you")

    def test_of_several_frames_the_longest_counts(self) -> None:
        columns = {
            "Frame": np.repeat([4, 5, 9], 1000),
            "timestamp": np.tile(FRAME * 1e3, 3) + np.repeat([0, 1e5, 1e6], 1000),
        }
        assert told(columns) == ("ms", "the length of a frame")

    def test_whole_numbers_go_first(self) -> None:
        columns = {"time": FRAME, "t": (FRAME * 1e9).astype("u4")}
        clock = clock_of(columns)
        assert clock is not None
        assert clock.column == "t"
        assert clock_of({"X": FRAME}) is None


class TestSeconds:
    def test_no_digit_is_lost(self) -> None:
        for kind in ("i8", "u8"):
            columns = {"time": np.array([EPOCH_NS, EPOCH_NS + 1, EPOCH_NS + 2], dtype=kind)}
            clock = clock_of(columns)
            assert clock is not None
            np.testing.assert_allclose(seconds(columns, clock), [0.0, 1e-9, 2e-9], rtol=1e-12)

    def test_from_the_frames_start_they_stay(self) -> None:
        columns = {"t": np.array([50_000, 99_000_000], dtype="u4")}
        np.testing.assert_allclose(seconds(columns, Clock("t", "ns", "its name")), [5e-5, 0.099])

    def test_negative_times_count_back_from_the_end(self) -> None:
        columns = {"time": np.array([-0.0999, -0.05, 0.0])}
        np.testing.assert_allclose(seconds(columns, Clock("time", "s", "its name")), [0.0, 0.0499, 0.0999])

    def test_absolute_times_begin_with_each_frame(self) -> None:
        columns = {"frame_id": np.array([2, 1, 2, 1]), "timestamp": np.array([300, 100, 305, 102]) + EPOCH_NS}
        np.testing.assert_allclose(
            seconds(columns, Clock("timestamp", "ns", "its digits")), [0.0, 0.0, 5e-9, 2e-9], rtol=1e-12
        )

    def test_a_missing_time_is_missing_alone(self) -> None:
        columns = {"time": np.array([np.nan, -0.05, 0.0])}
        np.testing.assert_allclose(seconds(columns, Clock("time", "s", "its name")), [np.nan, 0.0, 0.05])


class TestCommands:
    def written(self, path: Path, **columns: np.ndarray) -> Path:
        n = len(next(iter(columns.values())))
        write_table(Table({"X": np.full(n, 5.0), "Y": np.ones(n), "Z": np.ones(n), **columns}), path)
        return path

    def test_info(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        path = self.written(tmp_path / "a.parquet", time=EPOCH_NS + np.arange(5))
        assert describe(path).facts["time"] == "time in ns by its digits, 0 ... 4e-09 s from the frame's start"
        path = self.written(tmp_path / "b.csv", timestamp=np.arange(20) + 530_000_000)
        assert "give it with --time-unit" in describe(path).facts["time"]
        assert main(["info", str(path), "--time-unit", "us", "--quiet"]) == 0
        assert "timestamp in us by you" in capsys.readouterr().out

    @pytest.mark.parametrize("suffix", [".txt", ".csv", ".parquet", ".pcd", ".las"])
    def test_convert_keeps_all_digits_and_adds_seconds_if_asked(self, suffix: str, tmp_path: Path) -> None:
        times = EPOCH_NS + np.array([0, 5, 250])
        path = self.written(tmp_path / "a.parquet", timestamp=times)
        convert(path, tmp_path / f"b{suffix}")
        back = read_table(tmp_path / f"b{suffix}")
        assert back.columns["timestamp"].tolist() == times.tolist()
        assert back.spelling("Time") is None
        assert main(["convert", str(path), str(tmp_path / f"c{suffix}"), "--time-unit", "ns", "--quiet"]) == 0
        back = read_table(tmp_path / f"c{suffix}")
        assert back.columns["timestamp"].tolist() == times.tolist()
        np.testing.assert_allclose(back.columns["Time"], [0.0, 5e-9, 2.5e-7], rtol=1e-12)

    def test_a_column_time_makes_room_for_the_seconds(self, tmp_path: Path) -> None:
        path = self.written(tmp_path / "a.csv", time=EPOCH_NS + np.arange(2))
        convert(path, tmp_path / "b.csv", time_unit="ns")
        back = read_table(tmp_path / "b.csv")
        assert back.columns["TimeRaw"].tolist() == [EPOCH_NS, EPOCH_NS + 1]
        assert back.columns["Time"].tolist() == [0.0, 1e-9]
        assert describe(tmp_path / "b.csv").facts["time"].startswith("Time in s by its name")
