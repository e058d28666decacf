"""The terminal interface's core: the LUT session, its journal and lock, the project, runs and state."""

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from lidarcheck.calibration.blooming.lut_edit import smoothed
from lidarcheck.cli import main
from lidarcheck.cli.core.app import COMMANDS
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.lut import load_lut, parse_lut
from lidarcheck.session.edited_file import ChangedOnDisk
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.journal import read_journal
from lidarcheck.session.own_files import make_own_directory
from lidarcheck.session.project import read_project
from lidarcheck.session.state import State, load_state, save_state
from lidarcheck.tui.actions import ACTIONS, SCREENS
from lidarcheck.tui.jobs.checks import Runs, check_scenario, run_scenarios
from lidarcheck.tui.jobs.job import Cancelled
from lidarcheck.tui.jobs.profiles import datasets_of
from lidarcheck.tui.widgets.lines import folded
from tui_kit import LUT, ROOT, fake_check, make_project


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return make_project(tmp_path_factory.mktemp("tui") / "project")


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
    command = [sys.executable, str(ROOT / "tests/kits/tui_kit.py"), str(tmp_path), "40", "3"]
    ran = subprocess.run(command, check=False, capture_output=True, text=True)
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


# The project


def test_a_project_names_what_is_there_and_what_is_wrong(project):
    found = read_project(project)
    assert found.in_words() == "3 scenarios, 2 goldens, 3 models, 3 luts, 2 profiles, 1 scan"
    faults = {entry.name: entry.fault for entry in found.faults}
    assert set(faults) == {"scenarios/broken.toml", "bad_lut.ini", "measured/empty.txt"}
    assert "bad_lut.ini:2: number 2 of PostPro.LUT_blooming_Y is" in faults["bad_lut.ini"]
    assert "this is not TOML" in faults["scenarios/broken.toml"]
    assert "the file is empty" in faults["measured/empty.txt"]
    assert [dataset.name for dataset in datasets_of(found, "vertical")] == [
        "measured/sign_69m.csv",
        "measured/sign_157m.csv",
    ]
    assert datasets_of(found, "horizontal") == []


def test_scans_find_their_ideal_scan_by_name(tmp_path):
    head = "Layer Point Distance MaterialID IncidenceAngle\n1 1 20.0 1 0.0\n"
    for name in ("ideal_sign_69m.txt", "sign_156.6m_ideal.txt"):
        (tmp_path / name).write_text(head)
    for name in ("real_sign_69m.txt", "sign_156.6m.txt", "lonely.txt"):
        (tmp_path / name).write_text("X Y Z Point Layer EchoNumber WIDTH AREA PEAK\n1 2 3 1 1 1 5 6 7\n")
    pairs = {d.name: d.ideal and d.ideal.name for d in datasets_of(read_project(tmp_path), "vertical")}
    assert pairs == {
        "lonely.txt": None,
        "real_sign_69m.txt": "ideal_sign_69m.txt",
        "sign_156.6m.txt": "sign_156.6m_ideal.txt",
    }


def test_no_file_keeps_the_others_from_being_used(project, monkeypatch):
    (project / "models/deep.toml").write_text(f"a = {'[' * 5000}{']' * 5000}")
    (project / "models/empty.toml").write_text("")
    os.mkfifo(project / "models/pipe.toml")
    (project / "models/again.toml").symlink_to("again.toml")
    monkeypatch.setattr("lidarcheck.formats.lut.load_lut", lambda _path: 1 / 0)
    found = read_project(project)
    faults = {entry.name: entry.fault for entry in found.faults}
    assert "nested too deeply" in faults["models/deep.toml"]
    assert "is empty" in faults["models/empty.toml"]
    assert "not a regular file" in faults["models/pipe.toml"]
    assert "symbolic links" in faults["models/again.toml"]
    assert faults["a_lut.ini"] == f"{project / 'a_lut.ini'}: cannot be looked at, ZeroDivisionError: division by zero"
    assert len(found.of("model")) == 3


def test_a_directory_that_cannot_be_read_is_said(project, monkeypatch):
    scandir = os.scandir

    def refusing(path):
        if Path(path).name == "measured":
            raise PermissionError(13, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refusing)
    found = {entry.name: entry.fault for entry in read_project(project).faults}
    assert "the directory cannot be read: Permission denied; check its permissions" in found["measured"]
    assert "measured/empty.txt" not in found


def test_a_project_that_was_removed_is_not_made_again(tmp_path):
    save_state(State(screen="noise"), tmp_path / "gone")
    assert not (tmp_path / "gone").exists()
    with pytest.raises(InputError, match="cannot make the directory"):
        make_own_directory(tmp_path / "gone")


def test_a_folded_line_keeps_its_roles_and_every_letter():
    assert folded((("short", "text"),), 10) == [(("short", "text"),)]
    parts = (("one two ", "title"), ("three 漢字漢字漢字漢字 four", "bad"))
    rows = folded(parts, 24)
    assert rows == [(("one two ", "title"), ("three ", "bad")), (("  ", "text"), ("漢字漢字漢字漢字 four", "bad"))]
    assert [row[0][0] for row in folded((("abcdef", "text"),), 2)] == ["ab", "cd", "ef"]
    assert len(folded((("漢字", "text"),), 1)) == 2


def test_no_directory_is_a_project(tmp_path):
    (tmp_path / "file").write_text("x")
    for name, what in (("file", "is not a directory"), ("none", "there is no such directory")):
        with pytest.raises(InputError, match=what):
            read_project(tmp_path / name)


# Runs and state


def test_a_run_is_kept_and_a_fault_does_not_stop_the_others(project, tmp_path):
    found = []
    paths = [project / f"scenarios/{name}.toml" for name in ("broken", "background_SMART")]

    def check(paths, progress):
        if paths[0].stem == "broken":
            from lidarcheck.harness.scenario.scenario import load_scenario

            load_scenario(paths[0])
        return fake_check(paths, progress)

    run_scenarios(paths, on_progress=lambda *_: None, on_outcome=found.append, stop=threading.Event(), check=check)
    assert [outcome.verdict for outcome in found] == ["fault", "fell out"]
    assert "broken.toml" in found[0].problems[0]
    assert [kpi.verdict for kpi in found[1].kpis] == ["equivalent", "regressed"]
    assert found[1].kpis[0].limit == "<= 3"
    runs = Runs(tmp_path)
    for outcome in found:
        runs.add(outcome)
    assert Runs(tmp_path).last == runs.last
    (tmp_path / ".lidarcheck/tui/runs.json").write_text('{"a": 1}')
    assert Runs(tmp_path).last == {}


def test_a_run_stops_when_it_is_told_to(project):
    stop, start = threading.Event(), time.monotonic()
    stop.set()
    with pytest.raises(Cancelled):
        run_scenarios([project / "scenarios/background_SMART.toml"] * 9, on_progress=print, on_outcome=print, stop=stop)
    assert time.monotonic() - start < 1.0


def test_a_real_run_holds(project):
    outcome = check_scenario(project / "scenarios/background_SMART.toml")
    assert outcome.verdict == "holds"
    assert outcome.kpis
    assert {kpi.verdict for kpi in outcome.kpis} == {"identical"}


def test_the_state_survives_and_a_damaged_one_is_a_fresh_one(tmp_path):
    save_state(State("blooming", "plain", True, {"row": "3"}), tmp_path)
    assert load_state(tmp_path) == State("blooming", "plain", True, {"row": "3"})
    assert (tmp_path / ".lidarcheck/.gitignore").read_text() == "*\n"
    for text in ("", "[]", '{"selected": 3, "screen": null}'):
        (tmp_path / ".lidarcheck/tui/state.json").write_text(text)
        assert load_state(tmp_path).selected == {}


# Actions


@pytest.mark.parametrize("action", ACTIONS, ids=lambda action: f"{action.screen} {action.name}")
def test_every_action_has_a_twin_or_a_reason(action, capsys):
    assert action.screen in ("", *SCREENS)
    assert action.help
    assert bool(action.reason) != bool(action.twin)
    if action.twin:
        assert action.twin in {command.name for command in COMMANDS}
        assert main([*action.twin.split(), "--help"]) == 0
        text = " ".join(capsys.readouterr().out.split())
        assert action.says
        assert action.says in text


def test_no_key_means_two_things_on_a_screen():
    for screen in SCREENS:
        keys = [key for action in ACTIONS if action.screen in ("", screen) for key in action.keys]
        assert len(keys) == len(set(keys))


# The command


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "the terminal interface needs a terminal, and stdin is none; run it in a terminal without pipes"),
        (["nowhere"], "nowhere: there is no such directory; give the directory with scenarios"),
    ],
)
def test_without_a_terminal_it_says_so(arguments, said, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["tui", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("term", ["dumb", ""])
def test_a_terminal_that_cannot_place_text_is_refused(term, capsys, monkeypatch, tmp_path):
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(getattr(sys, name), "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", term)
    assert main(["tui", str(tmp_path)]) == 2
    assert "cannot place text; set TERM" in capsys.readouterr().err


def test_help_loads_no_textual():
    program = "import sys\nfrom lidarcheck.cli import main\nmain(['--help']); main(['tui', '--help'])\n"
    program += "print([name for name in sys.modules if name.startswith('textual')], file=sys.stderr)"
    ran = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert json.loads(ran.stderr.replace("'", '"')) == []
