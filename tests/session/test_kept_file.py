"""A file that is edited while others change it, a lock on a full disk, and rows that come and go."""

import os

import pytest

from lidarcheck.errors import UsageError
from lidarcheck.formats.lut import load_lut, parse_lut
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.lock import FileLock
from tui_kit import LUT


@pytest.fixture
def lut(tmp_path):
    path = tmp_path / "a_lut.ini"
    path.write_bytes(LUT.encode())
    return path


@pytest.fixture
def file(lut):
    file = EditedLut(lut, lut.parent)
    yield file
    file.close()


def crash(file):
    """What a killed process leaves: descriptors are closed, nothing else is done."""
    file._journal.close()
    file._lock.drop()


def other(path, scaled=700, row=5):
    """Another program writes the file."""
    path.write_bytes(load_lut(path).with_scaled("vertical", row, scaled).content)
    return path.read_bytes()


def test_what_is_kept_is_what_is_saved(file, lut):
    """Keep what is shown: the difference to the disk is what saving would change, and saving writes what is shown."""
    shown = file.content
    other(lut)
    assert file.changed_on_disk()
    file.accept_disk()
    assert file.dirty  # nothing was edited here, and still there is something to save
    assert [(c.row, c.after) for c in file.diff()] == [(5, parse_lut(shown).tables["vertical"].y[5])]
    assert file.save() == 1
    assert lut.read_bytes() == shown
    assert not file.dirty


def test_kept_edits_lose_none_of_the_others_in_silence(file, lut):
    file.set("vertical", [1], "500")
    other(lut)
    file.accept_disk()
    assert [c.row for c in file.diff()] == [1, 5]  # the question before saving names both
    file.save()
    rows = load_lut(lut).tables["vertical"].rows()
    assert (rows[1].scaled, rows[5].scaled) == (500, 429)


def test_what_is_kept_of_a_file_that_is_gone_is_written_whole(file, lut):
    shown = file.content
    lut.unlink()
    file.accept_disk()
    assert file.dirty
    file.save()
    assert lut.read_bytes() == shown
    lut.write_text("PostPro.LUT_blooming_X = 1, 2\n")
    file.accept_disk()
    assert file.dirty
    file.save()
    assert lut.read_bytes() == shown


def test_what_is_kept_outlives_the_process(file, lut):
    shown = file.content
    other(lut)
    file.accept_disk()
    crash(file)
    again = EditedLut(lut, lut.parent)
    assert "1 row not saved" in again.found_in_words()
    again.bring_back()
    assert again.content == shown
    again.save()
    assert lut.read_bytes() == shown
    again.close()


def test_who_may_only_look_keeps_what_is_older_and_that_is_said(file, lut):
    looks = EditedLut(lut, lut.parent)
    assert looks.read_only
    other(lut)
    looks.accept_disk()
    assert looks.behind
    assert not looks.dirty
    looks.reload()
    assert not looks.behind
    looks.close()


def test_a_lock_on_a_full_disk_is_taken_and_does_not_lock_itself_out(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    lock = FileLock(tmp_path / "lock")
    assert lock.take()
    monkeypatch.undo()
    assert lock.take()
    assert not FileLock(tmp_path / "lock").take()
    lock.drop()
    assert FileLock(tmp_path / "lock").take()


def test_a_session_begun_on_a_full_disk_edits_once_there_is_room(lut, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    monkeypatch.setattr(os, "fsync", full)
    file = EditedLut(lut, lut.parent)
    assert "No space left" in file.read_only
    with pytest.raises(UsageError, match="No space left"):
        file.set("vertical", [1], "500")
    monkeypatch.undo()
    assert file.claim_again()
    assert file.set("vertical", [1], "500")
    file.save()
    file.close()
    assert load_lut(lut).tables["vertical"].rows()[1].scaled == 500


def test_rows_come_and_go_and_the_file_differs_in_those_cells_only(file, lut):
    before = LUT.encode()
    x = load_lut(lut).tables["vertical"].x.tolist()
    assert file.insert("vertical", 3)  # between -50 and -33: geometric, as both have one sign
    table = file.current.tables["vertical"]
    assert table.x[4] == pytest.approx(-((50.0 * 33.0) ** 0.5), rel=1e-5)
    assert table.y[4] == pytest.approx(1e-4)
    assert [(c.row, c.x) for c in file.diff()] == [(4, table.x[4])]
    assert file.set_x("vertical", 4, "-40")
    assert file.set("vertical", [4], "0.0002")
    file.save()
    saved = lut.read_bytes()
    assert saved == before.replace(b"-50, -33", b"-50, -40, -33").replace(
        b"0.0001000, 0.0001000, 0.0001000, 0.0001000, ", b"0.0001000, 0.0001000, 0.0001000, 0.0001000, 0.0002000, ", 1
    )
    assert file.remove("vertical", [4])
    file.save()
    assert lut.read_bytes() == before
    assert [file.undo() for _ in range(4)] == ["take out", "set 0.0002", "X = -40", "add a row"]
    assert file.content == before
    assert file.remove("vertical", [0, 1, len(x) - 1])
    assert file.current.tables["vertical"].x.tolist() == x[2:-1]
    assert [c.row for c in file.diff()] == [0, 1, len(x) - 1]


def test_a_row_about_the_target_and_one_behind_the_last(file):
    x = file.current.tables["vertical"].x.tolist()
    target = x.index(0)
    assert file.insert("vertical", target)
    assert file.current.tables["vertical"].x[target + 1] == 0.5 * x[target + 1]
    last = len(file.current.tables["vertical"]) - 1
    assert file.insert("vertical", last)
    table = file.current.tables["vertical"]
    assert table.x[-1] == table.x[-2] + (table.x[-2] - table.x[-3])
    assert table.y[-1] == table.y[-2]


@pytest.mark.parametrize("value", ["-80.5", "-32", "nan", "inf", "left"])
def test_an_x_out_of_order_is_refused_with_both_neighbours(file, value):
    before = file.content
    with pytest.raises(UsageError) as refused:
        file.set_x("vertical", 3, value)
    assert file.content == before
    if value in ("-80.5", "-32"):
        assert "is not between its neighbours, -80 and -33" in str(refused.value)
        assert "from -80 to -33" in str(refused.value)


def test_the_only_row_stays(tmp_path):
    path = tmp_path / "one_lut.ini"
    path.write_text("PostPro.LUT_blooming_X = 0\nPostPro.LUT_blooming_Y = 1\n")
    file = EditedLut(path, tmp_path)
    with pytest.raises(UsageError, match="needs a row"):
        file.remove("vertical", [0])
    assert file.set_x("vertical", 0, "-2.5")
    file.close()


def test_a_crash_brings_rows_and_x_back_with_undo(file, lut):
    file.insert("vertical", 3)
    file.remove("vertical", [7])
    file.set_x("vertical", 1, "-100")
    shown = file.content
    crash(file)
    again = EditedLut(lut, lut.parent)
    assert "3 rows not saved" in again.found_in_words()
    again.bring_back()
    assert again.content == shown
    assert [again.undo() for _ in range(3)] == ["X = -100", "take out", "add a row"]
    assert again.content == LUT.encode()
    again.close()
