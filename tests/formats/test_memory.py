"""What reading takes beside the table that it gives: at most twice as much again."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.formats.pcd import write_pcd
from lidarcheck.formats.ply import write_ply
from lidarcheck.formats.recognise import write_table
from lidarcheck.formats.table import Table

ROWS = 250_000
# A first small file of the kind makes what libraries keep for themselves; its high-water mark is then forgotten.
READ = """
import pathlib, sys
from lidarcheck.errors import InputError
from lidarcheck.formats.recognise import read_table
status = lambda key: next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith(key))
for path in sys.argv[1:]:
    pathlib.Path("/proc/self/clear_refs").write_text("5")
    before, size = status("VmRSS"), 0
    try:
        table = read_table(path)
        size = sum(column.nbytes for column in table.columns.values())
    except InputError as error:
        print(error, file=sys.stderr)
    print(status("VmHWM") - before, size // 1024)
"""


def a_table(rows: int) -> Table:
    rng = np.random.default_rng(5)
    columns = {axis: np.round(rng.uniform(-200, 200, rows), 4) for axis in "XYZ"}
    layer, point = np.divmod(np.arange(rows), 960)
    columns |= {"Layer": layer, "Point": point, "EchoNumber": np.ones(rows, np.int64)}
    return Table(columns | {name: rng.integers(9, 6000, rows).astype(float) for name in ("WIDTH", "AREA", "PEAK")})


def _blanks(table: Table, path: Path, gap: bytes) -> None:
    write_table(table, path)
    path.write_bytes(path.read_bytes().replace(b" ", gap))


WRITERS: dict[str, Callable[[Table, Path], None]] = {
    "a.txt": write_table,
    "blanks.txt": lambda table, path: _blanks(table, path, b"  "),
    "tabs.txt": lambda table, path: _blanks(table, path, b"\t"),
    "a.csv": write_table,
    "a.parquet": write_table,
    "a.las": write_table,
    "a.laz": write_table,
    "ascii.pcd": lambda table, path: write_pcd(table, path, "ascii"),
    "binary.pcd": lambda table, path: write_pcd(table, path, "binary"),
    "packed.pcd": write_pcd,
    "ascii.ply": lambda table, path: write_ply(table, path, "ascii"),
    "binary.ply": write_ply,
}


def _taken_kib(*paths: Path) -> tuple[list[tuple[int, int]], str]:
    """For each file, what reading it took at most and the size of the table; and what was said."""
    run = subprocess.run(
        [sys.executable, "-c", READ, *map(str, paths)], capture_output=True, text=True, check=True, timeout=120
    )
    lines = [line.split() for line in run.stdout.splitlines()]
    return [(int(taken), int(size)) for taken, size in lines], run.stderr


needs_marks = pytest.mark.skipif(
    not Path("/proc/self/clear_refs").exists(), reason="the system keeps no high-water mark that can be reset"
)


@needs_marks
@pytest.mark.parametrize("name", WRITERS)
def test_reading_takes_at_most_three_times_the_table(name: str, tmp_path: Path) -> None:
    first = tmp_path / f"first_{name}"
    WRITERS[name](a_table(20_000), first)
    WRITERS[name](a_table(ROWS), tmp_path / name)
    found, _ = _taken_kib(first, tmp_path / name)
    taken, size = found[1]
    assert size > 10_000
    assert taken <= 3 * size


@needs_marks
@pytest.mark.parametrize("name", ["line.txt", "line.csv"])
def test_an_endless_line_takes_no_more_than_a_megabyte_or_two(name: str, tmp_path: Path) -> None:
    write_table(a_table(1000), tmp_path / f"first{Path(name).suffix}")
    path = tmp_path / name
    path.write_bytes((b"X Y Z\n" if name == "line.txt" else b"X,Y,Z\n") + b"1 2 3 " * 5_000_000)
    found, said = _taken_kib(tmp_path / f"first{Path(name).suffix}", path)
    assert f"error: {path}:2: the line is longer than 1048576 bytes" in said
    assert found[1][0] < 4096
