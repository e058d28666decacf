"""Runs that the interface starts: noted when they begin and end, found again at the next start."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from lidarcheck.errors import InputError
from lidarcheck.session.runs import Plan, RunBook

STEP = ("bloom", "fit", "a b.txt", "--out", ".lidarcheck/tui/runs/1/out")


def plan(**more):
    return Plan("bloom fit", (STEP,), ".lidarcheck/tui/runs/1/out/result.json", {"table": "v.ini"}, **more)


def test_a_run_is_noted_and_read_again(tmp_path):
    book = RunBook(tmp_path)
    assert book.next_directory == ".lidarcheck/tui/runs/1"
    run = book.begin(plan(copies={".lidarcheck/tui/runs/1/input/v.ini": b"edited"}))
    assert (tmp_path / ".lidarcheck/tui/runs/1/input/v.ini").read_bytes() == b"edited"
    assert run.line == "lidarcheck bloom fit 'a b.txt' --out .lidarcheck/tui/runs/1/out"
    run = book.process(run, os.getpid())
    assert book.is_alive(run)
    (again,) = RunBook(tmp_path).runs  # another terminal, while it goes on
    assert (again, again.state) == (run, "running")
    run = book.end(run, 2, "v.ini:3: X = 3 is below its neighbour")
    assert run.state == "failed: v.ini:3: X = 3 is below its neighbour"
    second = book.end(book.begin(plan()), 0)
    assert (second.number, second.state) == (2, "done")
    book.took(second)
    assert RunBook(tmp_path).runs == book.runs
    assert [(one.number, one.taken) for one in book.runs] == [(2, True), (1, False)]


@pytest.mark.parametrize("made", [True, False])
def test_an_end_that_nobody_saw(tmp_path, made):
    book = RunBook(tmp_path)
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    run = book.process(book.begin(plan()), child.pid)
    assert not RunBook(tmp_path).look()
    child.communicate(b"\n")
    if made:
        (tmp_path / run.makes).parent.mkdir()
        (tmp_path / run.makes).write_text("{}")
    (seen,) = RunBook(tmp_path).runs
    assert seen.state == ("done" if made else "stopped")
    assert book.look()
    assert book.runs[0].state == seen.state
    # A process that has its number by now is another one.
    assert not book.is_alive(run)


def test_records_that_are_none_are_passed_over(tmp_path):
    book = RunBook(tmp_path)
    book.end(book.begin(plan()), 0)
    runs = tmp_path / ".lidarcheck/tui/runs"
    for number, text in enumerate(("{", "[]", '{"number": 3}', json.dumps({"number": "x", "steps": 3}))):
        (runs / f"1{number}").mkdir()
        (runs / f"1{number}/run.json").write_text(text)
    (runs / "file").write_text("")
    assert [run.number for run in RunBook(tmp_path).runs] == [1]


def test_nothing_is_written_through_a_link(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "bench/.lidarcheck/tui").mkdir(parents=True)
    (tmp_path / "bench/.lidarcheck/tui/runs").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="is a link"):
        RunBook(tmp_path / "bench").begin(plan())
    assert not list((tmp_path / "elsewhere").iterdir())


def test_runs_of_long_ago_go(tmp_path):
    book = RunBook(tmp_path)
    for _ in range(43):
        book.end(book.begin(plan()), 0)
    assert [run.number for run in book.runs] == list(range(43, 3, -1))
    assert len(list((tmp_path / ".lidarcheck/tui/runs").iterdir())) == 40
    shutil.rmtree(tmp_path / ".lidarcheck")
    book.begin(plan())
