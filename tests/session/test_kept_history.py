"""What was found with each edit is there after the session, whatever became of the file that it is noted in."""

import json
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.calibration.number.number import Number, Step
from lidarcheck.errors import InputError
from lidarcheck.session.kept_history import KeptHistory, read_history
from lidarcheck.session.open_files import Step as Edit


def number(value):
    return Number("misfit", value, 0.4, {}, "", np.array([value, value + 0.1]), "", "scale", str(value))


def test_edits_are_read_in_their_order_with_what_became_of_them(tmp_path):
    kept, path = KeptHistory(tmp_path), tmp_path / ".lidarcheck/tui/history.jsonl"
    assert read_history(tmp_path) == []
    edit = Edit(2, Path("a_lut.ini"), "nudge +1", when=20.0)
    kept.number(10.0, Edit(0, None, "as read", when=10.0), "sign, misfit", number(3.0), None)
    kept.number(10.0, edit, "sign, misfit", number(2.0), None)
    kept.number(10.0, edit, "sign, misfit", number(2.0), Step(-1.0, -1.2, -0.8, "better"))
    kept.moved(10.0, 2, undone=True)
    first, second = read_history(tmp_path)
    assert (first.edit, first.what, first.undone) == (0, "as read", False)
    assert (second.file, second.what, second.when, second.undone) == ("a_lut.ini", "nudge +1", 20.0, True)
    found = second.numbers["sign", "misfit"]
    assert (found["value"], found["difference"], found["word"]) == (2.0, -1.0, "better")
    assert found["key"] == number(2.0).key
    # A line that is none, and one that was not finished, take nothing with them.
    with path.open("a") as file:
        for bad in (
            {"began": float("inf"), "edit": 1},
            {"began": 1, "edit": float("inf"), "undone": True},
            {"began": 1, "edit": 1, "when": "x", "number": found},
            {"began": 1, "edit": 1, "when": 1, "file": "", "what": "", "number": {**found, "difference": "x"}},
            {"began": 1, "edit": 1, "when": 1, "file": "", "what": "", "number": {**found, "value": float("nan")}},
        ):
            file.write(json.dumps(bad) + "\n")
        file.write(json.dumps({"began": "x"}) + "\n" + json.dumps({"began": 1, "edit": 1, "number": 3}) + "\n{")
    assert len(read_history(tmp_path)) == 2
    kept.moved(10.0, 2, undone=False)
    # The file gives way when it is long, and to a link nothing is written.
    path.write_text((json.dumps({"began": 1.0}) + " " * 99_980 + "\n") * 50)
    KeptHistory(tmp_path).number(11.0, edit, "sign, misfit", number(2.0), None)
    assert path.stat().st_size < 2_100_000
    assert [one.edit for one in read_history(tmp_path)] == [2]
    other = tmp_path / "other"
    other.write_text("")
    path.unlink()
    path.symlink_to(other)
    kept.number(10.0, edit, "sign, misfit", number(2.0), None)
    assert other.read_text() == ""


def test_where_nothing_can_be_written_nothing_is_noted(tmp_path):
    (tmp_path / ".lidarcheck").write_text("")
    KeptHistory(tmp_path).number(1.0, Edit(1, None, ""), "sign, misfit", number(2.0), None)
    with pytest.raises(InputError, match="cannot read: Not a directory"):
        read_history(tmp_path)
