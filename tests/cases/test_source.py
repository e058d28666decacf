"""What a command is given, as frames: files, files of several frames, folders, patterns; and which belong together."""

from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cases.partners import beside, paired
from lidarcheck.cases.source import MOST_LOOKED_INTO, each_frame, files_in, frames_in, scan_of
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.recognise import write_table
from lidarcheck.formats.table import Table


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def beams(rows=6, **columns):
    """A table of a beam a row, at 10 m and more."""
    point = np.arange(rows)
    return {"Layer": np.full(rows, 260), "Point": 470 + point, "EchoNumber": np.ones(rows, int),
            "RANGE": 10.0 + point, **columns}  # fmt: skip


def write(*names):
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        write_table(Table(beams()), name)


def merge(name, count, **columns):
    """A file of so many frames; `columns`: a value of each frame."""
    one = beams()
    many = {key: np.tile(column, count) for key, column in one.items()}
    many |= {key: np.repeat(values, len(one["Layer"])) for key, values in columns.items()}
    many["RANGE"] = many["RANGE"] + np.repeat(np.arange(count), len(one["Layer"]))
    write_table(Table(many), name)


def names(frames):
    return [str(frame) for frame in frames]


def test_a_folder_is_read_in_the_order_of_its_numbers():
    write("drive/frame_10.csv", "drive/frame_9.csv", "drive/frame_2.parquet")
    Path("drive/frames.json").write_text("{}")
    Path("drive/.frame_3.csv.part").write_text("")
    Path("drive/README.md").write_text("a drive")
    Path("drive/more").mkdir()
    expected = ["drive/frame_2.parquet", "drive/frame_9.csv", "drive/frame_10.csv"]
    assert names(frames_in("drive")) == expected
    assert [str(file) for file in files_in("drive", "drive/frame_9.csv")] == [*expected, "drive/frame_9.csv"]
    assert names(frames_in("drive/*.csv")) == expected[1:]


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("drive/frame_3.csv.gz", "drive/frame_3.csv.gz: stands among frames and is no scan by its name"),
        ("drive/frame_2.pcd", "drive/frame_2.pcd: is named as frame_2.csv"),
    ],
)
def test_what_might_be_a_frame_is_not_passed_over(file, words):
    write("drive/frame_2.csv")
    Path(file).write_text("")
    with pytest.raises(InputError, match=words):
        frames_in("drive")


def test_nothing_there_is_said():
    Path("empty").mkdir()
    with pytest.raises(InputError, match="empty: holds no frame"):
        frames_in("empty")
    with pytest.raises(InputError, match="no file matches"):
        frames_in("empty/*.csv")


def test_the_frames_of_a_merged_file_are_its_rows():
    merge("drive.csv", 3, Frame=[4, 7, 9])
    frames = frames_in("drive.csv")
    assert names(frames) == ["drive.csv#4", "drive.csv#7", "drive.csv#9"]
    assert [frame.stem for frame in frames] == ["drive_000004", "drive_000007", "drive_000009"]
    assert [round(float(scan_of(frame).range_m[0]), 6) for frame in frames] == [10.0, 11.0, 12.0]


def test_a_wrong_row_of_a_merged_file_is_named_by_its_line():
    merge("drive.csv", 2, Frame=[0, 1])
    lines = Path("drive.csv").read_text().splitlines()
    lines[9] = lines[9].replace("260,", "-260,", 1)
    Path("drive.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError) as refused:
        scan_of(frames_in("drive.csv")[1])
    assert refused.value.line == 10


def test_each_of_many_files_is_one_frame():
    several = [f"part_{k}.csv" for k in range(MOST_LOOKED_INTO + 1)]
    for name in several:
        merge(name, 2, Frame=[0, 1])
    assert [len(group) for group in each_frame(several[:-1])] == [2] * MOST_LOOKED_INTO
    assert [len(group) for group in each_frame(several)] == [1] * len(several)
    with pytest.raises(InputError, match="holds 2 frames"):
        scan_of(each_frame(several)[0][0])


def test_partners_are_found_by_name_then_number_then_order():
    write("real/a_1.csv", "real/a_2.csv", "sim/a_2.csv", "sim/a_1.csv", "other/m10.csv", "other/m2.csv", "other/m1.csv")
    merge("three.csv", 3, Frame=[1, 2, 10])
    merge("ordered.csv", 2)
    real = frames_in("real")
    assert names(paired(real, frames_in("sim"))) == ["sim/a_1.csv", "sim/a_2.csv"]
    assert names(paired(frames_in("three.csv"), frames_in("other"))) == [
        "other/m1.csv",
        "other/m2.csv",
        "other/m10.csv",
    ]
    assert names(paired(real, frames_in("ordered.csv"))) == ["ordered.csv#0", "ordered.csv#1"]
    with pytest.raises(InputError, match=r"three.csv#10: has no frame beside it in real"):
        paired(frames_in("three.csv"), real)
    with pytest.raises(InputError, match=r"2 frames for the 3 of three.csv, which only order pairs"):
        paired(frames_in("three.csv"), frames_in("ordered.csv"))


def test_partners_by_time_are_of_the_same_moment():
    merge("a.csv", 3, timestamp=[10.0, 10.1, 10.2])
    merge("b.csv", 3, timestamp=[10.21, 10.01, 10.11])
    merge("c.csv", 3, timestamp=[20.0, 20.1, 20.2])
    a, b, c = (frames_in(f"{name}.csv") for name in "abc")
    assert a[0].frames.way == "time"
    assert [round(float(scan_of(other).range_m[0]), 6) for other in paired(a, b)] == [11.0, 12.0, 10.0]
    assert names(paired(a, c)) == names(c)  # another clock: in their order


def test_one_name_of_two_frames_pairs_nothing():
    write("x/a.csv", "y/a.csv", "sim/a.csv", "sim/b.csv")
    real = [frame for group in each_frame(["x/a.csv", "y/a.csv"]) for frame in group]
    with pytest.raises(InputError, match=r"y/a\.csv: is named as x/a\.csv"):
        paired(real, frames_in("sim"))


def test_what_stands_beside_several_arguments():
    write("one.csv", "two.csv", "ideal.csv", "d/f_1.csv", "d/f_2.csv", "e/g_1.csv", "e/g_2.csv")
    plain, folder, single = each_frame(["one.csv", "two.csv"]), each_frame(["d"]), each_frame(["ideal.csv"])
    assert names(beside(plain, single, "ideal")) == ["ideal.csv"]  # for the command to count
    assert names(beside(folder, single, "ideal")) == ["ideal.csv"] * 2
    assert names(beside(folder, each_frame(["e"]), "ideal")) == ["e/g_1.csv", "e/g_2.csv"]
    both = each_frame(["d", "one.csv"])
    assert names(beside(both, each_frame(["e", "ideal.csv"]), "ideal")) == ["e/g_1.csv", "e/g_2.csv", "ideal.csv"]
    assert names(beside(folder, each_frame(["e/g_2.csv", "e/g_1.csv"]), "ideal")) == ["e/g_1.csv", "e/g_2.csv"]
    with pytest.raises(UsageError, match="3 for --ideal and 2 scans"):
        beside(both, each_frame(["one.csv", "two.csv", "ideal.csv"]), "ideal")
