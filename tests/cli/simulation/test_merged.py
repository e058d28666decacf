"""`lidarcheck simulate` of a file that holds several ideal scans."""

from pathlib import Path

from lidarcheck.cli.core.entry import main
from lidarcheck.formats.recognise import read_table, write_table
from merging import merge


def test_each_frame_of_a_merged_ideal_scan_is_simulated(bench_dir, capsys):
    near = read_table("ideal.txt")
    write_table(near.with_column("Distance", near.columns["Distance"] + 20.0), "far.txt")
    merge(["ideal.txt", "far.txt"], "ideals.parquet", number="Frame", first=0)
    arguments = ["--model", "model.toml", "--seed", "3", "--jobs", "1", "-q"]
    assert main(["simulate", "ideals.parquet", *arguments, "--out", "merged"]) == 0
    assert main(["simulate", "ideal.txt", "far.txt", *arguments, "--out", "apart"]) == 0
    assert sorted(file.name for file in Path("merged").glob("*.parquet")) == [
        "ideals_000000.parquet",
        "ideals_000001.parquet",
    ]
    for merged, apart in (("ideals_000000", "ideal"), ("ideals_000001", "far")):
        one, other = read_table(f"merged/{merged}.parquet"), read_table(f"apart/{apart}.parquet")
        assert one.names == other.names
        assert all((one.columns[name] == other.columns[name]).all() for name in one.names)
    merge(["far.txt", "ideal.txt"], "ideals.parquet", number="Frame", first=0)
    assert main(["simulate", "ideals.parquet", *arguments, "--out", "merged"]) == 2
    assert "merged: holds frames of another ideals_000000" in capsys.readouterr().err
