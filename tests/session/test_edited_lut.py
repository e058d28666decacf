"""A LUT file being edited: edits and undo, the journal, the lock, saving, and what a crash leaves."""

import os
import subprocess
import sys

import pytest

from lidarcheck.calibration.blooming.lut_edit import smoothed
from lidarcheck.cli import main
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.lut import load_lut, parse_lut
from lidarcheck.session.edited_file import ChangedOnDisk
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.journal import read_journal
from tui_kit import LUT, ROOT


@pytest.fixture
def lut(tmp_path):
    path = tmp_path / "a_lut.ini"
    path.write_bytes(LUT.encode())
    return path


@pytest.fixture
def session(lut):
    session = EditedLut(lut, lut.parent)
    yield session
    session.close()


def journal_of(session):
    return session._journal.path


def crash(session):
    """What a killed process leaves: descriptors are closed, nothing else is done."""
    session._journal.close()
    session._lock.drop()


def test_an_edit_and_its_undo_leave_every_other_byte(session, lut):
    assert session.set("vertical", [3, 4], "512")
    table = session.current.tables["vertical"]
    assert [row.scaled for row in table.rows()][3:5] == [512, 512]
    assert [change.row for change in session.diff()] == [3, 4]
    assert session.undo() == "set 512"
    assert session.current.content == LUT.encode()
    assert not session.dirty
    assert session.redo() == "set 512"
    session.save()
    saved = lut.read_bytes()
    assert saved.startswith(b"# our sign\r\n")
    assert saved.endswith(b"; the end\r\nPostPro.Other = 7")
    assert load_lut(lut).tables["vertical"].y[3] == pytest.approx(10 ** (-0.007 * 488), abs=5e-8)


def test_values_that_cannot_be_are_refused_and_change_nothing(session):
    for value in ("1001", "-1", "1.5", "0.00000001", "ten"):
        with pytest.raises(UsageError):
            session.set("vertical", [1], value)
    assert not session.dirty
    assert not session.history.done
    assert session.set("vertical", [1], "0.0125")
    assert session.current.tables["vertical"].y[1] == 0.0125
    assert not session.set("vertical", [1], "0.0125")


def test_nudges_stop_at_the_ends_of_the_scale(session):
    session.set("vertical", [1, 2], "998")
    session.nudge("vertical", [1, 2], 20)
    assert [row.scaled for row in session.current.tables["vertical"].rows()][1:3] == [1000, 1000]
    session.set("vertical", [3], "0")
    assert not session.nudge("vertical", [3], 5)


def test_smoothing_keeps_lines_the_target_and_the_ends():
    x = (-30, -20, -10, 0, 10, 25, 30)
    line = [10 ** (-4 + 0.02 * at) if at < 0 else 10 ** (-2 - 0.05 * at) if at else 1.0 for at in x]
    text = f"PostPro.LUT_blooming_X = {', '.join(map(str, x))}\nPostPro.LUT_blooming_Y = "
    straight = parse_lut((text + ", ".join(f"{y:.7f}" for y in line)).encode())
    assert smoothed(straight, "vertical", range(7)).content == straight.content
    bent = straight.with_y("vertical", 1, 0.01)
    rows = smoothed(bent, "vertical", range(7)).tables["vertical"].rows()
    assert [row.y for i, row in enumerate(rows) if i != 1] == [
        y for i, y in enumerate(bent.tables["vertical"].y) if i != 1
    ]
    # Half of the way, in log10 Y, to the line, which is where it was.
    assert rows[1].y == pytest.approx((0.01 * line[1]) ** 0.5, rel=1e-2)


def test_lut_smooth_on_the_command_line_is_the_same(lut, capsys):
    bent = LUT.replace("0.0001000, 0.0001000", "0.0300000, 0.0001000").encode()
    assert bent != LUT.encode()
    lut.write_bytes(bent)
    session = EditedLut(lut, lut.parent)
    assert session.smooth("vertical", range(5, 20))
    session.save()
    session.close()
    saved = lut.read_bytes()
    lut.write_bytes(bent)
    assert main(["lut", "smooth", str(lut), "--rows", "5..19"]) == 0
    assert lut.read_bytes() == saved
    assert "scaled" in capsys.readouterr().out


def test_an_edit_is_in_the_journal_before_it_counts(session, monkeypatch):
    session.set("vertical", [1], "500")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    before = session.current.content
    with pytest.raises(InputError, match="could not be kept"):
        session.set("vertical", [1], "600")
    assert session.current.content == before
    assert len(session.history.done) == 1
    monkeypatch.undo()
    session.set("vertical", [1], "700")
    assert [record.get("edit") for record in read_journal(journal_of(session))] == [None, "set 500", "set 700"]


def test_a_crash_brings_edits_back_with_their_history(session, lut):
    session.set("vertical", [1], "500")
    session.nudge("vertical", [1, 2], 7)
    session.undo()
    session.set("vertical", [4], "300")
    shown = session.current.content
    crash(session)
    again = EditedLut(lut, lut.parent)
    assert "2 rows not saved" in again.found_in_words()
    with pytest.raises(UsageError, match="earlier session"):
        again.set("vertical", [1], "1")
    again.bring_back()
    assert again.current.content == shown
    assert (again.undo(), again.undo()) == ("set 300", "set 500")
    assert again.current.content == LUT.encode()
    again.close()
    assert not journal_of(again).exists()


def test_a_crash_right_after_the_file_was_replaced_leaves_nothing_to_bring_back(session, lut):
    session.set("vertical", [1], "500")
    lut.write_bytes(session.current.content)  # as save does, before it can tell the journal
    crash(session)
    again = EditedLut(lut, lut.parent)
    assert not again.found
    assert not journal_of(again).exists()
    again.close()


def test_edits_of_a_crash_are_held_against_a_file_that_somebody_changed(session, lut):
    session.set("vertical", [1], "500")
    crash(session)
    lut.write_bytes(LUT.replace("the end", "another end").encode())
    again = EditedLut(lut, lut.parent)
    again.bring_back()
    with pytest.raises(ChangedOnDisk, match="changed since it was read"):
        again.save()
    assert b"another end" in lut.read_bytes()
    again.save(overwrite=True)
    assert b"the end" in lut.read_bytes()
    again.close()


@pytest.mark.parametrize("cut", [1, 7, 40])
def test_a_line_that_was_not_finished_is_left_out(session, lut, cut):
    session.set("vertical", [1], "500")
    session.set("vertical", [2], "501")
    crash(session)
    path = journal_of(session)
    path.write_bytes(path.read_bytes()[:-cut])
    again = EditedLut(lut, lut.parent)
    again.bring_back()
    assert [row.scaled for row in again.current.tables["vertical"].rows()][1:3] != [500, 501]
    assert again.current.tables["vertical"].rows()[1].scaled == 500
    again.close()


def test_a_damaged_journal_is_put_aside_and_the_file_can_be_edited(session, lut):
    session.set("vertical", [1], "500")
    crash(session)
    path = journal_of(session)
    head, edit = path.read_text().splitlines()
    path.write_text(f"{head}\n{edit.replace(chr(34) + 'old', chr(34) + 'odd')}\n")
    again = EditedLut(lut, lut.parent)
    assert "the journal is damaged" in again.notice
    assert path.with_suffix(".damaged").exists()
    assert again.set("vertical", [1], "600")
    again.close()


def test_what_is_left_is_kept_beside(session, lut):
    session.set("vertical", [1], "500")
    crash(session)
    again = EditedLut(lut, lut.parent)
    again.forget()
    assert not again.dirty
    assert len(read_journal(journal_of(again).with_suffix(".left"))) == 2
    again.close()


def test_a_file_changed_on_disk_is_asked_about(session, lut):
    session.set("vertical", [1], "500")
    lut.write_bytes(LUT.replace("our", "my").encode())
    assert session.changed_on_disk()
    with pytest.raises(ChangedOnDisk):
        session.save()
    session.accept_disk()
    session.save()
    assert b"our sign" in lut.read_bytes()
    lut.unlink()
    session.set("vertical", [1], "501")
    with pytest.raises(ChangedOnDisk, match="was removed"):
        session.save()
    lut.write_bytes(LUT.encode())
    os.utime(lut, (1, 1))  # another time, and still another content
    assert session.changed_on_disk()
    session.reload()
    assert not session.changed_on_disk()
    assert session.current.content == LUT.encode()


def test_a_save_that_fails_changes_nothing(session, lut, monkeypatch):
    session.set("vertical", [1], "500")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("lidarcheck.formats.atomic._sync", full)
    with pytest.raises(InputError, match="No space left"):
        session.save()
    assert lut.read_bytes() == LUT.encode()
    assert session.dirty


def test_two_instances_on_one_file(session, lut):
    other = EditedLut(lut, lut.parent)
    assert f"is being edited by process {os.getpid()}" in other.read_only
    with pytest.raises(UsageError, match="is being edited"):
        other.set("vertical", [1], "500")
    session.set("vertical", [1], "510")
    session.save()
    session.close()
    assert other.claim_again()
    assert other.current.tables["vertical"].rows()[1].scaled == 510
    other.close()


def test_the_lock_of_a_killed_process_is_free(lut):
    program = (
        "import sys, time; from pathlib import Path; from lidarcheck.session.edited_lut import EditedLut\n"
        "s = EditedLut(Path(sys.argv[1]), Path(sys.argv[1]).parent); print(s.read_only, flush=True); time.sleep(60)"
    )
    child = subprocess.Popen([sys.executable, "-c", program, str(lut)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "\n"
    here = EditedLut(lut, lut.parent)
    assert f"process {child.pid}" in here.read_only
    child.kill()
    child.wait()
    child.stdout.close()
    assert here.claim_again()
    here.close()


def test_killed_sessions_lose_nothing(tmp_path):
    command = [sys.executable, str(ROOT / "tests/kits/killed_edits.py"), str(tmp_path), "40", "3"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "tests"), *sys.path])}
    ran = subprocess.run(command, check=False, capture_output=True, text=True, env=environment)
    assert ran.returncode == 0, ran.stderr
    assert "doing" in ran.stdout


def test_what_a_killed_save_left_is_swept_up(session, lut):
    old, new = (lut.with_name(f".a_lut.ini.{name}.part") for name in ("0" * 16, "1" * 16))
    for part in (old, new):
        part.write_text("half")
    os.utime(old, (1, 1))
    crash(session)
    EditedLut(lut, lut.parent).close()
    assert not old.exists()
    assert new.exists()


def test_many_edits_stay_small(session):
    import tracemalloc

    tracemalloc.start()
    for number in range(200):
        session.set("vertical", [number % 12], str(300 + number))
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(session.history.done) == 200
    assert size < 4e5  # some hundred bytes an edit, and no copies of the file
