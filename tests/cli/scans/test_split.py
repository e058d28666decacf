"""`lidarcheck split`: files of several frames, told apart and written a file each; and who refuses them."""

import json
from pathlib import Path

import numpy as np
import pytest

from command_kit import simulate
from lidarcheck.cli.core.entry import main
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.table import Table
from merging import merge


@pytest.fixture
def frames(bench_dir):
    """Three simulated frames, as tables and as files `real/frame_K.pcd`."""
    Path("real").mkdir()
    for k in range(3):
        assert simulate(f"real/frame_{k}.pcd", "--seed", str(k), "-q") == 0
    return [read_table(f"real/frame_{k}.pcd") for k in range(3)]


def assert_frames(files, tables):
    assert len(files) == len(tables)
    for file, table in zip(files, tables, strict=True):
        found = read_table(file)
        for name, column in table.columns.items():
            assert np.array_equal(found.columns[name], column), (file, name)


@pytest.mark.parametrize("suffix", [".pcd", ".txt", ".csv", ".parquet", ".ply"])
def test_frames_are_written_as_they_were(frames, suffix, capsys):
    merge(frames, f"drive{suffix}", number="frame_id")
    assert main(["split", f"drive{suffix}", "--out", "out", "--json", "split.json"]) == 0
    shown = capsys.readouterr()
    assert f"out: 3 frames of drive{suffix}, told apart by the column frame_id" in shown.err
    assert [line.split()[0] for line in shown.out.splitlines()] == ["frame", "5", "6", "7"]
    found = json.loads(Path("split.json").read_text())
    assert [(one["rows"], one["value"]) for one in found["frames"]] == [(len(t), 5 + k) for k, t in enumerate(frames)]
    files = sorted(Path("out").iterdir())
    assert [file.name for file in files] == [f"drive_{k:06d}{suffix}" for k in (5, 6, 7)]
    assert [one["file"] for one in found["frames"]] == [str(file) for file in files]
    assert_frames(files, frames)


def test_frames_of_text_are_told_apart_by_the_order_of_rows(frames, capsys):
    merge(frames, "drive.txt", leave_out=("EchoNumber",))
    assert main(["split", "drive.txt", "--out", "out", "--format", "parquet"]) == 0
    assert "3 frames of drive.txt, told apart by the order of the rows" in capsys.readouterr().err
    left = [Table({n: c for n, c in table.columns.items() if n != "EchoNumber"}) for table in frames]
    assert_frames(sorted(Path("out").glob("*.parquet")), left)


def test_ideal_scans_are_split_by_their_column(bench_dir, capsys):
    ideal = read_table("ideal.txt")
    merge([ideal, ideal], "ideals.parquet", number="Frame")
    assert main(["split", "ideals.parquet", "--out", "out", "-q"]) == 0
    assert_frames(sorted(Path("out").iterdir()), [ideal, ideal])
    assert main(["split", "ideals.parquet", "--out", "again", "--by", "order"]) == 2
    assert "is an ideal scan, whose frames only a column Frame tells apart" in capsys.readouterr().err


def test_nothing_is_replaced_and_nothing_half_written(frames, capsys, monkeypatch):
    merge(frames, "drive.pcd", number="Frame")
    assert main(["split", "drive.pcd", "--out", "real/frame_0.pcd"]) == 2
    assert "is not a directory" in capsys.readouterr().err
    Path("out").mkdir()
    Path("out/drive_000006.pcd").write_text("mine")
    assert main(["split", "drive.pcd", "--out", "out"]) == 2
    assert "out/drive_000006.pcd: is there already" in capsys.readouterr().err
    assert [file.name for file in Path("out").iterdir()] == ["drive_000006.pcd"]

    from lidarcheck.formats import pcd

    written = []

    def full(table, path):
        written.append(path)
        if len(written) == 2:
            raise OSError(28, "No space left on device")
        Path(path).write_bytes(b"x")

    monkeypatch.setattr(pcd, "write_pcd", full)
    assert main(["split", "drive.pcd", "--out", "new"]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert not Path("new").exists()


def test_a_file_of_one_frame_is_one_frame(frames, capsys):
    assert main(["split", "real/frame_1.pcd", "--out", "out"]) == 0
    assert "1 frame of real/frame_1.pcd; nothing tells more apart" in capsys.readouterr().err
    assert_frames([Path("out/frame_1_000000.pcd")], frames[1:2])


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["model.toml"], "the file is TOML, not a scan"),
        (["drive.pcd", "--by", "sweep"], "--by sweep is no column (found: X, Y, Z"),
        (
            ["drive.pcd", "--by", "time"],
            "no time tells them apart; name a column that does: lidarcheck split drive.pcd",
        ),
        (["nowhere.pcd"], "there is no such file"),
    ],
)
def test_what_cannot_be_split_is_one_line(frames, words, what, capsys):
    merge(frames, "drive.pcd")
    assert main(["split", *words, "--out", "out"]) == 2
    assert what in capsys.readouterr().err
    assert not Path("out").exists()


def test_commands_that_take_one_frame_name_the_command(frames, capsys):
    merge(frames, "drive.pcd", number="Frame")
    merge([read_table("ideal.txt")] * 2, "ideals.txt", number="Frame")
    for words, file in (
        (["vehicles", "merge", "drive.pcd", "real/frame_0.pcd", "--out", "both.pcd"], "drive.pcd"),
        (["vehicles", "merge", "real/frame_0.pcd", "real/frame_1.pcd", "--ideal", "ideals.txt", "--vehicle", "car",
          "--out", "both.pcd"], "ideals.txt"),
    ):  # fmt: skip
        assert main(words) == 2
        error = capsys.readouterr().err
        assert f"error: {file}: holds" in error
        assert f"split it: lidarcheck split {file} --out {Path(file).stem}_frames" in error
        assert error.count("\n") == 1
    assert main(["simulate", "ideals.txt", "--model", "model.toml", "--out", "one.pcd"]) == 2
    assert "ideals.txt holds several frames, and --out one.pcd is one file" in capsys.readouterr().err


def test_compare_takes_a_merged_file_for_many_frames(frames, capsys):
    merge(frames, "drive.pcd", number="Frame")
    Path("sim").mkdir()
    for k in range(3):
        assert simulate(f"sim/model_{k + 5}.txt", "--seed", str(10 + k), "-q") == 0
        capsys.readouterr()
    assert main(["compare", "drive.pcd", "sim", "--ideal", "ideal.txt", "--json", "-", "-q"]) == 0
    merged = json.loads(capsys.readouterr().out)
    assert [one["measured"] for one in merged["frames"]] == ["drive.pcd#5", "drive.pcd#6", "drive.pcd#7"]
    for k in range(3):
        Path(f"sim/model_{k + 5}.txt").rename(f"sim/frame_{k}.txt")
    assert main(["compare", "real/*.pcd", "sim", "--ideal", "ideal.txt", "--json", "-", "-q"]) == 0
    apart = json.loads(capsys.readouterr().out)
    assert merged["over_frames"] == apart["over_frames"]


def test_the_merged_file_of_a_side_without_a_partner_names_the_frame(frames, capsys):
    merge(frames, "drive.pcd", number="Frame")
    assert main(["compare", "drive.pcd", "real", "-q"]) == 2
    assert "drive.pcd#5: has no frame beside it in real, nor have 2 more" in capsys.readouterr().err


def test_info_says_how_many_frames_a_file_holds(frames, capsys):
    merge(frames, "drive.pcd", leave_out=("EchoNumber",))
    assert main(["info", "drive.pcd", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    facts = found["facts"]
    echoes = sum(int(number) * count for number, count in found["echoes_per_beam"].items())
    assert echoes == sum(len(table) for table in frames)
    assert max(map(int, found["echoes_per_beam"])) < 3  # of a frame, not of all
    sizes = sorted(len(table) for table in frames)
    assert facts["frames"] == f"3, told apart by the order of the rows; {sizes[0]} to {sizes[-1]} rows each"
    assert "renumbered" not in facts
