"""`lidarcheck lut`: several cells at once, on the editor's scale, and back."""

import json
import math
import os
import threading

import pytest

from lidarcheck.cli import main
from lidarcheck.errors import InputError
from lidarcheck.formats.lut import load_lut, save_lut
from lidarcheck.formats.lut_scale import y_of_scaled
from places import shared_path

TEXT = (
    b"; kept\r\n[PostPro]\r\nPostPro.LUT_blooming_X = -20, -10 , 0,10,20,20\r\n"
    b"PostPro.LUT_blooming_Y = 0.0001234, .001,1, 0.002 ,0.0000001,0 ; tail\r\nother = 1\r\n"
)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "lut.ini"
    path.write_bytes(TEXT)
    return path


def run(*argv):
    return main([str(part) for part in argv])


def test_show_as_json(file, capsys):
    assert run("lut", "show", file, "--json") == 0
    (table,) = json.loads(capsys.readouterr().out)
    assert table["name"] == "vertical"
    assert table["rows"][0] == {"x": -20.0, "y": 0.0001234, "scaled": 442}
    assert [row["scaled"] for row in table["rows"]] == [442, 571, 1000, 614, 1, 0]


def test_show_both_tables(tmp_path, capsys):
    both = tmp_path / "both.ini"
    names = ("vertical_lut.ini", "horizontal_lut.ini")
    both.write_bytes(b"\n".join(shared_path(f"samples/{name}").read_bytes() for name in names))
    assert run("lut", "show", both) == 0
    out = capsys.readouterr().out
    assert "vertical: X in SPAD rows" in out
    assert "horizontal: X in columns" in out
    assert run("lut", "set", both, "--row", "0=3") == 2
    assert "two tables; say which: --table" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["set", "scale"])
def test_keep_writes_the_same_bytes(file, command):
    assert run("lut", command, file, "--keep", "-q") == 0
    assert file.read_bytes() == TEXT
    assert not file.with_name("lut.ini.undo").exists()
    assert run("lut", command, file, "--keep", "--out", file.with_name("copy.ini"), "-q") == 0
    assert file.with_name("copy.ini").read_bytes() == TEXT


def test_several_cells_at_once(file):
    assert run("lut", "set", file, "--at", "-20..-10=512", "--row", "3=0", "--row", "5=1000", "-q") == 0
    expected = TEXT.replace(b"0.0001234, .001", b"0.0003837, 0.0003837").replace(b" 0.002 ,", b" 0.0000000 ,")
    assert file.read_bytes() == expected.replace(b",0 ;", b",1.0000000 ;")
    assert file.with_name("lut.ini.undo").read_bytes() == TEXT


def test_undo_and_again(file):
    run("lut", "set", file, "--row", "0=3", "-q")
    edited = file.read_bytes()
    assert run("lut", "undo", file, "-q") == 0
    assert file.read_bytes() == TEXT
    assert run("lut", "undo", file, "-q") == 0
    assert file.read_bytes() == edited
    file.with_name("lut.ini.undo").unlink()
    assert run("lut", "undo", file, "-q") == 2


def test_a_dry_run_writes_nothing(file, capsys):
    assert run("lut", "set", file, "--row", "0=3", "--dry-run") == 0
    assert file.read_bytes() == TEXT
    assert "0.0001234" in capsys.readouterr().out


def test_a_shown_value_changes_nothing(file):
    assert run("lut", "set", file, "--row", "0=442", "-q") == 0
    assert file.read_bytes() == TEXT


def test_scale_by_steps(file):
    assert run("lut", "scale", file, "--by", "-20", "--x", "-20..-10,10", "-q") == 0
    y = load_lut(file).tables["vertical"].y.tolist()
    assert y == [round(y_of_scaled(s), 7) for s in (422, 551)] + [1.0, round(y_of_scaled(594), 7), 1e-7, 0.0]


def test_scale_by_a_factor(file):
    assert run("lut", "scale", file, "--factor", "2", "--rows", "0..1,3", "-q") == 0
    assert load_lut(file).tables["vertical"].y.tolist() == [0.0002468, 0.002, 1.0, 0.004, 1e-7, 0.0]


def test_clip_stops_at_the_ends(file, capsys):
    assert run("lut", "scale", file, "--by", "600") == 2
    assert "row 0 (X = -20) would get scaled Y = 1042, which must lie between 1 and 1000" in capsys.readouterr().err
    assert file.read_bytes() == TEXT
    assert run("lut", "scale", file, "--by", "600", "--clip", "-q") == 0
    assert load_lut(file).tables["vertical"].rows()[0].scaled == 1000


@pytest.mark.parametrize(
    ("argv", "what"),
    [
        (("--row", "0=1001"), "scaled Y = 1001 is out of range; use a whole number from 0 to 1000"),
        (("--row", "0=-1"), "scaled Y = -1 is out of range"),
        (("--row", "0=2.5"), "scaled Y = 2.5 is out of range"),
        (("--row", "0=x"), "scaled Y = x is out of range"),
        (("--row", "0=1.5", "--true-y"), "Y = 1.5 is out of range; use a number from 0 to 1"),
        (("--row", "6=1"), "lut.ini: rows 6: the vertical table has rows 0 to 5"),
        (("--row", "3..1=1"), "use N or N..M"),
        (("--row", "a=1"), "'a' names no rows"),
        (("--row", "3"), "has no value"),
        (("--at", "-15=400"), "no X = -15; the nearest is -20; X goes from -20 to 20"),
        (("--at", "11..19=400"), "no X lies in 11..19"),
        (("--at", "-10..-20=400"), "lut.ini: X -10..-20 runs downward; write -20..-10"),
        (("--table", "horizontal", "--row", "0=1"), "no horizontal table; it has a vertical one"),
        (("--table", "up", "--row", "0=1"), "there is no table 'up'"),
        ((), "nothing is set"),
        (("--keep", "--row", "0=1"), "--keep writes without edits"),
    ],
)
def test_what_is_refused(file, argv, what, capsys):
    assert run("lut", "set", file, *argv) == 2
    assert what in capsys.readouterr().err
    assert file.read_bytes() == TEXT


def test_rows_are_added_and_only_they_differ(file):
    assert run("lut", "add", file, "--after", "0", "--at", "15=512", "--at", "-30=0.25", "--true-y", "-q") == 2
    assert file.read_bytes() == TEXT
    assert run("lut", "add", file, "--after", "0..1", "--at", "15=512", "--at", "-30", "--at", "25", "-q") == 0
    lines = TEXT.replace(b"= -20, -10 , 0,10,20,20", b"= -30, -20, -14.1421, -10, -5 , 0,10, 15,20,20, 25")
    # log10 Y over X between the two; beyond the ends as at the end; 512 as it is spelled everywhere
    middles = [f"{10 ** (math.log10(a) + part * math.log10(b / a)):.7f}" for a, b, part in (
        (0.0001234, 0.001, 0.58579), (0.001, 1.0, 0.5))]  # fmt: skip
    lines = lines.replace(
        b"= 0.0001234, .001,1", f"= 0.0001234, 0.0001234, {middles[0]}, .001, {middles[1]},1".encode()
    )
    lines = lines.replace(b" 0.002 ,0.0000001,0 ;", b" 0.002, 0.0003837 ,0.0000001,0, 0 ;")
    assert file.read_bytes() == lines
    assert run("lut", "remove", file, "--x", "-30", "--x", "-14.1421", "--rows", "4,7,10", "-q") == 0
    assert file.read_bytes() == TEXT
    assert run("lut", "undo", file, "-q") == 0
    assert file.read_bytes() == lines


def test_a_row_gets_another_x_and_only_that_cell_differs(file, capsys):
    assert run("lut", "set", file, "--x", "1=-15.5", "--row", "1=512") == 0
    expected = TEXT.replace(b"-10 ,", b"-15.5 ,").replace(b" .001,", b" 0.0003837,")
    assert file.read_bytes() == expected
    capsys.readouterr()
    assert run("lut", "set", file, "--x", "1=3") == 2
    assert (
        "lut.ini:3: X = 3 is not between its neighbours, -20 and 0; use a number from -20 to 0"
        in capsys.readouterr().err
    )
    assert file.read_bytes() == expected


@pytest.mark.parametrize(
    ("argv", "what"),
    [
        (("set", "--x", "0=-5"), "lut.ini:3: X = -5 is above its neighbour, -10; use -10 or less"),
        (("set", "--x", "5=3"), "lut.ini:3: X = 3 is below its neighbour, 20; use 20 or more"),
        (("set", "--x", "0=a"), "X = a is no number"),
        (("set", "--x", "0=nan"), "X = nan is no number"),
        (("set", "--x", "0..1=3"), "--x 0..1=3 names several rows"),
        (("add",), "nothing is added; use --after ROWS or --at X"),
        (("add", "--after", "6"), "rows 6: the vertical table has rows 0 to 5"),
        (("add", "--at", "20"), "row 4 of the vertical table has X = 20 already"),
        (("add", "--at", "15=1001"), "scaled Y = 1001 is out of range"),
        (("add", "--at", "inf"), "X = inf is no number"),
        (("remove",), "nothing is taken out; use --rows ROWS or --x RANGES"),
        (("remove", "--rows", "0..5"), "a table needs a row"),
        (("remove", "--x", "11"), "no X = 11; the nearest is 10"),
    ],
)
def test_rows_that_are_refused(file, argv, what, capsys):
    assert run("lut", argv[0], file, *argv[1:]) == 2
    assert what in capsys.readouterr().err
    assert file.read_bytes() == TEXT


@pytest.mark.parametrize(
    "argv",
    [(), ("--by", "3", "--factor", "2"), ("--factor", "0"), ("--factor", "nan"), ("--by", "1.5"), ("--by", "-1.5")],
)
def test_what_scale_refuses(file, argv):
    assert run("lut", "scale", file, *argv) == 2
    assert file.read_bytes() == TEXT


def test_an_edit_into_the_file_itself_can_be_taken_back(file):
    assert run("lut", "set", file, "--row", "0=3", "--out", file.parent / "." / "lut.ini", "-q") == 0
    assert run("lut", "undo", file, "-q") == 0
    assert file.read_bytes() == TEXT


def test_an_edit_that_fails_keeps_the_last_one_to_take_back(file, monkeypatch, capsys):
    run("lut", "set", file, "--row", "0=3", "-q")
    edited = file.read_bytes()
    monkeypatch.setattr("lidarcheck.formats.lut.save_lut", full_for(file))
    assert run("lut", "set", file, "--row", "1=3") == 2
    assert "No space left on device" in capsys.readouterr().err
    assert file.read_bytes() == edited
    assert file.with_name("lut.ini.undo").read_bytes() == TEXT
    assert run("lut", "undo", file) == 2
    assert (file.read_bytes(), file.with_name("lut.ini.undo").read_bytes()) == (edited, TEXT)


def full_for(file):
    """Saving as on a disk that has room for the undo, and none for the file."""

    def save(lut, path):
        if path == file:
            raise InputError("cannot write: No space left on device", file=path, fix="make room")
        save_lut(lut, path)

    return save


def test_two_edits_at_once_never_lose_one(file, monkeypatch, capsys):
    """The second edit read the file before the first was written."""
    stale = load_lut(file)
    run("lut", "set", file, "--row", "0=3", "-q")
    edited = file.read_bytes()
    monkeypatch.setattr("lidarcheck.formats.lut.load_lut", lambda _path: stale)
    assert run("lut", "set", file, "--row", "1=3") == 2
    assert "was changed by somebody else meanwhile; run the command again" in capsys.readouterr().err
    assert file.read_bytes() == edited
    assert file.with_name("lut.ini.undo").read_bytes() == TEXT


def test_undo_says_what_is_missing(file, capsys):
    assert run("lut", "undo", file) == 2
    assert "lut.ini: there is no edit to take back; an edit leaves" in capsys.readouterr().err
    assert run("lut", "undo", file.with_name("none.ini")) == 2
    assert "none.ini: there is no such file" in capsys.readouterr().err


def test_a_table_in_a_pipe_is_shown(tmp_path, capsys):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(TEXT,))
    writer.start()
    assert run("lut", "show", pipe) == 0
    writer.join()
    assert "-20     442" in capsys.readouterr().out
