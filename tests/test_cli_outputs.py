"""Where a command writes, and what a person sees."""

import json
import math
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.cli.outputs import check_writable, json_text, write_result
from lidarcheck.cli.terminal import Column, progress, stage, table
from lidarcheck.errors import InputError


def test_a_place_that_can_be_written_is_left_alone(tmp_path):
    check_writable(tmp_path / "a.json", option="--json")
    assert list(tmp_path.iterdir()) == []


def test_a_directory_is_no_file(tmp_path):
    with pytest.raises(InputError, match="is a directory"):
        check_writable(tmp_path, option="--json")


def test_a_directory_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"its directory does not exist; make .*nowhere first"):
        check_writable(tmp_path / "nowhere" / "a.json", option="--json")


def test_a_file_below_a_file(tmp_path):
    (tmp_path / "f").write_text("")
    with pytest.raises(InputError, match="its directory does not exist"):
        check_writable(tmp_path / "f" / "a.json", option="--json")


@pytest.mark.parametrize("name", ["old.json", "new.json"])
def test_read_only(tmp_path, monkeypatch, name):
    # The superuser may write anywhere, so the answer is faked.
    (tmp_path / "old.json").write_text("{}")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(InputError, match="cannot be written"):
        check_writable(tmp_path / name, option="--json")


def test_a_result_goes_to_standard_output(capsys):
    check_writable("-", option="--json")
    write_result("-", "{}\n")
    assert capsys.readouterr().out == "{}\n"


def test_a_result_replaces_a_file(tmp_path):
    target = tmp_path / "a.json"
    target.write_text("old")
    write_result(target, "ü\n")
    assert target.read_text(encoding="utf-8") == "ü\n"
    assert list(tmp_path.iterdir()) == [target]


def test_a_pipe_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    check_writable(pipe, option="--json")
    write_result(pipe, "{}\n")
    assert os.read(reader, 100) == b"{}\n"
    os.close(reader)
    assert pipe.is_fifo()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_device_stays_a_device():
    with pytest.raises(InputError, match="cannot write: No space left"):
        write_result("/dev/full", "{}\n")
    assert Path("/dev/full").is_char_device()


def test_json_holds_what_the_package_returns():
    @dataclass(frozen=True)
    class Result:
        name: str
        values: tuple
        path: Path

    result = Result("a", (np.float64(0.5), math.nan, np.int32(3), np.array([1.0, np.inf]), True, None), Path("x"))
    assert json.loads(json_text({1: result})) == {
        "1": {"name": "a", "values": [0.5, None, 3, [1.0, None], True, None], "path": "x"}
    }


COLUMNS = (Column("kpi"), Column("value", right=True))
ROWS = (("ks", "0.1"), ("wasserstein", "12"))


def test_a_table_is_plain_where_nobody_watches():
    assert table(COLUMNS, ROWS) == "kpi          value\nks             0.1\nwasserstein     12\n"


def test_a_table_fits_a_terminal_and_shows_markup_as_it_is(monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setenv("NO_COLOR", "1")
    drawn = table(COLUMNS, [("[red]a", "1"), ("b " * 40, "2")], styles=("red", ""))
    assert "[red]a" in drawn
    assert "\x1b[3" not in drawn
    assert max(len(re.sub(r"\x1b\[\d+m", "", line)) for line in drawn.splitlines()) <= 40


def test_progress_is_silent_where_nobody_watches(capsys):
    with progress("checking") as show:
        show(1, 3, "a")
    with stage("reading"):
        pass
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("option", ["--html", "--json", "--junit"])
def test_a_report_never_replaces_a_scenario(option, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").mkdir()
    wall = tmp_path / "scenarios" / "wall.toml"
    wall.write_text("#")
    assert main(["check", "wall", option, "scenarios/wall.toml"]) == 2
    assert "is the name of a scenario, golden or model" in capsys.readouterr().err
    assert wall.read_text() == "#"
